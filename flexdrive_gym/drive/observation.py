"""What the controller sees, written for up to LANES drives at a time.

Entries are first made row by row, then turned round: the observation has one row per drive.
"""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.compilation import inlined
from flexdrive_gym.drive.layout import COMMAND, READ_1, READ_2, REFERENCE, ROW, SPEED_1, SPEED_2

_NOW_1, _NOW_2, _SPEED_1, _SPEED_2 = (row - READ_1 for row in (READ_1, READ_2, SPEED_1, SPEED_2))


@inlined
def _entry(value: float, scale: float, bound: float) -> float:
    return min(max(value * scale, -bound), bound)


@inlined
def _fill(n: int, k: int, values: Any, start: int, scale: Any, bound: Any, rows: Any) -> int:
    """Make one row of the observation; return the next one's number."""
    factor, limit = scale[k], bound[k]
    for i in range(n):
        rows[k * ROW + i] = _entry(values[start + i], factor, limit)
    return k + 1


@inlined
def _fill_preview(
    n: int,
    k: int,
    ahead: int,
    together: bool,
    samples: int,
    clock: Any,
    row: Any,
    references: Any,
    scale: Any,
    bound: Any,
    rows: Any,
) -> None:
    factor, limit = scale[k], bound[k]
    if together:
        value = _entry(references[row[0] * samples + clock[0] + ahead], factor, limit)
        for i in range(n):
            rows[k * ROW + i] = value
    else:
        for i in range(n):
            rows[k * ROW + i] = _entry(references[row[i] * samples + clock[i] + ahead], factor, limit)


@inlined
def observe(
    n: int,
    sensing: int,
    previews: int,
    together: bool,
    samples: int,
    clock: Any,
    row: Any,
    references: Any,
    ahead: Any,
    scale: Any,
    bound: Any,
    seen: Any,
    state: Any,
    now: Any,
    rows: Any,
    out: Any,
) -> None:
    """Write observations: position and velocity of the chosen encoder(s), error, reference, command, preview.

    ``seen`` points to the rows of the readings, ``now`` to that of the reference; ``together`` says that all drives are at
    the same place of the same reference.
    """
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
    k = _fill(n, k + 1, now, REFERENCE, scale, bound, rows)
    k = _fill(n, k, state, COMMAND, scale, bound, rows)
    for i in range(previews):
        _fill_preview(n, k + i, ahead[i], together, samples, clock, row, references, scale, bound, rows)
    _turn(n, k + previews, rows, out)


@inlined
def _turn(n: int, entries: int, rows: Any, out: Any) -> None:
    if entries == 8:
        # a known width lets the compiler shuffle whole vectors
        for i in range(n):
            for k in range(8):
                out[i * 8 + k] = rows[k * ROW + i]
    else:
        for k in range(entries):
            for i in range(n):
                out[i * entries + k] = rows[k * ROW + i]
