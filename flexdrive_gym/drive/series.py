r"""Drives with base effects only, from event to event by power series; the step of many drives side by side.

Between events such a drive is linear with a constant force, so position and velocity are power series in the time since
the last event. With :math:`\tau = t/h` and the forces of :mod:`flexdrive_gym.drive.forces`, which are linear,

.. math::
   x_{k+1} = \frac{h\,v_k}{k+1}, \qquad v_{k+1} = \frac{h}{m}\,\frac{F_k}{k+1}, \qquad
   F_k = F(x_k, v_k) \text{ and at } k = 0 \text{ also } u \text{ and friction.}

Cut at :math:`\tau^4` this is the Runge-Kutta step of :mod:`flexdrive_gym.drive.step`; kept to :math:`\tau^6` it serves for a
whole control period at once. And because velocities and forces are polynomials, events need no integration to be found:
every cart has a *slack* that is not negative while its mode lasts, the speed of a sliding cart and what is left of
the friction of a sticking one. An event is the slack's first root.

Most steps have none, which the slack's Bernstein coefficients prove; most others have exactly one per cart, which
monotony or curvature of one sign proves, and Newton's method finds. Nothing of that branches, so the compiler does many drives
at once. What remains is searched in steps no longer than the physics step, one drive at a time.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from flexdrive_gym.drive.compilation import called, fused, inlined
from flexdrive_gym.drive.forces import (
    W1,
    W2,
    force_1,
    force_2,
    hold_1,
    hold_2,
    level_1,
    level_2,
    spring_force,
)

ORDER = 6
# the largest product of a leap's length and the drive's rate for which the series' remainder stays below 1e-8
REACH = 0.25
# the same for series that end with τ⁴, as a Runge-Kutta step does
SHORT_REACH = 0.05
_NEVER = 2.0
_HALF, _THIRD, _QUARTER, _FIFTH, _SIXTH = 1.0 / 2.0, 1.0 / 3.0, 1.0 / 4.0, 1.0 / 5.0, 1.0 / 6.0


@inlined
def _forces(x1: float, v1: float, x2: float, v2: float, u: float, p: Any) -> tuple[float, float]:
    # linear forces do not depend on the direction of sliding
    fs = spring_force(x1 - x2, v1 - v2, None, 0, p)
    return force_1(x1, v1, 0.0, u, fs, 0.0, None, 0, p), force_2(x2, v2, 0.0, fs, 0.0, None, 0, p)


@inlined
def _direction(v: float, released: float, force: float, hold: float) -> float:
    """Return in which direction a cart slides from now on, 0 if it sticks."""
    loose = released if released != 0.0 else ((1.0 if force > 0.0 else -1.0) if abs(force) > hold else 0.0)
    return (1.0 if v > 0.0 else -1.0) if v != 0.0 else loose


@inlined
def series(
    x1: float,
    v1: float,
    x2: float,
    v2: float,
    released_1: float,
    released_2: float,
    u: float,
    h: float,
    p: Any,
    short: bool,
) -> Any:
    """Return the motion over h: power series of x1, v1, x2, v2, then slack, direction and friction of either cart.

    A slack is the velocity of a sliding cart and the force on a sticking one, friction not subtracted yet. ``released`` is
    the direction in which a cart was just torn loose, else 0. All series have seven coefficients; the last two are zero if
    ``short``, which the compiler must know, so that nothing is computed for them.
    """
    fs = spring_force(x1 - x2, v1 - v2, None, 0, p)
    f0, g0 = force_1(x1, v1, 0.0, u, fs, 0.0, None, 0, p), force_2(x2, v2, 0.0, fs, 0.0, None, 0, p)
    s1 = _direction(v1, released_1, f0, hold_1(x1, 1.0 if f0 > 0.0 else -1.0, fs, 0.0, None, 0, p))
    s2 = _direction(v2, released_2, g0, hold_2(x2, 1.0 if g0 > 0.0 else -1.0, fs, 0.0, None, 0, p))
    level1, level2 = level_1(x1, v1, s1, fs, 0.0, None, 0, p), level_2(x2, v2, s2, fs, 0.0, None, 0, p)
    w1, w2 = (p[W1] * h if s1 != 0.0 else 0.0), (p[W2] * h if s2 != 0.0 else 0.0)
    a1, b1 = h * v1, w1 * (f0 - s1 * level1)
    c1, d1 = h * v2, w2 * (g0 - s2 * level2)
    f1, g1 = _forces(a1, b1, c1, d1, 0.0, p)
    a2, b2, c2, d2 = h * _HALF * b1, w1 * _HALF * f1, h * _HALF * d1, w2 * _HALF * g1
    f2, g2 = _forces(a2, b2, c2, d2, 0.0, p)
    a3, b3, c3, d3 = h * _THIRD * b2, w1 * _THIRD * f2, h * _THIRD * d2, w2 * _THIRD * g2
    f3, g3 = _forces(a3, b3, c3, d3, 0.0, p)
    a4, b4, c4, d4 = h * _QUARTER * b3, w1 * _QUARTER * f3, h * _QUARTER * d3, w2 * _QUARTER * g3
    f4, f5, g4, g5 = 0.0, 0.0, 0.0, 0.0
    a5, b5, c5, d5, a6, b6, c6, d6 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    if not short:
        f4, g4 = _forces(a4, b4, c4, d4, 0.0, p)
        a5, b5, c5, d5 = h * _FIFTH * b4, w1 * _FIFTH * f4, h * _FIFTH * d4, w2 * _FIFTH * g4
        f5, g5 = _forces(a5, b5, c5, d5, 0.0, p)
        a6, b6, c6, d6 = h * _SIXTH * b5, w1 * _SIXTH * f5, h * _SIXTH * d5, w2 * _SIXTH * g5
    m1, m2 = s1 != 0.0, s2 != 0.0
    return (
        (x1, a1, a2, a3, a4, a5, a6),
        (v1, b1, b2, b3, b4, b5, b6),
        (x2, c1, c2, c3, c4, c5, c6),
        (v2, d1, d2, d3, d4, d5, d6),
        (
            v1 if m1 else f0,
            b1 if m1 else f1,
            b2 if m1 else f2,
            b3 if m1 else f3,
            b4 if m1 else f4,
            b5 if m1 else f5,
            b6 if m1 else 0.0,
        ),
        (
            v2 if m2 else g0,
            d1 if m2 else g1,
            d2 if m2 else g2,
            d3 if m2 else g3,
            d4 if m2 else g4,
            d5 if m2 else g5,
            d6 if m2 else 0.0,
        ),
        s1,
        s2,
        level1,
        level2,
    )


@inlined
def total(c: Any) -> Any:
    """Return a series' value at its end."""
    return c[0] + (c[1] + (c[2] + (c[3] + (c[4] + (c[5] + c[6])))))


