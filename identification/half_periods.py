r"""Half-periods of square-wave runs and what is read from them: steady velocity, 63 % time, extrema of v2.

A square wave reverses the drive every half-period. Multiplied by the sign of the command, every half-period shows the
same response from :math:`-v_{ss}` to :math:`+v_{ss}`, so half-periods of both directions and of all replicates
average. The first half-period starts from rest and is never used.

A velocity made by the raw difference of encoder readings, ``v[n] = (x[n] - x[n-1]) / Ts``, belongs to the instant
``t[n] - Ts/2``; the time axes here count from the reversal of the command to that instant.

Readings of the carts together use the velocity of their common centre of mass, ``(v1 + α·v2)/(1 + α)``: its steady
value is Eq. (5)'s like that of either cart, and the vibration, in which the carts move against each other, cancels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.signal import savgol_filter

from flexdrive_gym.recording import BoolArray, FloatArray, Recording
from flexdrive_gym.units import LAB, Units
from identification.signals import velocities

# The last 40 % of a half-period: at 0.5 Hz this begins at 0.6 s, six to ten time constants after the reversal.
STEADY_PART = 0.6
# A single dropped sample is bridged; a half-period with more than this share of faulty samples is left out.
_MAX_FAULTY = 0.05
# Window [s] within which moving is told from standing, long against the count rate of a slowly moving encoder.
_MOTION_WINDOW = 0.05
# Savitzky-Golay windows [s]: short for the steep rise of v1, a fifth of the vibration's period for the extrema of v2.
_RISE_WINDOW, _VIBRATION_WINDOW = 0.011, 0.061
# Extrema below this share of the largest are noise: the track is rough and counts are coarse.
_SMALLEST_EXTREMUM = 0.1
_LONGEST_INTERVAL = 1.6


@dataclass(frozen=True, eq=False)
class HalfPeriod:
    """One half-period after a reversal, sign-flipped so that the command is positive.

    Attributes
    ----------
    recording
        Name of the run.
    direction
        Sign of the command in the run, +1 or -1.
    t
        Time since the reversal [s], ndarray, shape (n,).
    v1, v2
        Velocities [mm/s], ndarray, shape (n,), faulty samples bridged.
    steady
        Whether the carts keep moving throughout the last part.
    """

    recording: str
    direction: int
    t: FloatArray
    v1: FloatArray
    v2: FloatArray
    steady: bool


@dataclass(frozen=True, eq=False)
class AmplitudeReading:
    """All half-periods at one amplitude: their average and their steady velocity (handout 3.2, Eq. (5)).

    Attributes
    ----------
    amplitude
        Of the command, u0 [V].
    half_periods
        Those averaged; all of them where the amplitude does not move steadily.
    t, v1, v2
        Time since the reversal [s] and averaged velocities [mm/s], ndarray, shape (n,).
    vss, vss_error
        Steady velocity [mm/s] and its standard error over half-periods, or over runs where that is larger (friction
        differs between runs); ``None`` for a single half-period.
    window
        Begin and end of the last part [s].
    n_averaged, n_stopped, n_faulty
        Half-periods used, left out because the carts stop, left out because of sensor faults.
    steady
        Whether the amplitude can be used: more than half of its half-periods, and at least two, keep moving.
    recordings
        Names of the runs.
    """

    amplitude: float
    half_periods: tuple[HalfPeriod, ...]
    t: FloatArray
    v1: FloatArray
    v2: FloatArray
    vss: float
    vss_error: float | None
    window: tuple[float, float]
    n_averaged: int
    n_stopped: int
    n_faulty: int
    steady: bool
    recordings: tuple[str, ...]
    units: Units = LAB


@dataclass(frozen=True, eq=False)
class VibrationReading:
    """Damped natural frequency from successive extrema of v2 about its trend (handout 3.2).

    Attributes
    ----------
    amplitude
        Of the command the reading was taken at [V].
    t, v2, trend
        Time [s], averaged and smoothed v2 and the velocity of the centre of mass [mm/s], ndarray, shape (n,).
    peak_times, peak_values
        Extrema used: instants [s] and deviations from the trend [mm/s], ndarray, shape (peaks,).
    estimates
        π over each interval between successive extrema [rad/s], ndarray, shape (peaks - 1,).
    omega_d, standard_error
        Their mean and its standard error [rad/s]; ``None`` for a single interval.
    """

    amplitude: float
    t: FloatArray
    v2: FloatArray
    trend: FloatArray
    peak_times: FloatArray
    peak_values: FloatArray
    estimates: FloatArray
    omega_d: float
    standard_error: float | None


def standard_error(values: Sequence[float] | FloatArray) -> float | None:
    """Return the standard error of the mean of independent values; ``None`` for fewer than two."""
    return float(np.std(values, ddof=1) / np.sqrt(len(values))) if len(values) > 1 else None


def centre_velocity(v1: FloatArray, v2: FloatArray, alpha: float) -> FloatArray:
    """Return the velocity of the carts' centre of mass [mm/s], ndarray, shape (n,), for α = m2/m1."""
    return np.asarray((v1 + alpha * v2) / (1.0 + alpha))


