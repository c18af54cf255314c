r"""The one compiled step: two masses, every effect, and set-valued friction kept exactly.

Between events the drive is a smooth system. With the directions of sliding :math:`s_1, s_2 \in \{-1, 0, 1\}` fixed
(0: sticking),

.. math::
   m_1 \dot v_1 &= u - F_s + F_1 - s_1 d_1 \quad (s_1 \ne 0), \qquad v_1 = 0 \quad (s_1 = 0), \\
   m_2 \dot v_2 &= F_s + F_2 - s_2 d_2 \quad (s_2 \ne 0), \qquad v_2 = 0 \quad (s_2 = 0),

where :math:`F_s` is the spring's force, :math:`F_i` the smooth forces on cart i (:math:`-b_i v_i` and more) and
:math:`d_i` its Coulomb level. Such a piece is integrated by the classical Runge-Kutta method of order four; at 1 ms
:math:`\omega_n h \approx 0.03` and its error is far below the events'.

A step ends early at the first *event* inside it:

* a sliding cart's velocity changes sign. The instant is the root of the cubic Hermite polynomial through the
  velocities and accelerations at both ends, exact to fourth order in h. The cart is put to v = 0 and either sticks or
  reverses;
* a sticking cart's force leaves the set [-d, d] (or exceeds the breakaway level). The instant is found by a bracketed
  secant on the margin of that force; the cart is released in its direction. On a track that gives way, what holds one
  cart depends on whether the other slides, so that two carts at rest are asked together.

So a cart at rest has exactly zero velocity (no creep), and the result depends on the step size only to the order of
the scheme. Event-driven integration of dry friction: V. Acary, B. Brogliato, Numerical Methods for Nonsmooth
Dynamical Systems, 2008, ch. 8.

One such piece is :mod:`flexdrive_gym.drive.piece`, which also says what ``z`` is.
"""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.compilation import called, inlined
from flexdrive_gym.drive.crossing import crossing
from flexdrive_gym.drive.effects import FLAG, LINEAR, PUSH_1, PUSH_2
from flexdrive_gym.drive.forces import (
    RECOILS,
    W2,
    accelerations,
    begin_piece,
    finish_piece,
    level_1,
    level_2,
    margin_1,
    margin_2,
    row,
)
from flexdrive_gym.drive.piece import INTEGRATES, SLIDING, STICKING_1, STICKING_2, TABLE, leap, smooth, width
from flexdrive_gym.drive.simd.pack import anywhere, chosen, raised

MAX_EVENTS = 12
# most turns in which two carts at rest are asked: three settled all of 4,000 starts that were drawn
MAX_TURNS = 4
_FINISHES_1, _FINISHES_2, _FINISHES_ACTUATOR = (FLAG["finish", where] for where in ("cart_1", "cart_2", "actuator"))


@inlined
def _linear(z: Any) -> bool:
    """Whether the drive is linear between events."""
    if z is None:
        return True
    return raised(z, LINEAR)


@inlined
def _forces(
    x1: float, v1: float, x2: float, v2: float, s1: float, s2: float, u: float, t: float, z: Any, p: Any
) -> tuple[float, float]:
    """Return the forces on the carts [V], besides spring and dampers, of a drive that is linear between events."""
    f1, f2 = u, 0.0
    if z is not None:
        f1, f2 = u + z[PUSH_1], z[PUSH_2]
    return f1 - s1 * level_1(x1, v1, s1, 0.0, t, z, z, 0, p), f2 - s2 * level_2(x2, v2, s2, 0.0, t, z, z, 0, p)


@inlined
def _direction(v: float, released: float) -> float:
    if v != 0.0:
        return 1.0 if v > 0.0 else -1.0
    return released


@inlined
def _directions(
    x1: float,
    v1: float,
    x2: float,
    v2: float,
    released_1: float,
    released_2: float,
    u: float,
    t: float,
    z: Any,
    p: Any,
) -> tuple[float, float, float, float]:
    """Return the directions in which the carts begin a piece, and by how much forces on carts at rest leave the friction sets.

    On a track that gives way the one depends on the other, where both rest: they are asked in turn until nothing changes.
    """
    s1, s2, held_1, held_2 = _direction(v1, released_1), _direction(v2, released_2), 0.0, 0.0
    for _ in range(MAX_TURNS):
        before_1, before_2 = s1, s2
        if v1 == 0.0:
            held_1, sign = margin_1(x1, x2, v2, s2, u, t, z, 0, p)
            if released_1 == 0.0:
                s1 = sign if held_1 > 0.0 else 0.0
        if v2 == 0.0:
            held_2, sign = margin_2(x1, x2, v1, s1, u, t, z, 0, p)
            if released_2 == 0.0:
                s2 = sign if held_2 > 0.0 else 0.0
        if z is None or not raised(z, RECOILS) or (s1 == before_1 and s2 == before_2):
            break
    return s1, s2, held_1, held_2


