"""Standstills of an encoder's reading, and which of them no cart could have made.

A frozen encoder and a stuck cart both read zero speed. What separates them is how they get there. Forces
are bounded, so a cart's speed falls to zero over as many milliseconds as its deceleration needs, whatever
friction does; a frozen encoder drops from full speed to zero between two samples. The bound is taken from
the run itself: the 98th percentile of the change of speed while the cart moves, times two, is what the cart
can plausibly do, and three counts are what quantisation adds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from identification.recordings.motion import FASTEST, LEAST_BLUR, plausible_change

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from flexdrive_gym.recording import BoolArray, FloatArray, Recording

SHORTEST = 10  # samples of zero speed; shorter ones are found as lost counts
EDGE = 3  # samples whose median is the speed beside a standstill
MARGIN = 2.0  # by which a cart may exceed its plausible change of speed
BLUR = 3.0  # counts per sample that quantisation and gear ripple add
RARE = 2  # standstills that may be doubtful before they are the rule


@dataclass(frozen=True)
class Standstill:
    """A run of zero speed from sample ``first`` to ``last``, the speeds beside it and the sample after it [mm/s].

    ``allowed`` is the speed [mm/s] that a cart can plausibly lose or gain within :data:`EDGE` samples.
    """

    first: int
    last: int
    before: float
    after: float
    next: float
    allowed: float

    @property
    def stops_abruptly(self) -> bool:
        """Whether no cart could have come to rest like this, or have rested if it went on like this."""
        return abs(self.before) > self.allowed or abs(self.next) > FASTEST

    @property
    def resumes_at_speed(self) -> bool:
        """Whether few carts could have started like this."""
        return abs(self.after) > self.allowed

    @property
    def starts_abruptly(self) -> bool:
        """Whether hardly any cart could have started like this; breaking away is a jerk too."""
        return abs(self.after) > 2.0 * self.allowed

    @property
    def catches_up(self) -> bool:
        """Whether the counts of the standstill come all at once after it, so that a position is right again."""
        return abs(self.next) > max(abs(self.before), abs(self.after)) + 2.0 * self.allowed


def find_standstills(speed: FloatArray, count: float) -> list[Standstill]:
    """Return the long runs of zero speed.

    Parameters
    ----------
    speed, count
        Counted speed, ndarray, shape (n,), and one count per sample [mm/s].

    Returns
    -------
    list of Standstill
    """
    # the file's decimals may move a resting position by its last digit, never by a count
    zero = np.abs(speed) <= 0.25 * count
    edges = np.diff(np.r_[0, zero.astype(np.int8), 0])
    starts, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    runs = [(int(a), int(b)) for a, b in zip(starts, ends, strict=True) if b - a >= SHORTEST]
    change = plausible_change(speed, covered(runs, speed.size))
    allowed = max(BLUR * count, LEAST_BLUR) + MARGIN * EDGE * change
    stills = []
    for first, end in runs:
        # the samples next to it count for a part of their time only, so the ones beyond them are taken
        before, after = speed[max(first - 1 - EDGE, 0) : max(first - 1, 0)], speed[end + 1 : end + 1 + EDGE]
        stills.append(
            Standstill(
                first=first,
                last=end - 1,
                before=float(np.median(before)) if before.size else 0.0,
                after=float(np.median(after)) if after.size else 0.0,
                next=float(speed[end]) if end < speed.size else 0.0,
                allowed=allowed,
            )
        )
    return stills


def covered(runs: Iterable[tuple[int, int]], size: int) -> BoolArray:
    """Return which of ``size`` samples lie in one of the runs (first, end)."""
    inside = np.zeros(size, dtype=np.bool_)
    for first, end in runs:
        inside[first:end] = True
    return inside


def lasting(
    recording: Recording, channel: tuple[FloatArray, float] | None, stills: Sequence[Standstill]
) -> list[Standstill]:
    """Return standstills that outlast whole swings of a periodic drive that otherwise always moves the cart.

    A slow cart may be at rest where its encoder freezes, and moving slowly where it recovers; then the swings
    that are missing in between tell.

    Parameters
    ----------
    recording
        The run.
    channel
        Its counted speed, ndarray, shape (n,), and one count per sample [mm/s], or ``None``.
    stills
        Its standstills.

    Returns
    -------
    list of Standstill
    """
    drive = recording.excitation
    if channel is None or drive.kind not in ("sine", "square") or drive.frequency <= 0.0:
        return []
    speed, count = channel
    if np.median(np.abs(speed)) < max(BLUR * count, LEAST_BLUR):
        return []  # hardly moving: friction may hold it for as long as it likes
    half = 0.5 / (drive.frequency * recording.sample_time)
    length = {still: still.last - still.first + 1 for still in stills}
    long = [
        still
        for still in stills
        if length[still] >= 1.5 * half and np.ptp(recording.u[still.first : still.last + 1]) > 1.8 * drive.amplitude
    ]
    usual = max((length[still] for still in stills if still not in long), default=0)
    return long if len(long) <= RARE and usual <= 0.5 * half else []
