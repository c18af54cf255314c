"""The step of several recordings of one drive at once, in the lanes of a :mod:`pack <flexdrive_gym.drive.simd.pack>`.

Most steps see no event: carts that slide go on sliding, carts that stick go on sticking. Such steps are taken by all lanes
at once. Where an event ends the piece, that lane takes its step by itself (:mod:`flexdrive_gym.drive.step`), from a copy of
what the effects remember. The arithmetic of a lane is that of a single drive in the same order, so its motion is the same to
the last bit.
"""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.compilation import called, inlined, shifted
from flexdrive_gym.drive.effects import N_BASE_PARAMETERS, SEEN_BY_STEP, WORKSPACE
from flexdrive_gym.drive.forces import RECOILS, W2, margin_1, margin_2
from flexdrive_gym.drive.piece import TABLE, tabulate, width
from flexdrive_gym.drive.sample import MEMORY, clear
from flexdrive_gym.drive.simd.pack import WIDTH, anywhere, chosen, lane, numbers_of, raised, with_lane
from flexdrive_gym.drive.step import commit, piece, step_through_events

# a workspace of packs, then one of numbers per lane, in which it takes the steps that it takes by itself
WORKSPACES = 2 * WIDTH * WORKSPACE
# the memory of all lanes, then the table of the step and work space to make it
MEMORIES = WIDTH * MEMORY + TABLE + N_BASE_PARAMETERS


@inlined
def _own(z: Any, i: int) -> Any:
    """Return the workspace of one lane."""
    return shifted(numbers_of(z), (WIDTH + i) * WORKSPACE)


@called
def separate(z: Any) -> None:
    """Copy the workspace of packs to those of the lanes: flags and all."""
    for i in range(WIDTH):
        own = _own(z, i)
        for k in range(WORKSPACE):
            own[k] = lane(z[k], i)


@inlined
def step_lanes(
    x1: Any, v1: Any, x2: Any, v2: Any, u: Any, t: float, h: float, table: Any, z: Any, p: Any
) -> tuple[Any, Any, Any, Any]:
    """Advance all lanes by h seconds, each under a constant force; return x1, v1, x2, v2."""
    rest_1, rest_2 = v1 == 0.0, v2 == 0.0
    s1 = chosen(rest_1, 0.0, chosen(v1 > 0.0, 1.0, -1.0))
    s2 = chosen(rest_2, 0.0, chosen(v2 > 0.0, 1.0, -1.0))
    if anywhere(rest_1):
        held, sign = margin_1(x1, x2, v2, s2, u, t, z, 0, p)
        s1 = chosen(rest_1 & (held > 0.0), sign, s1)
    if anywhere(rest_2):
        held, sign = margin_2(x1, x2, v1, s1, u, t, z, 0, p)
        s2 = chosen(rest_2 & (held > 0.0), sign, s2)
    y1, w1, y2, w2 = piece(x1, v1, x2, v2, s1, s2, u, t, h, table, z, p)

    trial = 6 * width(z)
    ends = (s1 * w1 < 0.0) | (s2 * w2 < 0.0)
    if raised(z, RECOILS):
        # where one of two carts at rest leaves, the other is asked again
        ends = ends | (rest_1 & rest_2 & ((s1 != 0.0) | (s2 != 0.0)))
    sticks_1, sticks_2 = s1 == 0.0, s2 == 0.0
    if anywhere(sticks_1):
        over, _sign = margin_1(y1, y2, w2, s2, u, t + h, z, trial, p)
        ends = ends | (sticks_1 & (over > 0.0))
    if p[W2] > 0.0 and anywhere(sticks_2):
        over, _sign = margin_2(y1, y2, w1, s1, u, t + h, z, trial, p)
        ends = ends | (sticks_2 & (over > 0.0))
    if anywhere(ends):
        return _with_events(ends, x1, v1, x2, v2, y1, w1, y2, w2, s1, s2, u, t, h, table, z, p)
    commit(y1, y2, s1, s2, u, t + h, z, p)
    return y1, w1, y2, w2


@called
def _with_events(
    ends: Any,
    x1: Any,
    v1: Any,
    x2: Any,
    v2: Any,
    y1: Any,
    w1: Any,
    y2: Any,
    w2: Any,
    s1: Any,
    s2: Any,
    u: Any,
    t: float,
    h: float,
    table: Any,
    z: Any,
    p: Any,
) -> tuple[Any, Any, Any, Any]:
    """End the step of the lanes whose piece no event ends; the others go from event to event by themselves."""
    entries = numbers_of(z)
    for i in range(WIDTH):
        if lane(ends, i):
            own = _own(z, i)
            for k in SEEN_BY_STEP:
                own[k] = entries[WIDTH * k + i]
    commit(y1, y2, s1, s2, u, t + h, z, p)
    for i in range(WIDTH):
        if lane(ends, i):
            own = _own(z, i)
            a1, b1, a2, b2 = step_through_events(
                lane(x1, i), lane(v1, i), lane(x2, i), lane(v2, i), lane(u, i), t, h, table, own, p
            )
            y1, w1, y2, w2 = with_lane(y1, i, a1), with_lane(w1, i, b1), with_lane(y2, i, a2), with_lane(w2, i, b2)
            for k in SEEN_BY_STEP:
                entries[WIDTH * k + i] = own[k]
    return y1, w1, y2, w2


@inlined
def begin_lanes(v1: Any, v2: Any, sample_time: float, substeps: int, table: Any, memory: Any, z: Any, p: Any) -> None:
    """Tabulate the step of the drive, and clear what all lanes remember that start at these velocities."""
    tabulate(sample_time / substeps, table, p)
    clear(v1, v2, memory, z, p)
    separate(z)
