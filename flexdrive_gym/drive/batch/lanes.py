"""Integrate a group of strips: drives with base effects in SIMD lanes, any others one by one.

Nearly all drives are done by a first loop over all lanes. Those with an event inside the leap are moved together and go from
event to event in a second loop of the same kind, in rounds that become fewer. Every lane's arithmetic is that of
:mod:`flexdrive_gym.drive.batch.series` in the same order, and vector and scalar arithmetic round alike, so a drive behaves
the same to the last bit whether it is alone or one of thousands.
"""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.batch.series import (
    arrive,
    lasts,
    lasts_surely,
    next_event,
    path,
    search,
    series,
    total,
    travelled,
)
from flexdrive_gym.drive.compilation import inlined, shifted
from flexdrive_gym.drive.effects import N_BASE_PARAMETERS, WORKSPACE
from flexdrive_gym.drive.layout import (
    COMMAND,
    E_FREE_1,
    E_FREE_2,
    E_LEFT,
    E_RESPONSE,
    E_U,
    E_UNSURE,
    E_V1,
    E_V2,
    E_X1,
    E_X2,
    GATHERED,
    LANES,
    OPEN,
    PARAMETER_ROWS,
    RESPONSE,
    RESPONSES,
    ROW,
    STATE_ROWS,
    V1,
    V2,
    WORK_ROWS,
    X1,
    X2,
    gathered_of,
    padded,
    responses_of,
    stride,
    strip_of,
)
from flexdrive_gym.drive.piece import TABLE
from flexdrive_gym.drive.sample import MEMORY, advance
from flexdrive_gym.drive.step import MAX_EVENTS, step

# the step's table, and work space to make it
TABLE_COLUMNS = TABLE + N_BASE_PARAMETERS
_MOVED = 8  # rows of a drive with an event that change


@inlined
def integrate_lanes(
    n: int, leaps: int, h: float, parts: int, short: bool, shared: bool, q: Any, picks: Any, state: Any, work: Any
) -> None:
    """Advance a group's n drives by ``leaps`` times h; events are searched at ``parts`` instants of a leap where need be.

    ``q`` are rows of parameters and responses, ``state`` and ``work`` as in :mod:`~flexdrive_gym.drive.layout`.
    """
    for _ in range(leaps):
        m = 0
        for low in range(0, n, LANES):
            lanes, rows = min(LANES, n - low), shifted(q, 0 if shared else strip_of(low, PARAMETER_ROWS))
            here, own = shifted(state, strip_of(low, STATE_ROWS)), shifted(work, strip_of(low, WORK_ROWS))
            if short:
                _leap(padded(lanes), h, True, rows, here, own)
            else:
                _leap(padded(lanes), h, False, rows, here, own)
            for i in range(lanes):
                picks[m] = low + i
                m += 1 if own[OPEN + i] > 0.0 else 0
        if m > 0:
            _gather(m, shared, q, picks, state, work)
            for _attempt in range(MAX_EVENTS):
                if short:
                    _pieces(padded(m), h, True, work)
                else:
                    _pieces(padded(m), h, False, work)
                for e in range(m):
                    if work[E_UNSURE + e] > 0.0:
                        _uncertain_piece(e, h, parts, work)
                if short:
                    _rests(padded(m), h, True, work)
                else:
                    _rests(padded(m), h, False, work)
                m = _scatter(m, shared, picks, state, work)
                if m == 0:
                    break
            for e in range(m):
                _give_up(e, strip_of(picks[e], STATE_ROWS), h, state, work)


@inlined
def _leap(n: int, h: float, short: bool, q: Any, state: Any, work: Any) -> None:
    """Advance the drives without an event; mark the others."""
    for i in range(n):
        x1, v1, x2, v2 = state[X1 + i], state[V1 + i], state[X2 + i], state[V2 + i]
        w1, w2, c1, c2, s1, s2, f1, f2 = series(
            x1, v1, x2, v2, 0.0, 0.0, state[COMMAND + i], h, 1.0, responses_of(q, i), short
        )
        quiet = lasts_surely(c1, s1, f1) & lasts_surely(c2, s2, f2)
        state[X1 + i] = travelled(x1, w1, h, short) if quiet else x1
        state[V1 + i] = total(c1) if quiet & (s1 != 0.0) else v1
        state[X2 + i] = travelled(x2, w2, h, short) if quiet else x2
        state[V2 + i] = total(c2) if quiet & (s2 != 0.0) else v2
        work[OPEN + i] = 0.0 if quiet else 1.0


