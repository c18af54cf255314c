r"""Drives with base effects only, from event to event by power series; the step of a batch of drives.

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

from math import copysign
from typing import Any

import numpy as np

from flexdrive_gym.drive.compilation import called, fused, inlined
from flexdrive_gym.drive.forces import (
    W1,
    W2,
    force_1,
    force_2,
    level_1,
    level_2,
    spring_force,
)

# the largest product of a leap's length and the drive's rate for which the series' remainder stays below 1e-8
REACH = 0.25
# the same for series that end with τ⁴, as a Runge-Kutta step does
SHORT_REACH = 0.05
_NEVER = 2.0
_PER_2, _PER_6, _PER_24, _PER_120, _PER_720 = 1.0 / 2.0, 1.0 / 6.0, 1.0 / 24.0, 1.0 / 120.0, 1.0 / 720.0


@called
def respond(h: float, p: Any, out: Any, stride: int) -> None:
    """Write what a unit of everything does to the velocities within h: nine numbers, ``stride`` entries apart.

    To v1: v1, v2, x1 - x2, u, friction; to v2: v1, v2, x1 - x2, friction. The forces are linear, so this says all.
    """
    w1, w2 = p[W1] * h, p[W2] * h
    by_v1, by_v2 = spring_force(0.0, 1.0, None, 0, p), spring_force(0.0, -1.0, None, 0, p)
    by_x = spring_force(1.0, 0.0, None, 0, p)
    out[0] = w1 * force_1(0.0, 1.0, 0.0, 0.0, by_v1, 0.0, None, None, 0, p)
    out[stride] = w1 * force_1(0.0, 0.0, 0.0, 0.0, by_v2, 0.0, None, None, 0, p)
    out[2 * stride] = w1 * force_1(0.0, 0.0, 0.0, 0.0, by_x, 0.0, None, None, 0, p)
    out[3 * stride] = w1 * force_1(0.0, 0.0, 0.0, 1.0, 0.0, 0.0, None, None, 0, p)
    out[4 * stride] = w1 * level_1(0.0, 0.0, 0.0, 0.0, 0.0, None, None, 0, p)
    out[5 * stride] = w2 * force_2(0.0, 0.0, 0.0, by_v1, 0.0, None, None, 0, p)
    out[6 * stride] = w2 * force_2(0.0, 1.0, 0.0, by_v2, 0.0, None, None, 0, p)
    out[7 * stride] = w2 * force_2(0.0, 0.0, 0.0, by_x, 0.0, None, None, 0, p)
    out[8 * stride] = w2 * level_2(0.0, 0.0, 0.0, 0.0, 0.0, None, None, 0, p)


@inlined
def _mode(v: float, released: float, force: float, hold: float) -> Any:
    """Return whether a cart slides from now on, in which direction (0 if it sticks), and what friction leaves of the force."""
    towards = v if v != 0.0 else (released if released != 0.0 else force)
    loose = (v != 0.0) | (released != 0.0) | (abs(force) > hold)
    return loose, (copysign(1.0, towards) if loose else 0.0), (force - copysign(hold, towards) if loose else 0.0)


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
    share: float,
    responses: Any,
    short: bool,
) -> Any:
    r"""Return the motion over a share of h: derivatives of v1 and v2, then slack, direction and friction of either cart.

    Derivatives are by :math:`\tau`. A slack is a power series of seven coefficients: the velocity of a sliding cart, and
    the force on a sticking one, as the change of velocity it would make, friction not subtracted yet. ``released`` is the
    direction in which a cart was just torn loose, else 0; ``responses`` are those of :func:`respond`. The last two
    derivatives and coefficients are zero if ``short``, which the compiler must know, so that nothing is computed for them.
    """
    c11, c12, k1, cu, level1, c21, c22, k2, level2 = responses
    c11, c12, k1, cu, level1 = c11 * share, c12 * share, k1 * share, cu * share, level1 * share
    c21, c22, k2, level2 = c21 * share, c22 * share, k2 * share, level2 * share
    x, r = x1 - x2, v1 - v2
    f0 = fused(c11, v1, c12 * v2) + fused(cu, u, k1 * x)
    g0 = fused(c22, v2, c21 * v1) + k2 * x
    m1, s1, b1 = _mode(v1, released_1, f0, level1)
    m2, s2, d1 = _mode(v2, released_2, g0, level2)
    # the deflection's derivatives are those of its rate r
    k1, k2 = k1 * (h * share), k2 * (h * share)
    f1, g1 = fused(c11, b1, fused(c12, d1, k1 * r)), fused(c22, d1, fused(c21, b1, k2 * r))
    b2, d2, r = (f1 if m1 else 0.0), (g1 if m2 else 0.0), b1 - d1
    f2, g2 = fused(c11, b2, fused(c12, d2, k1 * r)), fused(c22, d2, fused(c21, b2, k2 * r))
    b3, d3, r = (f2 if m1 else 0.0), (g2 if m2 else 0.0), b2 - d2
    f3, g3 = fused(c11, b3, fused(c12, d3, k1 * r)), fused(c22, d3, fused(c21, b3, k2 * r))
    b4, d4, r = (f3 if m1 else 0.0), (g3 if m2 else 0.0), b3 - d3
    # the zero that adding leaves alone, so that the compiler drops the addition
    f4, f5, g4, g5, b5, d5, b6, d6 = -0.0, -0.0, -0.0, -0.0, -0.0, -0.0, -0.0, -0.0
    if not short:
        f4, g4 = fused(c11, b4, fused(c12, d4, k1 * r)), fused(c22, d4, fused(c21, b4, k2 * r))
        b5, d5, r = (f4 if m1 else 0.0), (g4 if m2 else 0.0), b4 - d4
        f5, g5 = fused(c11, b5, fused(c12, d5, k1 * r)), fused(c22, d5, fused(c21, b5, k2 * r))
        b6, d6 = (f5 if m1 else 0.0), (g5 if m2 else 0.0)
    return (
        (v1, b1, b2, b3, b4, b5),
        (v2, d1, d2, d3, d4, d5),
        (
            v1 if m1 else f0,
            b1 if m1 else f1,
            _PER_2 * (b2 if m1 else f2),
            _PER_6 * (b3 if m1 else f3),
            _PER_24 * (b4 if m1 else f4),
            _PER_120 * (b5 if m1 else f5),
            _PER_720 * (b6 if m1 else -0.0),
        ),
        (
            v2 if m2 else g0,
            d1 if m2 else g1,
            _PER_2 * (d2 if m2 else g2),
            _PER_6 * (d3 if m2 else g3),
            _PER_24 * (d4 if m2 else g4),
            _PER_120 * (d5 if m2 else g5),
            _PER_720 * (d6 if m2 else -0.0),
        ),
        s1,
        s2,
        level1,
        level2,
    )


@inlined
def travelled(x: float, v: Any, h: float, short: bool) -> Any:
    """Return the position after h, from that at the start and the derivatives of the velocity, to the same order."""
    y = x
    if not short:
        y = fused(h * _PER_120, v[4], fused(h * _PER_720, v[5], x))
    return fused(h, v[0], fused(h * _PER_2, v[1], fused(h * _PER_6, v[2], fused(h * _PER_24, v[3], y))))


@inlined
def path(x: float, v: Any, h: float) -> Any:
    """Return the position as a power series, from its start and the derivatives of the velocity."""
    return (
        x,
        h * v[0],
        h * _PER_2 * v[1],
        h * _PER_6 * v[2],
        h * _PER_24 * v[3],
        h * _PER_120 * v[4],
        h * _PER_720 * v[5],
    )


@inlined
def total(c: Any) -> Any:
    """Return a series' value at its end."""
    return ((c[0] + c[1]) + c[2]) + (c[3] + (c[4] + (c[5] + c[6])))


