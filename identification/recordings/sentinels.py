"""Values that stand for none: -999, 9999, the least or the largest number of so many bits, where a logger had no reading.

A cart does not go several times as far as it goes otherwise, and come back, from one sample to the next, and be at the very same
place each time.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from identification.recordings.checks import FEWEST_LEVELS

if TYPE_CHECKING:
    from flexdrive_gym.recording import FloatArray

# times that it occurs at least, and distance from all else over its range
_TIMES, _APART = 2, 5.0


def sentinel(values: FloatArray) -> float | None:
    """Return the number that stands for missing values of a position or velocity, or ``None``.

    Parameters
    ----------
    values
        ndarray, shape (n,); may hold NaN.
    """
    found, times = np.unique(values[np.isfinite(values)], return_counts=True)
    if found.size <= FEWEST_LEVELS:
        return None
    for odd, beside, last in ((0, 1, -1), (-1, -2, 0)):
        apart, span = abs(float(found[odd] - found[beside])), abs(float(found[beside] - found[last]))
        if times[odd] >= _TIMES and apart > _APART * span:
            return float(found[odd])
    return None