@inlined
def _gather(m: int, shared: bool, q: Any, picks: Any, state: Any, work: Any) -> None:
    """Move the picked drives together, and fill the last vector up with one of them."""
    for e in range(m, padded(m)):
        picks[e] = picks[0]
    for e in range(padded(m)):
        i = strip_of(picks[e], STATE_ROWS)
        work[E_X1 + e] = state[X1 + i]
        work[E_V1 + e] = state[V1 + i]
        work[E_X2 + e] = state[X2 + i]
        work[E_V2 + e] = state[V2 + i]
        work[E_U + e] = state[COMMAND + i]
        work[E_LEFT + e] = 1.0
        work[E_FREE_1 + e] = 0.0
        work[E_FREE_2 + e] = 0.0
    if not shared:
        for k in range(RESPONSES):
            for e in range(padded(m)):
                work[E_RESPONSE + k * GATHERED + e] = q[RESPONSE + k * ROW + strip_of(picks[e], PARAMETER_ROWS)]


@inlined
def _pieces(m: int, h: float, short: bool, work: Any) -> None:
    """Advance m drives to their next event or the end of the leap; mark those where that is uncertain."""
    for e in range(m):
        x1, v1, x2, v2 = work[E_X1 + e], work[E_V1 + e], work[E_X2 + e], work[E_V2 + e]
        u, share, free_1, free_2 = work[E_U + e], work[E_LEFT + e], work[E_FREE_1 + e], work[E_FREE_2 + e]
        w1, w2, c1, c2, s1, s2, f1, f2 = series(
            x1, v1, x2, v2, free_1, free_2, u, h, share, gathered_of(work, e), short
        )
        y1, y2 = path(x1, w1, h * share), path(x2, w2, h * share)
        t1, t2, side_1, side_2, sure = next_event(c1, c2, s1, s2, f1, f2, short)
        z1, g1, z2, g2, left, new_1, new_2 = arrive(y1, c1, y2, c2, s1, s2, t1, t2, side_1, side_2, short)
        work[E_X1 + e] = z1 if sure else x1
        work[E_V1 + e] = g1 if sure else v1
        work[E_X2 + e] = z2 if sure else x2
        work[E_V2 + e] = g2 if sure else v2
        work[E_LEFT + e] = left * share if sure else share
        work[E_FREE_1 + e] = new_1 if sure else free_1
        work[E_FREE_2 + e] = new_2 if sure else free_2
        work[E_UNSURE + e] = 0.0 if sure else 1.0


@inlined
def _uncertain_piece(e: int, h: float, parts: int, work: Any) -> None:
    """Do for one drive what :func:`_pieces` does, searching for its events."""
    x1, v1, x2, v2 = work[E_X1 + e], work[E_V1 + e], work[E_X2 + e], work[E_V2 + e]
    u, share, free_1, free_2 = work[E_U + e], work[E_LEFT + e], work[E_FREE_1 + e], work[E_FREE_2 + e]
    w1, w2, c, d, s1, s2, f1, f2 = series(x1, v1, x2, v2, free_1, free_2, u, h, share, gathered_of(work, e), False)
    y1, y2 = path(x1, w1, h * share), path(x2, w2, h * share)
    t1, side_1 = search(c[0], c[1], c[2], c[3], c[4], c[5], c[6], s1, f1, parts)
    t2, side_2 = search(d[0], d[1], d[2], d[3], d[4], d[5], d[6], s2, f2, parts)
    z1, g1, z2, g2, left, new_1, new_2 = arrive(y1, c, y2, d, s1, s2, t1, t2, side_1, side_2, False)
    work[E_X1 + e], work[E_V1 + e], work[E_X2 + e], work[E_V2 + e] = z1, g1, z2, g2
    work[E_LEFT + e] = left * share
    work[E_FREE_1 + e], work[E_FREE_2 + e] = new_1, new_2


