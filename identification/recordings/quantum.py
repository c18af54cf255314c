"""The encoder's count, and how velocity was made from it.

An encoder reads whole counts q, so positions lie on a grid of q and raw differences on a grid of q/Ts.
Files round both to some decimals, which blurs the grid by half the last decimal. The grid is found from the
smallest common step between neighbouring levels, refined by least squares over the levels x_i ≈ k_i·q from
the nearest outwards, so that the integers k_i are certain before a level is used, and accepted only where
nearly all levels lie on it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from flexdrive_gym.recording import FloatArray

ON_GRID = 0.97  # share of the levels that must lie on the grid: a few corrupt samples may miss it
MOST_DIGITS = 11  # that floating-point numbers keep free of noise


def encoder_quantum(values: FloatArray) -> float:
    """Return the smallest common step of a measured channel.

    Parameters
    ----------
    values
        Position [mm], or velocity [mm/s] made by raw difference (then multiply the result by Ts), ndarray,
        shape (n,); NaN is ignored.

    Returns
    -------
    float
        The step in the unit of ``values``; 0 where the values lie on no grid, such as simulated ones, or
        only on that of the file's decimals.
    """
    finite = values[np.isfinite(values)]
    if finite.size == 0 or np.ptp(finite) == 0.0:
        return 0.0
    span = float(np.ptp(finite))
    levels = _levels(finite, span)
    if levels.size < 2 or (levels.size < 4 and finite.size < 10 * levels.size):
        return 0.0
    decimal = _decimal(levels)
    for first in _small_steps(levels):
        step, origin = _refine(levels - _dense(levels, first), first, decimal)
        if _fits(levels - _dense(levels, first) - origin, step, decimal):
            break
    else:
        return 0.0
    if _is_decimal(step, decimal) and (span > 2.0 * finite.size * step or step <= 1e-3):
        return 0.0  # rounding leaves most of its levels unvisited; an encoder visits nearly all of its own
    return step


def _fits(levels: FloatArray, step: float, decimal: float) -> bool:
    """Return whether nearly all levels are multiples of the step."""
    # a step of a few decimals that is not the decimal itself cannot be told from the blur
    if step <= 0.0 or (step <= 3.0 * decimal and not _is_decimal(step, decimal)):
        return False
    off = np.abs(levels - step * np.round(levels / step))
    return bool(np.mean(off <= 0.6 * decimal + 1e-3 * step) >= ON_GRID)


def _levels(values: FloatArray, span: float) -> FloatArray:
    """Return the distinct values, merging those that differ by floating-point noise only."""
    ordered = np.unique(values)
    return ordered[np.r_[True, np.diff(ordered) > 1e-9 * span]]


def _decimal(values: FloatArray) -> float:
    """Return the last decimal of the largest value, or 0 where the values are not rounded.

    Files keep a number of decimals or a number of digits; the largest value tells the blur of both.
    """
    used = values[values != 0.0]
    if used.size == 0:
        return 0.0
    exponent = np.floor(np.log10(np.abs(used)) + 1e-12)
    for digits in range(1, MOST_DIGITS + 1):
        scaled = used * 10.0 ** (digits - 1 - exponent)
        if np.max(np.abs(scaled - np.round(scaled))) < 1e-3:
            return float(10.0 ** (np.max(exponent) + 1 - digits))
    return 0.0


def _is_decimal(step: float, decimal: float) -> bool:
    return decimal > 0.0 and abs(step - decimal) < 0.01 * decimal


def _small_steps(levels: FloatArray) -> list[float]:
    """Return guesses of the count, from the smallest steps between neighbouring levels.

    Only the slow parts of a run visit neighbouring counts, so the very smallest steps come first; a corrupt
    sample between two levels makes a few steps that are smaller still, so larger ones follow.
    """
    steps = np.sort(np.diff(levels))
    firsts = {float(steps[int(share * (steps.size - 1))]) for share in (0.0, 0.005, 0.02, 0.05, 0.2)}
    return [float(np.median(steps[(steps >= first) & (steps < 1.5 * first)])) for first in sorted(firsts)]


def _dense(levels: FloatArray, step: float) -> float:
    """Return a level with many others near it, from where the grid can be followed outwards."""
    near = np.searchsorted(levels, levels + 6.5 * step) - np.searchsorted(levels, levels - 6.5 * step)
    return float(levels[np.argmax(near)])


def _refine(levels: FloatArray, step: float, decimal: float) -> tuple[float, float]:
    """Return the least-squares step and origin, using levels as far out as their integers are certain."""
    near = levels[np.argsort(np.abs(levels))]
    distance = np.abs(near)
    origin = 0.0
    error = max(0.51 * decimal, 0.05 * step)  # of the first guess, from one rounded difference
    while True:
        # the integer of the level k·step is certain while k times the error of the step stays below a third
        # of it
        count = int(np.searchsorted(distance, 1.01 * step * max(1.0, step / (3.0 * error))))
        used = near[:count]
        k = np.round((used - origin) / step)
        spread = float(np.sum((k - k.mean()) ** 2)) if count else 0.0
        if spread == 0.0:
            return step, origin
        step = float((k - k.mean()) @ used) / spread
        origin = float(used.mean() - step * k.mean())
        before, error = error, max(0.6 * decimal / float(np.sqrt(spread)), 1e-6 * step)
        if count == near.size or error >= 0.9 * before or step <= 0.0:
            return step, origin


def velocity_cutoff(x: FloatArray, v: FloatArray, Ts: float) -> float | None:
    """Return how a velocity channel was made from the position channel beside it.

    The first-order filtered derivative v = wc·(x − lowpass(x)), stepped by backward differences, is

        v[n] = a·v[n−1] + (1 − a)·d[n],   d[n] = (x[n] − x[n−1])/Ts,   a = exp(−wc·Ts),

    so v − d = a·(v[n−1] − d) is a regression on one number.

    Parameters
    ----------
    x, v
        Position [mm] and velocity [mm/s] of the same cart, ndarray, shape (n,).
    Ts
        Sampling period [s].

    Returns
    -------
    float or None
        0 for the raw difference, the cut-off [Hz] of the filter, or ``None`` where neither explains v.
    """
    d = np.diff(x) / Ts
    rest, before = v[1:] - d, v[:-1] - d
    size = float(np.sqrt(np.mean(v**2)))
    if size == 0.0:
        return None
    # the file's decimals blur d by up to half of its last one per Ts
    blur = (_decimal(x) / Ts + _decimal(v)) / np.sqrt(6.0)
    off = float(np.sqrt(np.mean(rest**2)))
    if off < max(1e-6 * size, 1.5 * blur):
        return 0.0
    a = float(rest @ before / (before @ before))
    left = float(np.sqrt(np.mean((rest - a * before) ** 2)))
    if 1e-3 < a < 1.0 - 1e-6 and left < max(0.3 * off, 1.5 * blur) and left < 0.02 * size:
        return float(-np.log(a) / (2.0 * np.pi * Ts))
    # a simulated velocity is half a sample younger than the difference: close enough to call it raw
    return 0.0 if off < 0.01 * size else None
