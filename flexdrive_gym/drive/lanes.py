"""Integrate up to LANES drives: those with base effects side by side, any others one by one.

Nearly all drives are done by a first loop over all lanes. Those with an event inside the leap are moved together and go
from event to event in a second loop of the same kind, in rounds that become fewer. Every lane's arithmetic is that of
:mod:`flexdrive_gym.drive.series` in the same order, and vector and scalar arithmetic round alike, so a drive behaves the same
to the last bit whether it is alone or one of thousands.
"""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.compilation import inlined, shifted
from flexdrive_gym.drive.effects import N_BASE_PARAMETERS, N_PARAMETERS, N_STATES
from flexdrive_gym.drive.forces import level_1, level_2
from flexdrive_gym.drive.layout import (
    COMMAND,
    DECAYS,
    E_FREE_1,
    E_FREE_2,
    E_LEFT,
    E_PARAMETERS,
    E_U,
    E_UNSURE,
    E_V1,
    E_V2,
    E_X1,
    E_X2,
    LANES,
    OPEN,
    PARAMETERS,
    V1,
    V2,
    X1,
    X2,
    parameters_in_event,
    parameters_of,
)
from flexdrive_gym.drive.sample import MEMORY, advance
from flexdrive_gym.drive.series import arrive, directions, lasts, next_event, search, series, total
from flexdrive_gym.drive.step import MAX_EVENTS, TABLE

TABLE_COLUMNS = TABLE + N_PARAMETERS
_MOVED = 8  # rows of a drive with an event that change


@inlined
def load_shared(n: int, p: Any, decays: Any, work: Any) -> None:
    """Give n lanes the same parameters, and the lanes of events too."""
    for k in range(N_BASE_PARAMETERS):
        value = p[k]
        for i in range(n):
            work[PARAMETERS + k * LANES + i] = value
            work[E_PARAMETERS + k * LANES + i] = value
    for k in range(2):
        value = decays[k]
        for i in range(n):
            work[DECAYS + k * LANES + i] = value


@inlined
def load_own(low: int, n: int, p: Any, decays: Any, work: Any) -> None:
    """Give n lanes the parameters of the drives from ``low`` on."""
    for i in range(n):
        q = shifted(p, (low + i) * N_PARAMETERS)
        for k in range(N_BASE_PARAMETERS):
            work[PARAMETERS + k * LANES + i] = q[k]
        work[DECAYS + i] = decays[2 * (low + i)]
        work[DECAYS + LANES + i] = decays[2 * (low + i) + 1]


@inlined
def integrate_lanes(n: int, leaps: int, h: float, parts: int, shared: bool, picks: Any, work: Any) -> None:
    """Advance n drives by ``leaps`` times h; events are searched at ``parts`` instants of a leap where need be."""
    for _ in range(leaps):
        _leap(n, h, work)
        m = 0
        for i in range(n):
            picks[m] = i
            m += 1 if work[OPEN + i] > 0.0 else 0
        if m > 0:
            _gather(m, h, shared, picks, work)
            for _attempt in range(MAX_EVENTS):
                _pieces(m, work)
                for e in range(m):
                    if work[E_UNSURE + e] > 0.0:
                        _uncertain_piece(e, parts, work)
                m = _scatter(m, shared, picks, work)
                if m == 0:
                    break
            _give_up(m, picks, work)


@inlined
def _leap(n: int, h: float, work: Any) -> None:
    """Advance the drives without an event; mark the others."""
    for i in range(n):
        x1, v1 = work[X1 * LANES + i], work[V1 * LANES + i]
        x2, v2 = work[X2 * LANES + i], work[V2 * LANES + i]
        u, q = work[COMMAND * LANES + i], parameters_of(work, i)
        s1, s2 = directions(x1, v1, x2, v2, u, 0.0, 0.0, q)
        y1, w1, y2, w2, c1, c2 = series(x1, v1, x2, v2, s1, s2, u, h, q)
        quiet_1 = lasts(c1, s1, level_1(x1, v1, s1, 0.0, 0.0, None, 0, q))
        quiet_2 = lasts(c2, s2, level_2(x2, v2, s2, 0.0, 0.0, None, 0, q))
        quiet = quiet_1 & quiet_2
        work[X1 * LANES + i] = total(y1) if quiet else x1
        work[V1 * LANES + i] = total(w1) if quiet else v1
        work[X2 * LANES + i] = total(y2) if quiet else x2
        work[V2 * LANES + i] = total(w2) if quiet else v2
        work[OPEN + i] = 0.0 if quiet else 1.0


@inlined
def _gather(m: int, h: float, shared: bool, picks: Any, work: Any) -> None:
    """Move the picked drives together."""
    for e in range(m):
        i = picks[e]
        work[E_X1 + e] = work[X1 * LANES + i]
        work[E_V1 + e] = work[V1 * LANES + i]
        work[E_X2 + e] = work[X2 * LANES + i]
        work[E_V2 + e] = work[V2 * LANES + i]
        work[E_U + e] = work[COMMAND * LANES + i]
        work[E_LEFT + e] = h
        work[E_FREE_1 + e] = 0.0
        work[E_FREE_2 + e] = 0.0
    if not shared:
        for k in range(N_BASE_PARAMETERS):
            for e in range(m):
                work[E_PARAMETERS + k * LANES + e] = work[PARAMETERS + k * LANES + picks[e]]


