"""Recordings that equal another group's, whole or in part, whatever their files are called.

Counts of an encoder never repeat themselves while a cart moves. So every window of :data:`WINDOW` samples has a hash of its
integers, signs aside, and a few of all windows are kept: those whose hash is a multiple of :data:`KEPT` (winnowing; S. Schleimer,
D. Wilkerson, A. Aiken, SIGMOD 2003). Two recordings that share such hashes share the stretches under them, even if one was cut,
renamed, written in another format or with the other sign.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from flexdrive_gym.recording import FloatArray, Recording

WINDOW, KEPT = 200, 64
# values that a window must visit: a cart at rest is the same in everybody's recording
_LEVELS = 6
# hashes that two recordings must share: one of 64 bits may coincide, a few do not
_FEWEST, _WHOLE = 3, 0.8
# without counts: of a channel's span
_FINE = 1e-4


@dataclass(frozen=True)
class Equal:
    """Two groups' recordings that are the same run.

    Attributes
    ----------
    first, second
        Labels of the groups.
    pairs
        Names of the recordings in either, and the share of the smaller one that both have, 0…1.
    """

    first: str
    second: str
    pairs: tuple[tuple[str, str, float], ...]


def fingerprint(recording: Recording) -> list[int]:
    """Return the kept hashes of a recording's measured channels."""
    found: set[int] = set()
    for cart in (1, 2):
        steps = _steps(recording, cart)
        if steps is not None and len(steps) > WINDOW:
            found |= _hashes(steps)
    return sorted(found)


def _steps(recording: Recording, cart: int) -> np.ndarray | None:
    """Return a channel as whole numbers: counts between samples, or ten-thousandths of its span where it shows no counts."""
    v: FloatArray | None = (recording.v1, recording.v2)[cart - 1]
    x: FloatArray | None = (recording.x1, recording.x2)[cart - 1]
    if v is None and x is not None:
        v = np.diff(x) / recording.sample_time
    if v is None or not np.ptp(v) > 0.0:
        return None
    quantum = recording.quantum[cart - 1] / recording.sample_time or _FINE * float(np.ptp(v))
    return np.round(v / quantum).astype(np.int64)


def _hashes(steps: np.ndarray) -> set[int]:
    windows = sliding_window_view(steps, WINDOW)
    first = np.argmax(windows != 0, axis=1)
    signs = np.sign(np.take_along_axis(windows, first[:, None], axis=1)[:, 0])
    # odd multipliers, and arithmetic modulo 2^64
    factors = np.random.default_rng(0).integers(0, 2**63, WINDOW, dtype=np.uint64) * np.uint64(2) + np.uint64(1)
    sums = (windows.astype(np.uint64) @ factors) * signs.astype(np.uint64)
    mixed = (sums ^ (sums >> np.uint64(29))) * np.uint64(0xBF58476D1CE4E5B9)
    mixed ^= mixed >> np.uint64(32)
    chosen = np.flatnonzero(mixed % np.uint64(KEPT) == 0)
    return {int(mixed[i]) for i in chosen if len(np.unique(windows[i])) >= _LEVELS}


def equal_recordings(prints: Mapping[str, Mapping[str, Sequence[int]]]) -> tuple[Equal, ...]:
    """Return which groups share recordings.

    Parameters
    ----------
    prints
        Group to recording to its fingerprint.
    """
    holders: dict[int, list[tuple[str, str]]] = defaultdict(list)
    for group, recordings in prints.items():
        for name, hashes in recordings.items():
            for value in hashes:
                holders[value].append((group, name))
    shared: dict[tuple[tuple[str, str], tuple[str, str]], int] = defaultdict(int)
    for who in holders.values():
        for i, one in enumerate(who):
            for other in who[i + 1 :]:
                if one[0] != other[0]:
                    shared[one, other] += 1
    pairs: dict[tuple[str, str], list[tuple[str, str, float]]] = defaultdict(list)
    for (one, other), count in shared.items():
        fewer = min(len(prints[one[0]][one[1]]), len(prints[other[0]][other[1]]))
        if count >= min(_FEWEST, fewer):
            pairs[one[0], other[0]].append((one[1], other[1], count / fewer))
    return tuple(Equal(a, b, tuple(sorted(found))) for (a, b), found in pairs.items())


def in_words(share: float) -> str:
    """Return whether a shared stretch is the whole recording."""
    return "whole" if share >= _WHOLE else f"{share:.0%} of it"
