r"""One smooth piece of a step: the directions of sliding fixed, nothing but Runge-Kutta, or its table for a linear drive.

The additional states of the effects are in a workspace ``z`` that begins with seven rows, each as long as there are such states:
state, stage, four slopes, trial; ``r`` is the start of the row to read. Its other entries are described in
:mod:`flexdrive_gym.drive.effects`. ``z is None`` selects, at compile time, the variant with the effects every drive has.
"""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.compilation import called, inlined, shifted
from flexdrive_gym.drive.effects import FLAG, LAYOUT, N_BASE_PARAMETERS, N_STATES, ON_CARTS
from flexdrive_gym.drive.forces import accelerations, begin_piece, rates, row
from flexdrive_gym.drive.simd.pack import raised

D1, D2 = LAYOUT["d1"].index, LAYOUT["d2"].index
# parts of the table of a drive that is linear between events: both carts slide, or one of them sticks; last, the step's length
SLIDING, STICKING_1, STICKING_2, TABLE = 0, 20, 40, 61
INTEGRATES = FLAG["rates", None]


@inlined
def width(z: Any) -> int:
    """Return how long a row of additional states is."""
    if z is None:
        return 0
    return N_STATES


@inlined
def _slopes(slope: int, x1: float, v1: float, x2: float, v2: float, u: float, t: float, z: Any, r: int, p: Any) -> None:
    if z is not None and raised(z, INTEGRATES):
        rates(slope * width(z) - r, x1, v1, x2, v2, u, t, z, r, p)


@inlined
def _stage(slope: int, h: float, z: Any) -> None:
    if z is not None and raised(z, INTEGRATES):
        n = width(z)
        for i in range(n):
            z[n + i] = z[i] + h * z[slope * n + i]


@inlined
def _smooth(
    x1: float,
    v1: float,
    x2: float,
    v2: float,
    s1: float,
    s2: float,
    u: float,
    t: float,
    h: float,
    z: Any,
    c: Any,
    p: Any,
) -> tuple[float, float, float, float, float, float]:
    half = 0.5 * h
    r, n = row(0), row(width(z))
    a1, b1 = accelerations(x1, v1, x2, v2, s1, s2, u, t, z, c, r, p)
    _slopes(2, x1, v1, x2, v2, u, t, z, r, p)

    v1b, v2b = v1 + half * a1, v2 + half * b1
    x1b, x2b = x1 + half * v1, x2 + half * v2
    _stage(2, half, z)
    a2, b2 = accelerations(x1b, v1b, x2b, v2b, s1, s2, u, t + half, z, c, n, p)
    _slopes(3, x1b, v1b, x2b, v2b, u, t + half, z, n, p)

    v1c, v2c = v1 + half * a2, v2 + half * b2
    x1c, x2c = x1 + half * v1b, x2 + half * v2b
    _stage(3, half, z)
    a3, b3 = accelerations(x1c, v1c, x2c, v2c, s1, s2, u, t + half, z, c, n, p)
    _slopes(4, x1c, v1c, x2c, v2c, u, t + half, z, n, p)

    v1d, v2d = v1 + h * a3, v2 + h * b3
    x1d, x2d = x1 + h * v1c, x2 + h * v2c
    _stage(4, h, z)
    a4, b4 = accelerations(x1d, v1d, x2d, v2d, s1, s2, u, t + h, z, c, n, p)
    _slopes(5, x1d, v1d, x2d, v2d, u, t + h, z, n, p)

    sixth = h / 6.0
    if z is not None and raised(z, INTEGRATES):
        for i in range(n):
            z[6 * n + i] = z[i] + sixth * (z[2 * n + i] + 2.0 * (z[3 * n + i] + z[4 * n + i]) + z[5 * n + i])
    return (
        x1 + sixth * (v1 + 2.0 * (v1b + v1c) + v1d),
        v1 + sixth * (a1 + 2.0 * (a2 + a3) + a4),
        x2 + sixth * (v2 + 2.0 * (v2b + v2c) + v2d),
        v2 + sixth * (b1 + 2.0 * (b2 + b3) + b4),
        a1,
        b1,
    )