@inlined
def _value(c: Any, t: float, short: bool) -> Any:
    high = c[4] if short else fused(t, fused(t, c[6], c[5]), c[4])
    return fused(t, fused(t, fused(t, fused(t, high, c[3]), c[2]), c[1]), c[0])


@inlined
def _slope(c: Any, t: float, short: bool) -> Any:
    high = 4.0 * c[4] if short else fused(t, fused(t, 6.0 * c[6], 5.0 * c[5]), 4.0 * c[4])
    return fused(t, fused(t, fused(t, high, 3.0 * c[3]), 2.0 * c[2]), c[1])


@inlined
def lasts(c: Any, s: float, level: float) -> Any:
    """Whether a cart surely keeps its mode: the slack's Bernstein coefficients are not negative.

    A term of third or higher order is at most its coefficient times τ², which is what the last Bernstein coefficient
    weighs. Round-off may leave a cart that was just released with a slack of -1e-17; that is none.
    """
    middle, last = fused(0.5, c[1], c[0]), (c[0] + c[1]) + c[2]
    rest = abs(c[3]) + abs(c[4]) + abs(c[5]) + abs(c[6])
    middle = s * middle if s != 0.0 else level - abs(middle)
    last = s * last if s != 0.0 else level - abs(last)
    return (last >= rest) & (middle >= -1e-12 * last)


