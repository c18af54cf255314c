r"""Amplitude and phase of a noisy sine of known frequency, with honest intervals (handout 3.4's fit_sine_wave).

Least squares of

.. math::  y = a \sin\omega t + b \cos\omega t + c + e\,t, \qquad A = |a + jb|, \quad \varphi = \arg(a + jb),

over whole periods after the transient. Residuals of a rig are coloured: friction adds odd harmonics, which whole
periods keep orthogonal to the fundamental (all but, beside the drift), and the track adds slow, position-dependent
forces. Neighbouring samples are then not independent and the usual formula is far too optimistic, so the error comes
from the spread between blocks of whole periods: each block gives a phasor of its own, real and imaginary part share
one variance, and with K blocks that variance has 2(K - 1) degrees of freedom.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from math import ceil, degrees, floor, inf, pi

import numpy as np
import numpy.typing as npt
from scipy import stats

from flexdrive_gym.recording import BoolArray, FloatArray
from flexdrive_gym.units import measured_in

# more blocks than this say no more about the spread, and long blocks keep slow colour inside
_MOST_BLOCKS = 10
_ENOUGH_VALID = 0.75


@dataclass(frozen=True)
class SineFit:
    """A fitted sine A·sin(ωt + φ) + offset.

    Attributes
    ----------
    amplitude
        A, in the unit of y.
    phase_deg
        φ [deg] in (-180, 180], for the time axis given.
    offset
        Mean level at the middle of the fit.
    amplitude_ci, phase_ci
        95 % intervals; the phase's is ±180 deg where the amplitude is not above its own error, and both are infinite
        or ±180 deg where one period alone tells nothing of the spread.
    residual_rms
        Of y minus the fit.
    n, periods
        Samples and whole periods used.
    """

    amplitude: float
    phase_deg: float = field(metadata=measured_in(""))
    offset: float
    amplitude_ci: tuple[float, float]
    phase_ci: tuple[float, float] = field(metadata=measured_in(""))
    residual_rms: float
    n: int
    periods: int

    @property
    def phasor(self) -> complex:
        """A·exp(jφ)."""
        return self.amplitude * complex(np.exp(1j * np.deg2rad(self.phase_deg)))

    @property
    def significant(self) -> bool:
        """Whether the amplitude is above its own error."""
        return self.amplitude_ci[0] > 0.0


def transient(frequency: float) -> float:
    """Return how much of a run's begin to leave out [s]: one period, and at least 1 s.

    The real pole's transient is over in 0.5 s, that of the vibration in 1 s; the first period from rest also breaks
    friction's symmetry.
    """
    return max(1.0 / frequency, 1.0)


def fit_sine(
    t: npt.ArrayLike,
    y: npt.ArrayLike,
    frequency: float,
    valid: BoolArray | None = None,
    *,
    skip: float | None = None,
) -> SineFit:
    """Fit a sine of known frequency by linear least squares.

    Parameters
    ----------
    t, y : array_like, shape (n,)
        Time [s] and signal.
    frequency
        Of the excitation [Hz].
    valid : ndarray of bool, shape (n,)
        Samples to use; all by default.
    skip
        Time [s] after ``t[0]`` to leave out; :func:`transient` of the frequency by default.

    Returns
    -------
    SineFit
        Phase relative to sin(2π·frequency·t).

    Raises
    ------
    ValueError
        If frequency or shapes are impossible, or less than one whole valid period is left.
    """
    times, values, ok = _checked(t, y, frequency, valid)
    skip = transient(frequency) if skip is None else skip
    step = float(np.median(np.diff(times)))
    # the last sample of a period is one step before the first of the next
    available = (times[-1] + step - times[0] - skip) * frequency
    periods = floor(available + 1e-6)
    if periods < 1:
        raise ValueError(
            f"t: must hold one whole period after the first {skip:g} s; got {max(available, 0.0):.2g} periods of "
            f"{frequency:g} Hz. Record longer, or give a smaller skip."
        )
    start = times[0] + skip
    position = (times - start) * frequency  # in periods
    inside = (position > -1e-6) & (position < periods - 1e-6) & ok
    if inside.sum() < _ENOUGH_VALID * periods / (frequency * step):
        raise ValueError(
            f"valid: must leave three quarters of the samples after the transient; got {int(inside.sum())} of "
            f"{round(periods / (frequency * step))}. The sensor was faulty most of the time: leave the run out."
        )
    x, v = times[inside], values[inside]
    middle = 0.5 * (x[0] + x[-1])
    design = np.column_stack([_fundamental(x, frequency), np.ones_like(x), x - middle])
    (a, b, c, e), *_rest = np.linalg.lstsq(design, v, rcond=None)
    residual = v - design @ np.array([a, b, c, e])
    phasor = complex(a, b)
    margin = _margin(x, residual, frequency, position[inside], periods)
    amplitude, phase = abs(phasor), degrees(float(np.angle(phasor)))
    angle = degrees(float(np.arcsin(margin / amplitude))) if margin < amplitude else 180.0
    return SineFit(
        amplitude=amplitude,
        phase_deg=phase,
        offset=float(c),
        amplitude_ci=(max(0.0, amplitude - margin), amplitude + margin),
        phase_ci=(phase - angle, phase + angle),
        residual_rms=float(np.sqrt(np.mean(residual**2))),
        n=len(x),
        periods=periods,
    )


def _checked(
    t: npt.ArrayLike, y: npt.ArrayLike, frequency: float, valid: BoolArray | None
) -> tuple[FloatArray, FloatArray, BoolArray]:
    times, values = np.asarray(t, dtype=np.float64), np.asarray(y, dtype=np.float64)
    ok = np.ones(len(times), dtype=np.bool_) if valid is None else np.asarray(valid, dtype=np.bool_)
    if not 0.0 < frequency < inf:
        raise ValueError(f"frequency: must be positive [Hz]; got {frequency:g}. Pass the excitation's frequency.")
    if times.ndim != 1 or len(times) < 4 or values.shape != times.shape or ok.shape != times.shape:
        raise ValueError(
            f"t, y, valid: must be vectors of one length, at least 4; got shapes {times.shape}, {values.shape}, "
            f"{ok.shape}. Pass one value per sample."
        )
    return times, values, ok


def _fundamental(t: FloatArray, frequency: float) -> FloatArray:
    angle = 2.0 * pi * frequency * t
    return np.column_stack([np.sin(angle), np.cos(angle)])


def _margin(x: FloatArray, residual: FloatArray, frequency: float, position: FloatArray, periods: int) -> float:
    """Return the half-width of the phasor's 95 % interval from the spread of the residual's phasor over blocks."""
    blocks = min(periods, _MOST_BLOCKS)
    if blocks < 2:
        return inf
    length = periods / blocks
    # whole periods per block, as equal as they come
    edges = [ceil(i * length - 1e-9) for i in range(blocks + 1)]
    deviations, weights = [], []
    for low, high in pairwise(edges):
        part = (position >= low - 1e-6) & (position < high - 1e-6)
        if part.sum() < 0.5 * len(x) * (high - low) / periods:
            continue  # mostly faulty
        design = np.column_stack([_fundamental(x[part], frequency), np.ones(int(part.sum()))])
        deviations.append(np.linalg.lstsq(design, residual[part], rcond=None)[0][:2])
        weights.append(high - low)
    if len(deviations) < 2:
        return inf
    spread, share = np.array(deviations), np.array(weights, dtype=np.float64)
    share /= share.sum()
    centred = spread - share @ spread
    freedom = 2 * (len(share) - 1)
    # a block of twice the periods has half the variance, so equal blocks' variance over their number
    variance = float(np.sum(share[:, np.newaxis] * centred**2)) / freedom
    return float(stats.t.ppf(0.975, freedom) * np.sqrt(variance))
