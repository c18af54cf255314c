"""Counts lost or gained for a moment: dips and spikes of an encoder's speed that no force can have made."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import median_filter

from identification.recordings.freezes import covered
from identification.recordings.motion import LEAST_BLUR, plausible_change

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flexdrive_gym.recording import BoolArray, FloatArray
    from identification.recordings.freezes import Standstill

LOST = 6.0  # counts, plausible changes and robust standard deviations that a dip must reach
LONGEST_DIP = 10  # samples; longer ones are freezes
LONGEST_SPIKE = 3  # samples: counts are lost for a while, but gained only in a burst
SIDE = 5  # samples whose median is the speed beside a dip
MEDIAN = 21  # samples: a dip fills less than half of it
LOCAL = 51  # samples over which ripple is judged
CLUSTER = 5  # samples within which dips belong together


@dataclass(frozen=True)
class Dip:
    """Samples ``first`` to ``last`` that miss ``lost`` mm/s in total (negative: in excess)."""

    first: int
    last: int
    lost: float


def find_dips(speed: FloatArray, count: float, stills: Sequence[Standstill]) -> list[Dip]:
    """Return the moments at which counts were lost or gained.

    The reading leaves its local median by more than its counts, its ripple and the cart's acceleration
    explain, and the speeds on both sides agree, so no force acted in between.

    Parameters
    ----------
    speed, count
        Counted speed, ndarray, shape (n,), and one count per sample [mm/s].
    stills
        Standstills, whose edges are judged elsewhere.

    Returns
    -------
    list of Dip
    """
    if speed.size < LOCAL:
        return []
    centre = median_filter(speed, size=MEDIAN, mode="nearest")
    off = speed - centre
    ripple = 1.4826 * median_filter(np.abs(off), size=LOCAL, mode="nearest")
    change = plausible_change(speed, covered(((s.first, s.last + 1) for s in stills), speed.size))
    least = LOST * np.maximum(max(count, LEAST_BLUR / LOST, change), ripple)
    candidate = np.abs(off) >= least * (1.0 - 1e-6)
    for still in stills:
        candidate[max(still.first - 2, 0) : still.last + 3] = False
    dips = []
    for first, last in _groups(candidate):
        start, stop = _widen(off, first, last, 1.5 * max(count, LEAST_BLUR / LOST))
        lost = _lost(speed, start, stop, float(np.max(np.abs(off[first : last + 1]))))
        if lost is not None:
            dips.append(Dip(start, stop, lost))
    return dips


def _groups(flags: BoolArray) -> list[tuple[int, int]]:
    """Return the first and last sample of flagged samples that are no more than a cluster's reach apart."""
    where = np.flatnonzero(flags)
    if where.size == 0:
        return []
    parts = np.split(where, np.flatnonzero(np.diff(where) > CLUSTER) + 1)
    return [(int(part[0]), int(part[-1])) for part in parts]


def _widen(off: FloatArray, first: int, last: int, least: float) -> tuple[int, int]:
    """Take in the neighbours that the fault cuts for part of their time."""
    if first > 0 and off[first - 1] * off[first] > 0.0 and abs(off[first - 1]) > least:
        first -= 1
    if last + 1 < off.size and off[last + 1] * off[last] > 0.0 and abs(off[last + 1]) > least:
        last += 1
    return first, last


def _lost(speed: FloatArray, start: int, stop: int, depth: float) -> float | None:
    """Return the sum of the missing speeds [mm/s], negative in excess, or ``None`` for no fault."""
    before, after = speed[max(start - SIDE, 0) : start], speed[stop + 1 : stop + 1 + SIDE]
    if before.size < 3 or after.size < 3:
        return None
    left, right = float(np.median(before)), float(np.median(after))
    if abs(left - right) > 0.5 * depth:
        return None
    level = 0.5 * (left + right)
    inside = speed[start : stop + 1]
    one_way = abs(float(np.sum(inside))) > 0.5 * float(np.sum(np.abs(inside)))
    if max(abs(left), abs(right)) < 0.25 * depth and one_way:
        return None  # a cart at rest that creeps on for some counts, rather than a burst that cancels out
    towards_zero = bool(np.all(np.abs(inside) < max(abs(left), abs(right)) + 0.25 * depth))
    if stop - start + 1 > (LONGEST_DIP if towards_zero else LONGEST_SPIKE) + 1:
        return None
    missing = float(np.sum(level - inside))
    return missing * (float(np.sign(level)) or -1.0)
