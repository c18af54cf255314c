"""What drove a run, from its data alone: square, sine, P-control or something else.

A run under feedback is a regression: the lab's controller computes u[n] = sat(Kp·(xr[n] − x[n])) from the
very counts it logs, so the right position explains u to the last digit, and the wrong one leaves tens of
percent. Logs written one step late pair u[n] with x[n−1]; both are tried.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np
from scipy.optimize import minimize_scalar

from flexdrive_gym.recording import Excitation
from identification.recordings.quantum import encoder_quantum, velocity_cutoff

if TYPE_CHECKING:
    from flexdrive_gym.recording import BoolArray, FloatArray

__all__ = ["encoder_quantum", "recognise_excitation", "velocity_cutoff"]

ON_PLATEAU = 0.95  # share of a square's samples on its two levels
PLATEAU = 0.05  # width of a level, of the amplitude
CENTRED = 0.1  # offset that a square may have, of its amplitude
REGULAR = 0.05  # spread of a square's half-periods, of their median
SINE_RESIDUAL = 0.05  # rms that a sine may leave, of its rms
EXPLAINED = 0.02  # rms that a P-controller may leave, of the rms of u
RESTING = 3  # samples at the limit that count as resting there
FEWEST_PERIODS = 1.4


def recognise_excitation(
    t: FloatArray,
    u: FloatArray,
    x1: FloatArray | None = None,
    x2: FloatArray | None = None,
    xr: FloatArray | None = None,
) -> Excitation:
    """Recognise what drove a run.

    Parameters
    ----------
    t
        Time [s], uniform, ndarray, shape (n,).
    u
        Command [V], ndarray, shape (n,).
    x1, x2
        Cart positions [mm], ndarray, shape (n,), or ``None``.
    xr
        Reference [mm], ndarray, shape (n,), or ``None`` for open-loop runs.

    Returns
    -------
    Excitation
        ``other`` where neither a square nor a sine nor a reference explains the command. A closed loop whose
        controller is not a P-controller on x1 or x2 has neither ``feedback`` nor ``gain``.
    """
    Ts = float(np.median(np.diff(t)))
    opened = _open_loop(u, Ts)
    if xr is None or (np.ptp(xr) == 0.0 and opened.kind != "other"):
        return opened  # a reference that rests while u alternates by itself is an unused channel
    return _closed_loop(u, {"x1": x1, "x2": x2}, xr, Ts)


def _open_loop(u: FloatArray, Ts: float) -> Excitation:
    active = _active(u)
    return _square(active, Ts) or _sine(active, Ts) or Excitation("other")


def _active(u: FloatArray) -> FloatArray:
    """Cut a rest or another constant before and after the excitation, but no plateau of a square."""
    moves = np.flatnonzero(np.diff(u))
    if moves.size < 2:
        return u
    below = 0.7 * float(np.max(np.abs(u)))
    # a sine passes through zero at both ends: one sample there is not a rest
    start = int(moves[0]) + 1 if moves[0] > 0 and abs(u[0]) < below else 0
    end = int(moves[-1]) + 1 if moves[-1] + 2 < u.size and abs(u[-1]) < below else u.size
    return u[start:end]


def _square(u: FloatArray, Ts: float) -> Excitation | None:
    middle = 0.5 * (float(u.max()) + float(u.min()))
    high, low = u > middle, u <= middle
    if high.all() or low.all():
        return None
    upper, lower = float(np.median(u[high])), float(np.median(u[low]))
    amplitude = 0.5 * (upper - lower)
    near = np.minimum(np.abs(u - upper), np.abs(u - lower)) < PLATEAU * amplitude
    if np.mean(near) < ON_PLATEAU or abs(upper + lower) > 2.0 * CENTRED * amplitude:
        return None
    switches = np.flatnonzero(np.diff(high.astype(np.int8))) + 1
    if switches.size < 2:
        return None
    halves = np.diff(switches)
    half = float(np.median(halves))
    if np.max(np.abs(halves - half)) > max(1.0, REGULAR * half):
        return None
    # a run may hold its first and last level for long, but a single pulse between two levels is no square
    if switches.size < 4 and max(switches[0], u.size - switches[-1]) > (1.0 + REGULAR) * half + 1.0:
        return None
    if u.size < 2.0 * FEWEST_PERIODS * half:
        return None
    half = float(np.polyfit(np.arange(switches.size), switches, 1)[0])
    return Excitation("square", amplitude=amplitude, frequency=1.0 / (2.0 * half * Ts))


def _sine(u: FloatArray, Ts: float) -> Excitation | None:
    n = u.size
    centred = u - u.mean()
    size = float(np.sqrt(np.mean(centred**2)))
    if size == 0.0 or n < 8:
        return None
    spectrum = np.abs(np.fft.rfft(centred * np.hanning(n)))
    peak = max(int(np.argmax(spectrum[1:])) + 1, 1)
    # the frequency in cycles per run; the true one is within one bin of the peak
    low, high = max(peak - 1.0, 0.5), min(peak + 1.0, n / 2.0)
    best = minimize_scalar(lambda f: _left(u, float(f))[0], bounds=(low, high), method="bounded")
    left, amplitude = _left(u, float(best.x))
    if left > SINE_RESIDUAL * size or best.x < FEWEST_PERIODS:
        return None
    return Excitation("sine", amplitude=amplitude, frequency=float(best.x) / (n * Ts))


def _left(u: FloatArray, cycles: float) -> tuple[float, float]:
    """Return the rms that a sine of so many cycles per run leaves, and its amplitude."""
    phase = 2.0 * np.pi * cycles / u.size * np.arange(u.size)
    basis = np.stack([np.sin(phase), np.cos(phase), np.ones(u.size)])
    weights = np.linalg.solve(basis @ basis.T + 1e-12 * np.eye(3), basis @ u)
    return float(np.sqrt(np.mean((u - weights @ basis) ** 2))), float(np.hypot(weights[0], weights[1]))


def _closed_loop(u: FloatArray, positions: dict[str, FloatArray | None], xr: FloatArray, Ts: float) -> Excitation:
    limit, resting = find_limit(u)
    feedback, gain = _controller(u, positions, xr, ~resting)
    return Excitation(
        "closed_loop",
        amplitude=float(np.max(np.abs(xr - xr[0]))),
        frequency=_repetition(xr, Ts),
        feedback=feedback,
        gain=gain,
        limit=limit,
    )


def find_limit(u: FloatArray) -> tuple[float | None, BoolArray]:
    """Return where the command rests against a limit.

    Parameters
    ----------
    u
        Command [V], ndarray, shape (n,).

    Returns
    -------
    limit : float or None
        Largest magnitude of u [V], where u rests there at least twice for three samples; a controller
        meets its largest command in passing, an amplifier's limit holds it.
    resting : ndarray of bool, shape (n,)
        Samples of these rests.
    """
    largest = float(np.max(np.abs(u)))
    at_limit = np.abs(u) >= largest * (1.0 - 1e-6)
    edges = np.diff(np.r_[0, at_limit.astype(np.int8), 0])
    first, last = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    long = last - first >= RESTING
    resting = np.zeros(u.size, dtype=np.bool_)
    if np.sum(long) < 2 or largest == 0.0:
        return None, resting
    for a, b in zip(first[long], last[long], strict=True):
        resting[a:b] = True
    return largest, resting


def _controller(
    u: FloatArray, positions: dict[str, FloatArray | None], xr: FloatArray, use: BoolArray
) -> tuple[Literal["x1", "x2"] | None, float | None]:
    """Return the fed-back position and the gain that explain the command, if any do."""
    names: tuple[Literal["x1", "x2"], ...] = ("x1", "x2")
    best: tuple[float, Literal["x1", "x2"] | None, float] = (np.inf, None, 0.0)
    size = float(np.sqrt(np.mean(u[use] ** 2))) if use.any() else 0.0
    for name in names:
        x = positions[name]
        if x is None or size == 0.0:
            continue
        for late in (xr - x, xr - np.r_[x[0], x[:-1]], np.r_[0.0, (xr - x)[:-1]]):
            error = late[use]
            power = float(error @ error)
            if power == 0.0:
                continue
            gain = float(u[use] @ error) / power
            left = float(np.sqrt(np.mean((u[use] - gain * error) ** 2))) / size
            if left < best[0]:
                best = (left, name, gain)
    left, feedback, gain = best
    return (feedback, gain) if left <= EXPLAINED else (None, None)


def _repetition(xr: FloatArray, Ts: float) -> float:
    """Return the frequency at which a reference repeats [Hz], 0 where it does not.

    The mean square of xr[n + P] − xr[n] over the overlap falls to nothing at the period P. It is also small
    at small P, so the search starts once it has been large.
    """
    n = xr.size
    centred = xr - xr.mean()
    variance = float(np.mean(centred**2))
    if variance == 0.0:
        return 0.0
    spectrum = np.fft.rfft(centred, 2 * n)
    product = np.fft.irfft(np.abs(spectrum) ** 2, 2 * n)[:n]
    energy = np.cumsum(centred**2)
    lags = np.arange(1, int(n / FEWEST_PERIODS))
    head, tail = energy[n - 1 - lags], energy[-1] - energy[lags - 1]
    difference = (head + tail - 2.0 * product[lags]) / (n - lags)
    apart = np.flatnonzero(difference > 0.2 * variance)
    if apart.size == 0:
        return 0.0
    again = np.flatnonzero(difference[apart[0] :] < 2e-3 * variance)
    if again.size == 0:
        return 0.0
    start = apart[0] + again[0]
    stop = start + int(np.argmax(difference[start:] >= 2e-3 * variance) or difference.size - start)
    period = int(lags[start + int(np.argmin(difference[start:stop]))])
    return 1.0 / (period * Ts)