@inlined
def _rests(m: int, h: float, short: bool, work: Any) -> None:
    """Advance those of m drives that have no further event to the end of the leap: for most, one event is all."""
    for e in range(m):
        x1, v1, x2, v2 = work[E_X1 + e], work[E_V1 + e], work[E_X2 + e], work[E_V2 + e]
        u, share, free_1, free_2 = work[E_U + e], work[E_LEFT + e], work[E_FREE_1 + e], work[E_FREE_2 + e]
        w1, w2, c1, c2, s1, s2, f1, f2 = series(
            x1, v1, x2, v2, free_1, free_2, u, h, share, gathered_of(work, e), short
        )
        quiet = lasts(c1, s1, f1) & lasts(c2, s2, f2)
        work[E_X1 + e] = travelled(x1, w1, h * share, short) if quiet else x1
        work[E_V1 + e] = total(c1) if quiet & (s1 != 0.0) else v1
        work[E_X2 + e] = travelled(x2, w2, h * share, short) if quiet else x2
        work[E_V2 + e] = total(c2) if quiet & (s2 != 0.0) else v2
        work[E_LEFT + e] = 0.0 if quiet else share


@inlined
def _scatter(m: int, shared: bool, picks: Any, state: Any, work: Any) -> int:
    """Put the drives that reached the end back into their lanes; move the others together and return how many they are."""
    left = 0
    for e in range(m):
        if work[E_LEFT + e] > 0.0:
            if left < e:
                picks[left] = picks[e]
                for k in range(_MOVED):
                    work[E_X1 + k * GATHERED + left] = work[E_X1 + k * GATHERED + e]
                if not shared:
                    for k in range(RESPONSES):
                        work[E_RESPONSE + k * GATHERED + left] = work[E_RESPONSE + k * GATHERED + e]
            left += 1
        else:
            i = strip_of(picks[e], STATE_ROWS)
            state[X1 + i] = work[E_X1 + e]
            state[V1 + i] = work[E_V1 + e]
            state[X2 + i] = work[E_X2 + e]
            state[V2 + i] = work[E_V2 + e]
    return left


@inlined
def _give_up(e: int, i: int, h: float, state: Any, work: Any) -> None:
    """Let a drive with very many events finish the leap in its present mode; a cart that came back through zero rests."""
    x1, v1, x2, v2 = work[E_X1 + e], work[E_V1 + e], work[E_X2 + e], work[E_V2 + e]
    u, share, free_1, free_2 = work[E_U + e], work[E_LEFT + e], work[E_FREE_1 + e], work[E_FREE_2 + e]
    w1, w2, c1, c2, s1, s2, _f1, _f2 = series(x1, v1, x2, v2, free_1, free_2, u, h, share, gathered_of(work, e), False)
    state[X1 + i], state[X2 + i] = travelled(x1, w1, h * share, False), travelled(x2, w2, h * share, False)
    state[V1 + i] = total(c1) if s1 * total(c1) > 0.0 else 0.0
    state[V2 + i] = total(c2) if s2 * total(c2) > 0.0 else 0.0


@inlined
def integrate_each(
    low: int,
    n: int,
    period: float,
    substeps: int,
    shared: bool,
    clock: Any,
    p: Any,
    tables: Any,
    memory: Any,
    z: Any,
    state: Any,
) -> None:
    """Integrate a group's n drives one by one: some delay their command, or have effects beyond the base."""
    for lane in range(n):
        j, i = low + lane, strip_of(lane, STATE_ROWS)
        row = 0 if shared else j
        x1, v1, x2, v2 = advance(
            step,
            state[X1 + i],
            state[V1 + i],
            state[X2 + i],
            state[V2 + i],
            state[COMMAND + i],
            clock[j] * period,
            period,
            substeps,
            shifted(tables, row * TABLE_COLUMNS),
            shifted(memory, j * MEMORY),
            shifted(z, j * WORKSPACE),
            shifted(p, row * stride(z)),
        )
        state[X1 + i] = x1
        state[V1 + i] = v1
        state[X2 + i] = x2
        state[V2 + i] = v2