@inlined
def commit(x1: float, x2: float, s1: float, s2: float, u: float, t: float, z: Any, p: Any) -> None:
    """Keep what the last smooth piece, which ended at these positions and this time, made of the effects' states."""
    if z is not None:
        if raised(z, INTEGRATES):
            n = width(z)
            for i in range(n):
                z[i] = z[6 * n + i]
        if raised(z, _FINISHES_1) or raised(z, _FINISHES_2) or raised(z, _FINISHES_ACTUATOR):
            finish_piece(x1, x2, s1, s2, u, t, z, p)
            begin_piece(x1, x2, t, z)


@inlined
def step(
    x1: float, v1: float, x2: float, v2: float, u: float, t: float, h: float, table: Any, z: Any, p: Any
) -> tuple[float, float, float, float]:
    """Advance the drive by h seconds under a constant force u; return x1, v1, x2, v2."""
    y1, w1, y2, w2, sliding = x1, v1, x2, v2, False
    s1, s2 = (1.0 if v1 > 0.0 else -1.0), (1.0 if v2 > 0.0 else -1.0)
    if _linear(z):
        f1, f2 = _forces(x1, v1, x2, v2, s1, s2, u, t, z, p)
        y1, w1, y2, w2 = leap(SLIDING, x1, v1, x2, v2, f1, f2, table)
        sliding = v1 != 0.0 and v2 != 0.0 and s1 * w1 > 0.0 and s2 * w2 > 0.0 and h == table[TABLE - 1]
    elif v1 != 0.0 and v2 != 0.0:
        y1, w1, y2, w2, _a1, _a2 = smooth(x1, v1, x2, v2, s1, s2, u, t, h, z, p)
        sliding = s1 * w1 > 0.0 and s2 * w2 > 0.0
        if sliding:
            commit(y1, y2, s1, s2, u, t + h, z, p)
    if not sliding:
        y1, w1, y2, w2 = step_through_events(x1, v1, x2, v2, u, t, h, table, z, p)
    return y1, w1, y2, w2


@inlined
def piece(
    x1: float,
    v1: float,
    x2: float,
    v2: float,
    s1: float,
    s2: float,
    u: float,
    t: float,
    h: float,
    table: Any,
    z: Any,
    p: Any,
) -> tuple[float, float, float, float]:
    """Integrate one smooth piece, by the table where it fits: the part of it for what sticks."""
    if _linear(z) and h == table[TABLE - 1]:
        f1, f2 = _forces(x1, v1, x2, v2, s1, s2, u, t, z, p)
        y1, w1, y2, w2 = leap(SLIDING, x1, v1, x2, v2, f1, f2, table)
        sticks_1, sticks_2 = s1 == 0.0, s2 == 0.0
        if anywhere(sticks_2):
            a1, b1, a2, b2 = leap(STICKING_2, x1, v1, x2, v2, f1, f2, table)
            y1, w1 = chosen(sticks_2, a1, y1), chosen(sticks_2, b1, w1)
            y2, w2 = chosen(sticks_2, a2, y2), chosen(sticks_2, b2, w2)
        if anywhere(sticks_1):
            a1, b1, a2, b2 = leap(STICKING_1, x1, v1, x2, v2, f1, f2, table)
            rests = sticks_1 & sticks_2
            y1, w1 = chosen(rests, x1, chosen(sticks_1, a1, y1)), chosen(rests, v1, chosen(sticks_1, b1, w1))
            y2, w2 = chosen(rests, x2, chosen(sticks_1, a2, y2)), chosen(rests, v2, chosen(sticks_1, b2, w2))
        return y1, w1, y2, w2
    y1, w1, y2, w2, _a1, _a2 = smooth(x1, v1, x2, v2, s1, s2, u, t, h, z, p)
    return y1, w1, y2, w2