@inlined
def _value(c: Any, t: float) -> Any:
    return fused(t, fused(t, fused(t, fused(t, fused(t, fused(t, c[6], c[5]), c[4]), c[3]), c[2]), c[1]), c[0])


@inlined
def _slope(c: Any, t: float) -> Any:
    high = fused(t, fused(t, 6.0 * c[6], 5.0 * c[5]), 4.0 * c[4])
    return fused(t, fused(t, fused(t, high, 3.0 * c[3]), 2.0 * c[2]), c[1])


@inlined
def lasts(c: Any, s: float, level: float) -> Any:
    """Whether a cart surely keeps its mode: the slack's Bernstein coefficients are not negative.

    A term of third or higher order is at most its coefficient times τ², which is what the last Bernstein coefficient
    weighs. Round-off may leave a cart that was just released with a slack of -1e-17; that is none.
    """
    middle, last = c[0] + 0.5 * c[1], c[0] + c[1] + c[2]
    rest = abs(c[3]) + abs(c[4]) + abs(c[5]) + abs(c[6])
    middle = s * middle if s != 0.0 else level - abs(middle)
    last = s * last if s != 0.0 else level - abs(last)
    return (last >= rest) & (middle >= -1e-12 * last)


@inlined
def _slack(c: Any, s: float, level: float) -> Any:
    """Return the slack as a polynomial that is positive until the event, and to which side the cart would tear loose."""
    side = 1.0 if total(c) > 0.0 else -1.0
    f = s if s != 0.0 else -side
    start = 0.0 if s != 0.0 else level
    return (f * c[0] + start, f * c[1], f * c[2], f * c[3], f * c[4], f * c[5], f * c[6]), side


@inlined
def _once(q: Any) -> Any:
    """Whether a slack surely has exactly one root: opposite signs at both ends, and monotone or curved one way only."""
    r2, r3, r4, r5, r6 = abs(q[2]), abs(q[3]), abs(q[4]), abs(q[5]), abs(q[6])
    monotone = 2.0 * r2 + 3.0 * r3 + 4.0 * r4 + 5.0 * r5 + 6.0 * r6 <= abs(q[1])
    curved = 6.0 * r3 + 12.0 * r4 + 20.0 * r5 + 30.0 * r6 <= 2.0 * r2
    return (q[0] > 0.0) & (total(q) < 0.0) & (monotone | curved)


