"""Counters that begin again: angles within one turn, and encoder counts of so many bits."""

from __future__ import annotations

from math import pi
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import numpy.typing as npt

    from flexdrive_gym.recording import FloatArray

# after which counters begin again, in file units: a turn in radians and degrees, and the range of an integer
PERIODS = (2.0 * pi, 360.0, *(2.0**bits for bits in range(8, 33)))
_WHOLE = 0.8  # of its period that a counter spans where it wraps
_NEAR = 5  # samples on either side of a leap that tell how fast the counter runs there
_FASTER = 2.0  # by how much it may run faster across a leap


def unwrapped(values: FloatArray) -> tuple[FloatArray, float] | None:
    """Return a counter that goes on where it began again, and its period; ``None`` where it does not wrap.

    Whatever leaps by about a period, and goes on without it as fast as on either side, has begun again. What leaps elsewhere has
    a fault.

    Parameters
    ----------
    values
        As they stand in the file, ndarray, shape (n,); may hold NaN.
    """
    good = np.isfinite(values)
    raw = values[good]
    span = float(np.ptp(raw)) if raw.size > 2 * _NEAR else 0.0
    for period in PERIODS:
        if not _WHOLE * period < span < (1.0 + 1e-6) * period:
            continue
        step = np.diff(raw)
        turns = np.round(step / period)
        leaps = np.flatnonzero(turns)
        if leaps.size and _goes_on(step - period * turns, leaps):
            found = values.copy()
            found[good] = raw - period * np.concatenate([[0.0], np.cumsum(turns)])
            return found, period
    return None


def _goes_on(step: FloatArray, leaps: npt.NDArray[np.intp]) -> bool:
    """Whether a counter runs across its leaps as it does beside them."""
    beside = np.ones(step.size, dtype=bool)
    beside[leaps] = False
    least = float(np.min(np.abs(step[beside & (step != 0.0)]), initial=np.inf))
    for i in leaps:
        around = slice(max(i - _NEAR, 0), i + _NEAR + 1)
        fastest = float(np.max(np.abs(step[around][beside[around]]), initial=0.0))
        if abs(step[i]) > _FASTER * fastest + 2.0 * least:
            return False
    return True