@called
def _smooth_beyond(
    x1: float,
    v1: float,
    x2: float,
    v2: float,
    s1: float,
    s2: float,
    u: float,
    t: float,
    h: float,
    z: Any,
    c: Any,
    p: Any,
) -> tuple[float, float, float, float, float, float]:
    begin_piece(x1, x2, t, c)
    return _smooth(x1, v1, x2, v2, s1, s2, u, t, h, z, c, p)


@inlined
def smooth(
    x1: float,
    v1: float,
    x2: float,
    v2: float,
    s1: float,
    s2: float,
    u: float,
    t: float,
    h: float,
    z: Any,
    p: Any,
) -> tuple[float, float, float, float, float, float]:
    """Integrate one smooth piece by RK4; return x1, v1, x2, v2 and the accelerations at its start.

    Additional states are read from the first row of ``z`` and left in its last.
    """
    if z is None:
        return _smooth(x1, v1, x2, v2, s1, s2, u, t, h, None, None, p)
    if raised(z, ON_CARTS):
        return _smooth_beyond(x1, v1, x2, v2, s1, s2, u, t, h, None, z, p)
    return _smooth_beyond(x1, v1, x2, v2, s1, s2, u, t, h, z, z, p)


@called
def tabulate(h: float, table: Any, p: Any) -> None:
    """Tabulate what :func:`smooth` does over h to a drive with base effects only; write it to ``table``.

    Such a drive is linear between events, so the integrator's answer to unit vectors says everything: applying the table
    costs far less than integrating. The integrator itself fills the table, so there is still one physics. Where other effects
    act at events only, on the command or in the encoders, the table serves as well.

    For both sliding, cart 1 sticking, cart 2 sticking: rows of x1 - x1(0), v1, x2 - x2(0), v2 over columns δ, v1, v2,
    force on cart 1, force on cart 2; then h. Work space for a parameter vector follows.
    """
    for i in range(TABLE):
        table[i] = 0.0
    free = shifted(table, TABLE)
    for i in range(N_BASE_PARAMETERS):
        free[i] = p[i]
    free[D1], free[D2] = 0.0, 0.0
    for mode in range(3):
        s1, s2 = (0.0 if mode == 1 else 1.0), (0.0 if mode == 2 else 1.0)
        for column in range(5):
            x1 = 1.0 if column == 0 else 0.0
            v1 = 1.0 if column == 1 and mode != 1 else 0.0
            v2 = 1.0 if column == 2 and mode != 2 else 0.0
            u = 1.0 if column == 3 else 0.0
            # a force on cart 2 is friction of -1 V
            free[D2] = -1.0 if column == 4 else 0.0
            y1, w1, y2, w2, _a1, _a2 = smooth(x1, v1, 0.0, v2, s1, s2, u, 0.0, h, None, free)
            table[20 * mode + column] = y1 - x1
            table[20 * mode + 5 + column] = w1
            table[20 * mode + 10 + column] = y2
            table[20 * mode + 15 + column] = w2
    table[TABLE - 1] = h


@inlined
def leap(
    m: int, x1: float, v1: float, x2: float, v2: float, f1: float, f2: float, table: Any
) -> tuple[float, float, float, float]:
    """Apply the table that begins at m to a state and the forces besides spring and dampers [V]."""
    d = x1 - x2
    return (
        x1 + (table[m] * d + table[m + 1] * v1 + table[m + 2] * v2 + table[m + 3] * f1 + table[m + 4] * f2),
        table[m + 5] * d + table[m + 6] * v1 + table[m + 7] * v2 + table[m + 8] * f1 + table[m + 9] * f2,
        x2 + (table[m + 10] * d + table[m + 11] * v1 + table[m + 12] * v2 + table[m + 13] * f1 + table[m + 14] * f2),
        table[m + 15] * d + table[m + 16] * v1 + table[m + 17] * v2 + table[m + 18] * f1 + table[m + 19] * f2,
    )