@inlined
def _guess(q: Any) -> Any:
    """Return the root of a slack's quadratic part."""
    return 2.0 * q[0] / (np.sqrt(max(q[1] * q[1] - 4.0 * q[0] * q[2], 0.0)) - q[1])


@inlined
def next_event(c1: Any, c2: Any, s1: float, s2: float, level1: float, level2: float) -> Any:
    """Return when the first cart's mode ends, which cart's, to which sides carts tear loose, and whether that is certain.

    The instants are :data:`_NEVER` for carts that keep their mode, or do so for longer than the other.
    """
    quiet_1, quiet_2 = lasts(c1, s1, level1), lasts(c2, s2, level2)
    q1, side_1 = _slack(c1, s1, level1)
    q2, side_2 = _slack(c2, s2, level2)
    # a sticking cart may not leave on the other side before
    alone_1 = _once(q1) & ((s1 != 0.0) | (level1 + side_1 * (c1[0] + 0.5 * c1[1]) >= 0.0))
    alone_2 = _once(q2) & ((s2 != 0.0) | (level2 + side_2 * (c2[0] + 0.5 * c2[1]) >= 0.0))
    t1 = _NEVER if quiet_1 else _guess(q1)
    t2 = _NEVER if quiet_2 else _guess(q2)
    first = t1 < t2
    q = (
        q1[0] if first else q2[0],
        q1[1] if first else q2[1],
        q1[2] if first else q2[2],
        q1[3] if first else q2[3],
        q1[4] if first else q2[4],
        q1[5] if first else q2[5],
        q1[6] if first else q2[6],
    )
    t = t1 if first else t2
    t -= _value(q, t) / _slope(q, t)
    t -= _value(q, t) / _slope(q, t)
    found = (abs(_value(q, t)) <= 1e-13 * (abs(q[0]) + abs(q[1]) + abs(q[2]))) & (t > 0.0) & (t <= 1.0)
    # both at about the same time: whichever is first is not for a guess to say
    apart = abs(t1 - t2) > 1e-2
    none = quiet_1 & quiet_2
    sure = none | ((quiet_1 | alone_1) & (quiet_2 | alone_2) & found & apart)
    return (t if first & ~none else _NEVER), (_NEVER if first | none else t), side_1, side_2, sure


@called
def search(
    c0: float, c1: float, c2: float, c3: float, c4: float, c5: float, c6: float, s: float, level: float, parts: int
) -> tuple[float, float]:
    """Return what :func:`next_event` does where it is uncertain, from the slack at ``parts`` instants."""
    c = (c0, c1, c2, c3, c4, c5, c6)
    before = 0.0
    for i in range(1, parts + 1):
        after = i / parts
        now = _value(c, after)
        side = 1.0 if now > 0.0 else -1.0
        f = s if s != 0.0 else -side
        q = (f * c0 + (0.0 if s != 0.0 else level), f * c1, f * c2, f * c3, f * c4, f * c5, f * c6)
        if _value(q, after) < 0.0:
            return _bracketed(q, before, after), side
        before = after
    return _NEVER, 0.0


@inlined
def _bracketed(q: Any, low: float, high: float) -> Any:
    """Return a root between a slack that is not negative and one that is: Newton's method, kept inside by bisection."""
    if _value(q, low) <= 0.0:
        return low
    t = 0.5 * (low + high)
    for _ in range(60):
        value, slope = _value(q, t), _slope(q, t)
        if value < 0.0:
            high = t
        else:
            low = t
        new = t - value / slope
        if not low < new < high:
            new = 0.5 * (low + high)
        if abs(new - t) < 1e-14:
            return new
        t = new
    return t


@inlined
def arrive(
    x1: Any, v1: Any, x2: Any, v2: Any, s1: float, s2: float, t1: float, t2: float, side_1: float, side_2: float
) -> tuple[float, float, float, float, float, float, float]:
    """Follow the series to the first event or the end: x1, v1, x2, v2, the share of time left, who was released where."""
    t = min(t1, t2, 1.0)
    now_1, now_2 = t1 <= t, t2 <= t
    return (
        _value(x1, t),
        0.0 if now_1 else _value(v1, t),
        _value(x2, t),
        0.0 if now_2 else _value(v2, t),
        1.0 - t,
        side_1 if now_1 & (s1 == 0.0) else 0.0,
        side_2 if now_2 & (s2 == 0.0) else 0.0,
    )