def _segments(u: FloatArray, amplitude: float) -> list[tuple[int, int, int]]:
    """Return (first sample, end, sign) of the whole half-periods, all but the first of them."""
    sign = np.where(np.abs(u) > 0.5 * amplitude, np.sign(u), 0.0)
    edges = np.concatenate([[0], np.flatnonzero(np.diff(sign)) + 1, [len(u)]])
    found = [(int(a), int(b), int(sign[a])) for a, b in pairwise(edges) if sign[a]]
    # the run's very last sample may already belong to the next half-period, so the longest stretch sets the length
    longest = max((b - a for a, b, _ in found), default=0)
    whole = [piece for piece in found if piece[1] - piece[0] > 0.9 * longest]
    return whole[1:]


def _bridged(values: FloatArray, valid: BoolArray) -> FloatArray:
    if valid.all():
        return values
    index = np.arange(len(values))
    return np.asarray(np.interp(index, index[valid], values[valid]))


def _keeps_moving(v: FloatArray, sample_time: float) -> bool:
    """Return whether a centre-of-mass velocity [mm/s] stays clear of zero in the last part."""
    width = max(1, round(_MOTION_WINDOW / sample_time))
    smooth = np.convolve(v, np.ones(width) / width, "valid")
    last = smooth[int(STEADY_PART * len(v)) :]
    if not len(last):
        return False
    # below a fifth of its own mean it all but stops; a mean below a fifth of the peak is creep after a jerk
    return bool(last.min() > 0.2 * last.mean() and last.mean() > 0.2 * np.abs(smooth).max())


def cut_half_periods(recording: Recording, alpha: float) -> tuple[list[HalfPeriod], int]:
    """Cut a square-wave run into sign-flipped half-periods, the first one excluded.

    Returns
    -------
    half_periods : list of HalfPeriod
        Whole half-periods that no long fault touches.
    n_faulty : int
        Half-periods left out because of sensor faults.

    Raises
    ------
    ValueError
        If the run has no second cart.
    """
    signals = velocities(recording)
    if len(signals) < 2:
        raise ValueError(
            f"{recording.name}: handout 3.2 needs the velocities (or positions) of both carts; got cart 1 alone. "
            "Record encoder 2 as well."
        )
    Ts = recording.sample_time
    valid = recording.valid("v1") & recording.valid("v2")
    # a filtered derivative has a lag of its own, which is not half a sample
    shift = 0.0 if recording.velocity_cutoff else 0.5 * Ts
    found: list[HalfPeriod] = []
    n_faulty = 0
    for first, end, sign in _segments(recording.u, recording.excitation.amplitude):
        ok = valid[first:end]
        if np.mean(~ok) > _MAX_FAULTY:
            n_faulty += 1
            continue
        v1, v2 = (float(sign) * _bridged(v[first:end], ok) for v in signals[:2])
        t = np.asarray(Ts * np.arange(end - first) - shift, dtype=np.float64)
        steady = _keeps_moving(centre_velocity(v1, v2, alpha), Ts)
        found.append(HalfPeriod(recording.name, sign, t, v1, v2, steady))
    return found, n_faulty


def read_amplitudes(recordings: Sequence[Recording], alpha: float) -> tuple[AmplitudeReading, ...]:
    """Average the half-periods of square-wave runs, amplitude by amplitude.

    Parameters
    ----------
    recordings
        Runs; those whose excitation is not a square wave are ignored.
    alpha
        Mass ratio m2/m1.

    Returns
    -------
    tuple of AmplitudeReading
        Sorted by amplitude, those that do not move steadily included.
    """
    groups: dict[float, list[Recording]] = {}
    for recording in recordings:
        if recording.excitation.kind == "square":
            groups.setdefault(round(recording.excitation.amplitude, 2), []).append(recording)
    readings = (_read_amplitude(amplitude, groups[amplitude], alpha) for amplitude in sorted(groups))
    return tuple(reading for reading in readings if reading is not None)


