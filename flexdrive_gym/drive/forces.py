"""The forces on the carts, the limits of the command and the readings of the encoders: chains of every effect's hooks.

Each function composes what all effects say at one place. ``z is None`` selects, at compile time, the chain of the effects
every drive has; otherwise ``z`` points to the additional states and ``r`` is the start of the row to read.
"""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.compilation import inlined
from flexdrive_gym.drive.effects import LAYOUT, chain

W1, W2 = 0, 1
LIMIT = LAYOUT["saturation.limit"].index

_command_base, _command_full = chain("command", base=True), chain("command", base=False)
_spring_base, _spring_full = chain("spring", base=True), chain("spring", base=False)
_cart_1_base, _cart_1_full = chain("cart", "cart_1", base=True), chain("cart", "cart_1", base=False)
_cart_2_base, _cart_2_full = chain("cart", "cart_2", base=True), chain("cart", "cart_2", base=False)
_friction_1_base, _friction_1_full = (
    chain("friction", "cart_1", base=True),
    chain("friction", "cart_1", base=False),
)
_friction_2_base, _friction_2_full = (
    chain("friction", "cart_2", base=True),
    chain("friction", "cart_2", base=False),
)
_breakaway_1 = chain("breakaway", "cart_1", base=False)
_breakaway_2 = chain("breakaway", "cart_2", base=False)
rates = chain("rates", base=False)
_reading_1_base, _reading_1_full = (
    chain("reading", "encoder_1", base=True),
    chain("reading", "encoder_1", base=False),
)
_reading_2_base, _reading_2_full = (
    chain("reading", "encoder_2", base=True),
    chain("reading", "encoder_2", base=False),
)


@inlined
def limited(u: float, p: Any) -> float:
    """Return the command as the amplifier's limit lets it through [V]; this is what a rig records."""
    return min(max(u, -p[LIMIT]), p[LIMIT])


@inlined
def commanded(u: float, t: float, z: Any, p: Any) -> float:
    """Return the force that a command becomes on its way through the actuator, delays apart [V]."""
    if z is None:
        return _command_base(u, t, z, 0, p)
    return _command_full(u, t, z, 0, p)


@inlined
def spring_force(delta: float, rate: float, z: Any, r: int, p: Any) -> float:
    """Return the spring's force on cart 2 [V] for the deflection x1 - x2 and its rate."""
    if z is None:
        return _spring_base(0.0, delta, rate, z, r, p)
    return _spring_full(0.0, delta, rate, z, r, p)


@inlined
def force_1(x: float, v: float, u: float, fs: float, t: float, z: Any, r: int, p: Any) -> float:
    """Return the force on cart 1 [V], all but Coulomb friction."""
    if z is None:
        return _cart_1_base(u - fs, x, v, fs, t, z, r, p)
    return _cart_1_full(u - fs, x, v, fs, t, z, r, p)


@inlined
def force_2(x: float, v: float, fs: float, t: float, z: Any, r: int, p: Any) -> float:
    """Return the force on cart 2 [V], all but Coulomb friction."""
    if z is None:
        return _cart_2_base(fs, x, v, fs, t, z, r, p)
    return _cart_2_full(fs, x, v, fs, t, z, r, p)


@inlined
def level_1(x: float, v: float, s: float, fs: float, t: float, z: Any, r: int, p: Any) -> float:
    """Return the Coulomb level of cart 1 [V] sliding in direction s."""
    if z is None:
        return _friction_1_base(0.0, x, v, s, fs, t, z, r, p)
    return _friction_1_full(0.0, x, v, s, fs, t, z, r, p)


@inlined
def level_2(x: float, v: float, s: float, fs: float, t: float, z: Any, r: int, p: Any) -> float:
    """Return the Coulomb level of cart 2 [V] sliding in direction s."""
    if z is None:
        return _friction_2_base(0.0, x, v, s, fs, t, z, r, p)
    return _friction_2_full(0.0, x, v, s, fs, t, z, r, p)


@inlined
def hold_1(x: float, s: float, fs: float, t: float, z: Any, r: int, p: Any) -> float:
    """Return the force [V] that cart 1 at rest withstands in direction s."""
    level = level_1(x, 0.0, s, fs, t, z, r, p)
    if z is None:
        return level
    return _breakaway_1(level, x, s, fs, t, z, r, p)


@inlined
def hold_2(x: float, s: float, fs: float, t: float, z: Any, r: int, p: Any) -> float:
    """Return the force [V] that cart 2 at rest withstands in direction s."""
    level = level_2(x, 0.0, s, fs, t, z, r, p)
    if z is None:
        return level
    return _breakaway_2(level, x, s, fs, t, z, r, p)


@inlined
def margin_1(x1: float, x2: float, v2: float, u: float, t: float, z: Any, r: int, p: Any) -> tuple[float, float]:
    """Return by how much the force on cart 1 at rest leaves the friction set [V], negative while held, and its sign."""
    fs = spring_force(x1 - x2, -v2, z, r, p)
    force = force_1(x1, 0.0, u, fs, t, z, r, p)
    s = 1.0 if force > 0.0 else -1.0
    return force * s - hold_1(x1, s, fs, t, z, r, p), s


@inlined
def margin_2(x1: float, x2: float, v1: float, t: float, z: Any, r: int, p: Any) -> tuple[float, float]:
    """Return by how much the force on cart 2 at rest leaves the friction set [V], negative while held, and its sign."""
    fs = spring_force(x1 - x2, v1, z, r, p)
    force = force_2(x2, 0.0, fs, t, z, r, p)
    s = 1.0 if force > 0.0 else -1.0
    return force * s - hold_2(x2, s, fs, t, z, r, p), s


@inlined
def accelerations(
    x1: float,
    v1: float,
    x2: float,
    v2: float,
    s1: float,
    s2: float,
    u: float,
    t: float,
    z: Any,
    r: int,
    p: Any,
) -> tuple[float, float]:
    """Return the accelerations [mm/s²] of both carts for fixed directions of sliding."""
    fs = spring_force(x1 - x2, v1 - v2, z, r, p)
    a1 = p[W1] * (force_1(x1, v1, u, fs, t, z, r, p) - s1 * level_1(x1, v1, s1, fs, t, z, r, p))
    a2 = p[W2] * (force_2(x2, v2, fs, t, z, r, p) - s2 * level_2(x2, v2, s2, fs, t, z, r, p))
    return (a1 if s1 != 0.0 else 0.0), (a2 if s2 != 0.0 else 0.0)


@inlined
def readings(x1: float, x2: float, t: float, z: Any, p: Any) -> tuple[float, float]:
    """Return the positions that the encoders report [mm]."""
    if z is None:
        return _reading_1_base(x1, t, z, 0, p), _reading_2_base(x2, t, z, 0, p)
    return _reading_1_full(x1, t, z, 0, p), _reading_2_full(x2, t, z, 0, p)
