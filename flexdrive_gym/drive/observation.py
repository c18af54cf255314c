"""What the controller sees, written for up to LANES drives at a time.

The observation has one row per drive. The usual one is written at once; others are first made row by row, then turned round.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from flexdrive_gym.drive.compilation import inlined, shifted
from flexdrive_gym.drive.layout import COMMAND, READ_1, READ_2, ROW, SPEED_1, SPEED_2

_NOW_1, _NOW_2, _SPEED_1, _SPEED_2 = (row - READ_1 for row in (READ_1, READ_2, SPEED_1, SPEED_2))


@inlined
def _entry(value: float, scale: float, bound: float) -> Any:
    # bounds are single precision: rounding before the clip gives the same and takes half of the clip's time
    limit, entry = np.float32(bound), np.float32(value * scale)
    # in this order nan, of a drive that has run away, becomes the bound
    return max(-limit, min(limit, entry))


@inlined
def _fill(n: int, k: int, values: Any, start: int, scale: Any, bound: Any, rows: Any) -> int:
    """Make one row of the observation; return the next one's number."""
    factor, limit = scale[k], bound[k]
    for i in range(n):
        rows[k * ROW + i] = _entry(values[start + i], factor, limit)
    return k + 1


@inlined
def observe(
    n: int,
    sensing: int,
    previews: int,
    scale: Any,
    bound: Any,
    seen: Any,
    state: Any,
    now: Any,
    shown: Any,
    rows: Any,
    out: Any,
) -> None:
    """Write observations: position and velocity of the chosen encoder(s), error, reference, command, preview.

    ``seen`` points to the rows of the readings, ``now`` to that of the reference; ``shown`` are reference and preview, drive by
    drive, as the observation shows them, and ``rows`` is work space.
    """
    if sensing != 3 and previews == 3:
        _observe_usual(n, scale, bound, shifted(seen, 0 if sensing == 1 else ROW), state, now, shown, out)
        return
    k = 0
    if sensing != 2:
        k = _fill(n, k, seen, _NOW_1, scale, bound, rows)
        k = _fill(n, k, seen, _SPEED_1, scale, bound, rows)
    if sensing != 1:
        k = _fill(n, k, seen, _NOW_2, scale, bound, rows)
        k = _fill(n, k, seen, _SPEED_2, scale, bound, rows)
    start = _NOW_1 if sensing == 1 else _NOW_2
    factor, limit = scale[k], bound[k]
    for i in range(n):
        rows[k * ROW + i] = _entry(now[i] - seen[start + i], factor, limit)
    _fill(n, k + 2, state, COMMAND, scale, bound, rows)
    for i in range(n):
        rows[(k + 1) * ROW + i] = shown[i * (previews + 1)]
        for a in range(previews):
            rows[(k + 3 + a) * ROW + i] = shown[i * (previews + 1) + 1 + a]
    entries = k + 3 + previews
    for k in range(entries):
        for i in range(n):
            out[i * entries + k] = rows[k * ROW + i]


@inlined
def _observe_usual(n: int, scale: Any, bound: Any, seen: Any, state: Any, now: Any, shown: Any, out: Any) -> None:
    """Write the usual observation, of one encoder and three instants ahead, at once: eight entries fill whole vectors."""
    s0, s1, s2, s4 = scale[0], scale[1], scale[2], scale[4]
    b0, b1, b2, b4 = bound[0], bound[1], bound[2], bound[4]
    for i in range(n):
        x = seen[i]
        out[8 * i] = _entry(x, s0, b0)
        out[8 * i + 1] = _entry(seen[_SPEED_1 + i], s1, b1)
        out[8 * i + 2] = _entry(now[i] - x, s2, b2)
        out[8 * i + 3] = shown[4 * i]
        out[8 * i + 4] = _entry(state[COMMAND + i], s4, b4)
        out[8 * i + 5] = shown[4 * i + 1]
        out[8 * i + 6] = shown[4 * i + 2]
        out[8 * i + 7] = shown[4 * i + 3]