def _read_amplitude(amplitude: float, runs: list[Recording], alpha: float) -> AmplitudeReading | None:
    halves: list[HalfPeriod] = []
    n_faulty = 0
    for run in runs:
        found, faulty = cut_half_periods(run, alpha)
        halves += found
        n_faulty += faulty
    if not halves:
        return None
    moving = [half for half in halves if half.steady]
    steady = len(moving) >= max(2, len(halves) // 2 + 1)
    used = moving if steady else halves
    n = min(len(half.t) for half in used)
    t = used[0].t[:n]
    v1, v2 = (np.mean([getattr(half, name)[:n] for half in used], axis=0) for name in ("v1", "v2"))
    vss, error = _steady_velocity(used, alpha)
    return AmplitudeReading(
        amplitude=amplitude,
        half_periods=tuple(used),
        t=t,
        v1=v1,
        v2=v2,
        vss=vss,
        vss_error=error,
        window=(float(t[int(STEADY_PART * n)]), float(t[-1])),
        n_averaged=len(used),
        n_stopped=len(halves) - len(moving),
        n_faulty=n_faulty,
        steady=steady,
        recordings=tuple(run.name for run in runs),
        units=runs[0].units,
    )


def _steady_velocity(halves: list[HalfPeriod], alpha: float) -> tuple[float, float | None]:
    """Return the mean over half-periods of the last part's velocity [mm/s] and its standard error."""
    each: dict[str, list[float]] = {}
    for half in halves:
        last = centre_velocity(half.v1, half.v2, alpha)[int(STEADY_PART * len(half.t)) :]
        each.setdefault(half.recording, []).append(float(last.mean()))
    values = [value for of_run in each.values() for value in of_run]
    errors = [standard_error(values), standard_error([float(np.mean(of_run)) for of_run in each.values()])]
    known = [error for error in errors if error is not None]
    return float(np.mean(values)), max(known) if known else None


def _smoothed(v: FloatArray, sample_time: float, window: float, order: int) -> FloatArray:
    width = round(window / sample_time) | 1
    if width <= order or width > len(v):
        return v
    return np.asarray(savgol_filter(v, width, order))


def rise_time(t: FloatArray, v: FloatArray, level: float) -> float:
    """Return when a velocity first exceeds a level [s], on a lightly smoothed trace; nan where it never does.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Time since the reversal [s].
    v : ndarray, shape (n,)
        Velocity [mm/s].
    level
        Level to reach [mm/s].
    """
    smooth = _smoothed(v, float(t[1] - t[0]), _RISE_WINDOW, 1)
    above = np.flatnonzero(smooth > level)
    if not len(above):
        return float("nan")
    i = max(1, int(above[0]))
    return float(t[i - 1] + (level - smooth[i - 1]) / (smooth[i] - smooth[i - 1]) * (t[i] - t[i - 1]))


def read_vibration(reading: AmplitudeReading, alpha: float) -> VibrationReading:
    r"""Read ωd from successive extrema of the averaged v2 about its trend.

    The trend is the velocity of the centre of mass, the motion that the drive would have without vibration, so that
    the rest is :math:`(v_2 - v_1)/(1 + \alpha)`, a decaying cosine once both carts slide in the new direction.
    Successive extrema of :math:`e^{-\sigma t}\cos(\omega_d t + \varphi)` are exactly :math:`\pi/\omega_d` apart.
    Extrema count from where v2, reversed, first overtakes the trend, until they sink below a tenth of the largest.

    Raises
    ------
    ValueError
        If fewer than two extrema stand out.
    """
    Ts = float(reading.t[1] - reading.t[0])
    centre = centre_velocity(reading.v1, reading.v2, alpha)
    v2, trend = (_smoothed(v, Ts, _VIBRATION_WINDOW, 3) for v in (reading.v2, centre))
    deviation = v2 - trend
    overtakes = np.flatnonzero((v2 > 0.0) & (deviation > 0.0))
    places = _successive_extrema(deviation, int(overtakes[0])) if len(overtakes) else []
    if len(places) < 2:
        raise ValueError(
            f"recordings: v2 at ±{reading.units.text(reading.amplitude, 'V')} must show at least two extrema about its trend to "
            f"read the damped natural frequency; got {len(places)}. "
            "Record both carts of a flexible drive, or longer half-periods."
        )
    peaks = np.array([_vertex(reading.t, deviation, i, round(0.02 / Ts)) for i in places])
    estimates = np.pi / np.diff(peaks[:, 0])
    return VibrationReading(
        amplitude=reading.amplitude,
        t=reading.t,
        v2=v2,
        trend=trend,
        peak_times=peaks[:, 0],
        peak_values=peaks[:, 1],
        estimates=estimates,
        omega_d=float(estimates.mean()),
        standard_error=standard_error(estimates),
    )


def _successive_extrema(x: FloatArray, first: int) -> list[int]:
    """Return places of alternating extrema from index ``first`` on, down to the smallest that counts.

    A lobe begins where x passes a tenth of its largest value beyond zero, which ripple at a zero does not.
    """
    after = x[first:]
    threshold = _SMALLEST_EXTREMUM * float(np.abs(after).max())
    outside = np.flatnonzero(np.abs(after) >= threshold)
    turns = np.flatnonzero(np.diff(np.sign(after[outside]))) + 1
    found: list[int] = []
    for lobe in np.split(outside, turns):
        place = first + int(lobe[np.argmax(np.abs(after[lobe]))])
        # a lobe too small to count was skipped: what follows is no longer the next extremum
        if len(found) > 1 and place - found[-1] > _LONGEST_INTERVAL * (found[1] - found[0]):
            break
        if place in (first, len(x) - 1):
            continue  # the edge of the half-period, not a vertex
        found.append(place)
    return found


def _vertex(t: FloatArray, x: FloatArray, i: int, reach: int) -> tuple[float, float]:
    """Return time and value of the vertex of the parabola through the samples around an extremum."""
    part = slice(max(0, i - reach), min(len(x), i + reach + 1))
    a, b, c = np.polyfit(t[part] - t[i], x[part], 2)
    offset = -b / (2.0 * a) if a else 0.0
    if abs(offset) > t[part][-1] - t[part][0]:
        return float(t[i]), float(x[i])
    return float(t[i] + offset), float(c - b * b / (4.0 * a))