@called
def step_through_events(
    x1: float, v1: float, x2: float, v2: float, u: float, t: float, h: float, table: Any, z: Any, p: Any
) -> tuple[float, float, float, float]:
    """Advance the drive by h seconds, piece by piece from event to event; see the module's notes."""
    left = h
    released_1, released_2 = 0.0, 0.0
    trial = 6 * width(z)
    for attempt in range(MAX_EVENTS):
        s1, s2, held_1, held_2 = _directions(x1, v1, x2, v2, released_1, released_2, u, t, z, p)
        y1, w1, y2, w2 = piece(x1, v1, x2, v2, s1, s2, u, t, left, table, z, p)

        # events of the trial: a sliding cart came back through zero, a sticking cart can no longer be held
        stop_1, stop_2 = s1 * w1 < 0.0, s2 * w2 < 0.0
        over_1, free_1 = margin_1(y1, y2, w2, s2, u, t + left, z, trial, p) if s1 == 0.0 else (0.0, 0.0)
        over_2, free_2 = margin_2(y1, y2, w1, s1, u, t + left, z, trial, p) if s2 == 0.0 and p[W2] > 0.0 else (0.0, 0.0)
        loose_1, loose_2 = over_1 > 0.0, over_2 > 0.0
        if attempt == MAX_EVENTS - 1 or not (stop_1 or stop_2 or loose_1 or loose_2):
            commit(y1, y2, s1, s2, u, t + left, z, p)
            return y1, 0.0 if stop_1 else w1, y2, 0.0 if stop_2 else w2

        theta_1, theta_2 = 2.0, 2.0
        if stop_1 or stop_2:
            a1, a2 = accelerations(x1, v1, x2, v2, s1, s2, u, t, z, z, row(0), p)
            e1, e2 = accelerations(y1, w1, y2, w2, s1, s2, u, t + left, z, z, row(trial), p)
            if stop_1:
                theta_1 = crossing(v1, a1 * left, w1, e1 * left)
            if stop_2:
                theta_2 = crossing(v2, a2 * left, w2, e2 * left)
        if loose_1:
            theta_1 = _release(1, held_1, over_1, x1, v1, x2, v2, s2, u, t, left, z, p)
        if loose_2:
            theta_2 = _release(2, held_2, over_2, x1, v1, x2, v2, s1, u, t, left, z, p)

        theta = min(theta_1, theta_2)
        h_event = theta * left
        x1, v1, x2, v2, _a1, _a2 = smooth(x1, v1, x2, v2, s1, s2, u, t, h_event, z, p)
        commit(x1, x2, s1, s2, u, t + h_event, z, p)
        released_1, released_2 = 0.0, 0.0
        if theta_1 <= theta:
            v1 = 0.0
            released_1 = free_1 if loose_1 else 0.0
        if theta_2 <= theta:
            v2 = 0.0
            released_2 = free_2 if loose_2 else 0.0
        t += h_event
        left -= h_event
        if left <= 0.0:
            break
    return x1, v1, x2, v2


@called
def _release(
    cart: int,
    before: float,
    after: float,
    x1: float,
    v1: float,
    x2: float,
    v2: float,
    s_other: float,
    u: float,
    t: float,
    left: float,
    z: Any,
    p: Any,
) -> float:
    """Return the fraction of the piece after which a sticking cart tears loose: a bracketed secant on its margin.

    The Illinois variant of regula falsi; the margin is smooth, so a few passes reach round-off.
    """
    low, high, trial = 0.0, 1.0, 6 * width(z)
    side = 0
    for _ in range(40):
        theta = (low * after - high * before) / (after - before) if after > before else 0.5 * (low + high)
        if not low < theta < high:
            theta = 0.5 * (low + high)
        s1, s2 = (0.0, s_other) if cart == 1 else (s_other, 0.0)
        y1, w1, y2, w2, _a1, _a2 = smooth(x1, v1, x2, v2, s1, s2, u, t, theta * left, z, p)
        if cart == 1:
            value, _s = margin_1(y1, y2, w2, s_other, u, t + theta * left, z, trial, p)
        else:
            value, _s = margin_2(y1, y2, w1, s_other, u, t + theta * left, z, trial, p)
        if abs(value) < 1e-14 or high - low < 1e-12:
            return theta
        if value > 0.0:
            high, after = theta, value
            if side == 1:
                before *= 0.5
            side = 1
        else:
            low, before = theta, value
            if side == -1:
                after *= 0.5
            side = -1
    return high