@inlined
def _pieces(m: int, work: Any) -> None:
    """Advance m drives to their next event or the end of the leap; mark those where that is uncertain."""
    for e in range(m):
        x1, v1, x2, v2 = work[E_X1 + e], work[E_V1 + e], work[E_X2 + e], work[E_V2 + e]
        u, h, q = work[E_U + e], work[E_LEFT + e], parameters_in_event(work, e)
        free_1, free_2 = work[E_FREE_1 + e], work[E_FREE_2 + e]
        s1, s2 = directions(x1, v1, x2, v2, u, free_1, free_2, q)
        y1, w1, y2, w2, c1, c2 = series(x1, v1, x2, v2, s1, s2, u, h, q)
        t1, side_1, sure_1 = next_event(c1, s1, level_1(x1, v1, s1, 0.0, 0.0, None, 0, q))
        t2, side_2, sure_2 = next_event(c2, s2, level_2(x2, v2, s2, 0.0, 0.0, None, 0, q))
        sure = sure_1 & sure_2
        z1, g1, z2, g2, left, new_1, new_2 = arrive(y1, w1, y2, w2, s1, s2, t1, t2, side_1, side_2)
        work[E_X1 + e] = z1 if sure else x1
        work[E_V1 + e] = g1 if sure else v1
        work[E_X2 + e] = z2 if sure else x2
        work[E_V2 + e] = g2 if sure else v2
        work[E_LEFT + e] = left * h if sure else h
        work[E_FREE_1 + e] = new_1 if sure else free_1
        work[E_FREE_2 + e] = new_2 if sure else free_2
        work[E_UNSURE + e] = 0.0 if sure else 1.0


@inlined
def _uncertain_piece(e: int, parts: int, work: Any) -> None:
    """Do for one drive what :func:`_pieces` does, searching for its events."""
    x1, v1, x2, v2 = work[E_X1 + e], work[E_V1 + e], work[E_X2 + e], work[E_V2 + e]
    u, h, q = work[E_U + e], work[E_LEFT + e], parameters_in_event(work, e)
    s1, s2 = directions(x1, v1, x2, v2, u, work[E_FREE_1 + e], work[E_FREE_2 + e], q)
    y1, w1, y2, w2, c, d = series(x1, v1, x2, v2, s1, s2, u, h, q)
    f1, f2 = level_1(x1, v1, s1, 0.0, 0.0, None, 0, q), level_2(x2, v2, s2, 0.0, 0.0, None, 0, q)
    t1, side_1 = search(c[0], c[1], c[2], c[3], c[4], c[5], c[6], s1, f1, parts)
    t2, side_2 = search(d[0], d[1], d[2], d[3], d[4], d[5], d[6], s2, f2, parts)
    z1, g1, z2, g2, left, new_1, new_2 = arrive(y1, w1, y2, w2, s1, s2, t1, t2, side_1, side_2)
    work[E_X1 + e], work[E_V1 + e], work[E_X2 + e], work[E_V2 + e] = z1, g1, z2, g2
    work[E_LEFT + e] = left * h
    work[E_FREE_1 + e], work[E_FREE_2 + e] = new_1, new_2


@inlined
def _scatter(m: int, shared: bool, picks: Any, work: Any) -> int:
    """Put the drives that reached the end back into their lanes; move the others together and return how many they are."""
    left = 0
    for e in range(m):
        i = picks[e]
        if work[E_LEFT + e] > 0.0:
            picks[left] = i
            for k in range(_MOVED):
                work[E_X1 + k * LANES + left] = work[E_X1 + k * LANES + e]
            if not shared:
                for k in range(N_BASE_PARAMETERS):
                    work[E_PARAMETERS + k * LANES + left] = work[E_PARAMETERS + k * LANES + e]
            left += 1
        else:
            work[X1 * LANES + i] = work[E_X1 + e]
            work[V1 * LANES + i] = work[E_V1 + e]
            work[X2 * LANES + i] = work[E_X2 + e]
            work[V2 * LANES + i] = work[E_V2 + e]
    return left


@inlined
def _give_up(m: int, picks: Any, work: Any) -> None:
    """Let drives with very many events finish the leap in their present mode; a cart that came back through zero rests."""
    for e in range(m):
        i = picks[e]
        x1, v1, x2, v2 = work[E_X1 + e], work[E_V1 + e], work[E_X2 + e], work[E_V2 + e]
        u, q = work[E_U + e], parameters_in_event(work, e)
        s1, s2 = directions(x1, v1, x2, v2, u, work[E_FREE_1 + e], work[E_FREE_2 + e], q)
        y1, w1, y2, w2, _c1, _c2 = series(x1, v1, x2, v2, s1, s2, u, work[E_LEFT + e], q)
        work[X1 * LANES + i], work[X2 * LANES + i] = total(y1), total(y2)
        work[V1 * LANES + i] = total(w1) if s1 * total(w1) > 0.0 else 0.0
        work[V2 * LANES + i] = total(w2) if s2 * total(w2) > 0.0 else 0.0


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
    scratch: Any,
    work: Any,
) -> None:
    """Integrate n drives one by one: some delay their command, or have effects beyond the base."""
    for i in range(n):
        j = low + i
        row = 0 if shared else j
        if z is not None:
            for k in range(N_STATES):
                scratch[k] = z[j * N_STATES + k]
        space = None if z is None else scratch
        x1, v1, x2, v2 = advance(
            work[X1 * LANES + i],
            work[V1 * LANES + i],
            work[X2 * LANES + i],
            work[V2 * LANES + i],
            work[COMMAND * LANES + i],
            clock[j] * period,
            period,
            substeps,
            shifted(tables, row * TABLE_COLUMNS),
            shifted(memory, j * MEMORY),
            space,
            shifted(p, row * N_PARAMETERS),
        )
        work[X1 * LANES + i] = x1
        work[V1 * LANES + i] = v1
        work[X2 * LANES + i] = x2
        work[V2 * LANES + i] = v2
        if z is not None:
            for k in range(N_STATES):
                z[j * N_STATES + k] = scratch[k]