@inlined
def lasts_surely(c: Any, s: float, level: float) -> Any:
    """Whether a cart keeps its mode, by a quicker test than :func:`lasts` that gives up a little sooner.

    The middle Bernstein coefficient is the mean of the outer two, less half of c[2], and the first is never negative: if the
    last exceeds abs(c[2]), none is.
    """
    last = (c[0] + c[1]) + c[2]
    rest = abs(c[2]) + abs(c[3]) + abs(c[4]) + abs(c[5]) + abs(c[6])
    return (s * last if s != 0.0 else level - abs(last)) >= rest


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
def next_event(c1: Any, c2: Any, s1: float, s2: float, level1: float, level2: float, short: bool) -> Any:
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
    t -= _value(q, t, short) / _slope(q, t, short)
    t -= _value(q, t, short) / _slope(q, t, short)
    found = (abs(_value(q, t, short)) <= 1e-13 * (abs(q[0]) + abs(q[1]) + abs(q[2]))) & (t > 0.0) & (t <= 1.0)
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
        now = _value(c, after, False)
        side = 1.0 if now > 0.0 else -1.0
        f = s if s != 0.0 else -side
        q = (f * c0 + (0.0 if s != 0.0 else level), f * c1, f * c2, f * c3, f * c4, f * c5, f * c6)
        if _value(q, after, False) < 0.0:
            return _bracketed(q, before, after), side
        before = after
    return _NEVER, 0.0


@inlined
def _bracketed(q: Any, low: float, high: float) -> Any:
    """Return a root between a slack that is not negative and one that is: Newton's method, kept inside by bisection."""
    if _value(q, low, False) <= 0.0:
        return low
    t = 0.5 * (low + high)
    for _ in range(60):
        value, slope = _value(q, t, False), _slope(q, t, False)
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
    x1: Any,
    c1: Any,
    x2: Any,
    c2: Any,
    s1: float,
    s2: float,
    t1: float,
    t2: float,
    side_1: float,
    side_2: float,
    short: bool,
) -> tuple[float, float, float, float, float, float, float]:
    """Follow the series to the first event or the end: x1, v1, x2, v2, the share of time left, who was released where.

    ``c1`` and ``c2`` are the slacks, which are the velocities of sliding carts.
    """
    t = min(t1, t2, 1.0)
    now_1, now_2 = t1 <= t, t2 <= t
    return (
        _value(x1, t, short),
        0.0 if now_1 | (s1 == 0.0) else _value(c1, t, short),
        _value(x2, t, short),
        0.0 if now_2 | (s2 == 0.0) else _value(c2, t, short),
        1.0 - t,
        side_1 if now_1 & (s1 == 0.0) else 0.0,
        side_2 if now_2 & (s2 == 0.0) else 0.0,
    )
