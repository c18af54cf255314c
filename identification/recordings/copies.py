"""The same run in two files: a copy, or the same log as text and as a MATLAB workspace."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flexdrive_gym.recording import FloatArray
    from identification.recordings.parsed import Parsed

CLOSE = 2e-5  # of a channel's span, by which the same numbers differ where one file rounds them
FEWEST_LEVELS = 8  # that a channel must visit: a cart at rest repeats itself in every run
_MEASURED = ("x1", "x2", "v1", "v2")


def find_copies(parsed: Sequence[Parsed]) -> list[tuple[Parsed, Parsed]]:
    """Return each file that repeats another one's run, with that other one.

    Two files hold the same run where all measured channels that both have agree, and one of them visits several levels: noise
    never repeats itself. The file whose command varies, then the one with more channels, then the first one is the original.
    """
    ordered = sorted(range(len(parsed)), key=lambda k: (-_varies(parsed[k]), -len(parsed[k].raw), k))
    originals: list[int] = []
    found = []
    for k in ordered:
        first = next((other for other in originals if _same_run(parsed[k], parsed[other])), None)
        if first is None:
            originals.append(k)
        else:
            found.append((parsed[k], parsed[first]))
    return found


def _varies(parsed: Parsed) -> bool:
    return bool(np.ptp(parsed.uniform.signals["u"]) > 0.0)


def _same_run(one: Parsed, other: Parsed) -> bool:
    if one.uniform.t.size != other.uniform.t.size or abs(one.Ts - other.Ts) > 0.01 * one.Ts:
        return False
    shared = [name for name in _MEASURED if name in one.raw and name in other.raw]
    pairs = [(one.uniform.signals[name], other.uniform.signals[name]) for name in shared]
    return bool(pairs) and all(_close(*pair) for pair in pairs) and any(_lively(values) for values, _ in pairs)


def _close(first: FloatArray, second: FloatArray) -> bool:
    middle = first.size // 2
    span = float(np.ptp(first))
    if abs(first[middle] - second[middle]) > CLOSE * span:
        return False
    return bool(np.max(np.abs(first - second)) <= CLOSE * span)


def _lively(values: FloatArray) -> bool:
    return np.unique(values).size >= FEWEST_LEVELS
