"""The forces on the carts, the limits of the command and the readings of the encoders: chains of every effect's hooks.

Each function composes what all effects say at one place. ``z is None`` selects, at compile time, the chain of the effects
every drive has; otherwise ``z`` points to the workspace and ``r`` is the start of the row of states to read. ``c`` is the same
for the chains of forces on the carts: with ``z is None`` these may be all that acts beyond the base.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from flexdrive_gym.drive.compilation import called, inlined
from flexdrive_gym.drive.effects import (
    ANCHOR_1,
    ANCHOR_2,
    BEGIN_1,
    BEGIN_2,
    BEGIN_T,
    FLAG,
    LAYOUT,
    LEVEL_1,
    LEVEL_2,
    PUSH_1,
    PUSH_2,
    RECOIL,
    chain,
)
from flexdrive_gym.drive.simd.pack import chosen, raised

W1, W2 = 0, 1
LIMIT = LAYOUT["saturation.limit"].index
_COMMANDS, _READS_1, _READS_2 = FLAG["command", None], FLAG["reading", "encoder_1"], FLAG["reading", "encoder_2"]
# a track that gives way: what one cart does says whether the other sticks
RECOILS = FLAG["track", None]

_command_base, _command_full = chain("command", base=True), chain("command", base=False)
_actuator = chain("actuator", base=False)
_transmission = chain("transmission", base=False)
_deflection = chain("deflection", base=False)
_spring_base, _spring_full = chain("spring", base=True), chain("spring", base=False)
_damping_1_base, _damping_1_full = chain("damping", "cart_1", base=True), chain("damping", "cart_1", base=False)
_damping_2_base, _damping_2_full = chain("damping", "cart_2", base=True), chain("damping", "cart_2", base=False)
_cart_1, _cart_2 = chain("cart", "cart_1", base=False), chain("cart", "cart_2", base=False)
_friction_1_base, _friction_1_full = chain("friction", "cart_1", base=True), chain("friction", "cart_1", base=False)
_friction_2_base, _friction_2_full = chain("friction", "cart_2", base=True), chain("friction", "cart_2", base=False)
_breakaway_1, _breakaway_2 = chain("breakaway", "cart_1", base=False), chain("breakaway", "cart_2", base=False)
_track, _rates = chain("track", base=False), chain("rates", base=False)
_finish_1, _finish_2 = chain("finish", "cart_1", base=False), chain("finish", "cart_2", base=False)
_finish_actuator = chain("finish", "actuator", base=False)
_begin_1, _begin_2 = chain("begin", "cart_1", base=False), chain("begin", "cart_2", base=False)
_begin_actuator = chain("begin", "actuator", base=False)
_begin_drivetrain = chain("begin", "drivetrain", base=False)
_begin_structure = chain("begin", "structure", base=False)
_reading_1_base, _reading_1_full = chain("reading", "encoder_1", base=True), chain("reading", "encoder_1", base=False)
_reading_2_base, _reading_2_full = chain("reading", "encoder_2", base=True), chain("reading", "encoder_2", base=False)
_speed_1, _speed_2 = chain("speed", "encoder_1", base=False), chain("speed", "encoder_2", base=False)


@inlined
def row(i: int) -> Any:
    """Return where a row of states begins as a plain integer: of a row written as 0 the compiler makes functions of its own."""
    return np.int64(i)


@inlined
def limited(u: float, p: Any) -> float:
    """Return the command as the amplifier's limit lets it through [V]; this is what a rig records."""
    return min(max(u, -p[LIMIT]), p[LIMIT])


@called
def _commanded_full(u: float, t: float, z: Any, p: Any) -> float:
    return _command_full(u, t, z, 0, p)


@inlined
def commanded(u: float, t: float, z: Any, p: Any) -> float:
    """Return the force that a command becomes on its way through the actuator, delays and lags apart [V]."""
    if z is None or not raised(z, _COMMANDS):
        return _command_base(u, t, z, 0, p)
    return _commanded_full(u, t, z, p)


@inlined
def amplified(u: float, t: float, z: Any, r: int, p: Any) -> float:
    """Return what the amplifier has made of the command at time t [V]."""
    if z is None:
        return u
    return _actuator(u, t - z[BEGIN_T], z, r, p)


@inlined
def spring_force(delta: float, rate: float, z: Any, r: int, p: Any) -> float:
    """Return the spring's force on cart 2 [V] for the deflection x1 - x2 and its rate."""
    if z is None:
        return _spring_base(0.0, delta, rate, z, r, p)
    felt = _deflection(delta, z, r, p)
    # within the play the spring is loose: it has neither stiffness nor damping
    loose = (felt == 0.0) & (delta != 0.0)
    return _spring_full(0.0, felt, chosen(loose, 0.0, rate), z, r, p)


@inlined
def force_1(x: float, v: float, s: float, u: float, fs: float, t: float, z: Any, c: Any, r: int, p: Any) -> float:
    """Return the force on cart 1 [V], all but Coulomb friction."""
    f = u - fs
    if z is not None:
        f = _transmission(amplified(u, t, z, r, p), v, z, r, p) - fs
    if c is not None:
        f = _cart_1(f + c[PUSH_1], x + c[ANCHOR_1], v, s, x - c[BEGIN_1], t, c, r, p)
    if z is None:
        return f - _damping_1_base(0.0, v, s, t, z, r, p) * v
    return f - max(_damping_1_full(0.0, v, s, t, z, r, p), 0.0) * v


@inlined
def force_2(x: float, v: float, s: float, fs: float, t: float, z: Any, c: Any, r: int, p: Any) -> float:
    """Return the force on cart 2 [V], all but Coulomb friction."""
    f = fs
    if c is not None:
        f = _cart_2(f + c[PUSH_2], x + c[ANCHOR_2], v, s, x - c[BEGIN_2], t, c, r, p)
    if z is None:
        return f - _damping_2_base(0.0, v, s, t, z, r, p) * v
    return f - max(_damping_2_full(0.0, v, s, t, z, r, p), 0.0) * v


@inlined
def level_1(x: float, v: float, s: float, fs: float, t: float, z: Any, c: Any, r: int, p: Any) -> float:
    """Return the Coulomb level of cart 1 [V] sliding in direction s."""
    own = 0.0
    if c is not None:
        own = c[LEVEL_1]
    if z is None:
        return _friction_1_base(own, x, v, s, fs, t, z, r, p)
    return max(_friction_1_full(own, x + z[ANCHOR_1], v, s, fs, t, z, r, p), 0.0)


@inlined
def level_2(x: float, v: float, s: float, fs: float, t: float, z: Any, c: Any, r: int, p: Any) -> float:
    """Return the Coulomb level of cart 2 [V] sliding in direction s."""
    own = 0.0
    if c is not None:
        own = c[LEVEL_2]
    if z is None:
        return _friction_2_base(own, x, v, s, fs, t, z, r, p)
    return max(_friction_2_full(own, x + z[ANCHOR_2], v, s, fs, t, z, r, p), 0.0)


@inlined
def hold_1(x: float, s: float, fs: float, t: float, z: Any, r: int, p: Any) -> float:
    """Return the force [V] that cart 1 at rest withstands in direction s."""
    level = level_1(x, 0.0, s, fs, t, z, z, r, p)
    if z is None:
        return level
    return _breakaway_1(level, x + z[ANCHOR_1], s, fs, t, z, r, p)


@inlined
def hold_2(x: float, s: float, fs: float, t: float, z: Any, r: int, p: Any) -> float:
    """Return the force [V] that cart 2 at rest withstands in direction s."""
    level = level_2(x, 0.0, s, fs, t, z, z, r, p)
    if z is None:
        return level
    return _breakaway_2(level, x + z[ANCHOR_2], s, fs, t, z, r, p)


@called
def _recoil(s1: float, s2: float, f1: float, f2: float, z: Any, r: int, p: Any) -> float:
    """Return the acceleration of the track [mm/s²] for fixed directions of sliding and the forces on the carts [V]."""
    sticking_2 = 0.0
    if p[W2] > 0.0:
        sticking_2 = 1.0 / p[W2]
    force = chosen(s1 != 0.0, f1, 0.0) + chosen((s2 != 0.0) & (p[W2] > 0.0), f2, 0.0)
    mass = chosen(s1 != 0.0, 0.0, 1.0 / p[W1]) + chosen(s2 != 0.0, 0.0, sticking_2)
    return _track(0.0, force, mass, z, r, p)


@inlined
def _margin_1(
    x1: float, x2: float, v2: float, s2: float, u: float, t: float, z: Any, r: int, p: Any
) -> tuple[float, float]:
    fs = spring_force(x1 - x2, -v2, z, r, p)
    force = force_1(x1, 0.0, 0.0, u, fs, t, z, z, r, p)
    if z is not None and raised(z, RECOILS):
        pull = force_2(x2, v2, s2, fs, t, z, z, r, p) - s2 * level_2(x2, v2, s2, fs, t, z, z, r, p)
        force = force - _recoil(0.0, s2, 0.0, pull, z, r, p) / p[W1]
    s = chosen(force > 0.0, 1.0, -1.0)
    return force * s - hold_1(x1, s, fs, t, z, r, p), s


@inlined
def _margin_2(
    x1: float, x2: float, v1: float, s1: float, u: float, t: float, z: Any, r: int, p: Any
) -> tuple[float, float]:
    fs = spring_force(x1 - x2, v1, z, r, p)
    force = force_2(x2, 0.0, 0.0, fs, t, z, z, r, p)
    if z is not None and p[W2] > 0.0 and raised(z, RECOILS):
        push = force_1(x1, v1, s1, u, fs, t, z, z, r, p) - s1 * level_1(x1, v1, s1, fs, t, z, z, r, p)
        force = force - _recoil(s1, 0.0, push, 0.0, z, r, p) / p[W2]
    s = chosen(force > 0.0, 1.0, -1.0)
    return force * s - hold_2(x2, s, fs, t, z, r, p), s


@called
def _margin_1_full(
    x1: float, x2: float, v2: float, s2: float, u: float, t: float, z: Any, r: Any, p: Any
) -> tuple[float, float]:
    return _margin_1(x1, x2, v2, s2, u, t, z, r, p)


@called
def _margin_2_full(
    x1: float, x2: float, v1: float, s1: float, u: float, t: float, z: Any, r: Any, p: Any
) -> tuple[float, float]:
    return _margin_2(x1, x2, v1, s1, u, t, z, r, p)


@inlined
def margin_1(
    x1: float, x2: float, v2: float, s2: float, u: float, t: float, z: Any, r: int, p: Any
) -> tuple[float, float]:
    """Return by how much the force on cart 1 at rest leaves the friction set [V], negative while held, and its sign.

    Cart 2 slides in direction s2, or sticks.
    """
    if z is None:
        return _margin_1(x1, x2, v2, s2, u, t, z, r, p)
    return _margin_1_full(x1, x2, v2, s2, u, t, z, row(r), p)


@inlined
def margin_2(
    x1: float, x2: float, v1: float, s1: float, u: float, t: float, z: Any, r: int, p: Any
) -> tuple[float, float]:
    """Return by how much the force on cart 2 at rest leaves the friction set [V], negative while held, and its sign.

    Cart 1 slides in direction s1, or sticks.
    """
    if z is None:
        return _margin_2(x1, x2, v1, s1, u, t, z, r, p)
    return _margin_2_full(x1, x2, v1, s1, u, t, z, row(r), p)


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
    c: Any,
    r: int,
    p: Any,
) -> tuple[float, float]:
    """Return the accelerations [mm/s²] of both carts for fixed directions of sliding."""
    fs = spring_force(x1 - x2, v1 - v2, z, r, p)
    f1 = force_1(x1, v1, s1, u, fs, t, z, c, r, p) - s1 * level_1(x1, v1, s1, fs, t, z, c, r, p)
    f2 = force_2(x2, v2, s2, fs, t, z, c, r, p) - s2 * level_2(x2, v2, s2, fs, t, z, c, r, p)
    a1, a2 = p[W1] * f1, p[W2] * f2
    if z is not None and raised(z, RECOILS):
        a = _recoil(s1, s2, f1, f2, z, r, p)
        z[RECOIL] = a
        a1 = a1 - a
        if p[W2] > 0.0:
            a2 = a2 - a
    return chosen(s1 != 0.0, a1, 0.0), chosen(s2 != 0.0, a2, 0.0)


@called
def rates(w: int, x1: float, v1: float, x2: float, v2: float, u: float, t: float, z: Any, r: int, p: Any) -> None:
    """Write the rates of the additional states of the row that begins at r, w entries further on.

    The acceleration of the track is that of the last call of :func:`accelerations`.
    """
    _rates(w, x1, v1, x2, v2, amplified(u, t, z, r, p), z[RECOIL], t, z, r, p)


@called
def begin_effects(v1: float, v2: float, u: float, z: Any, p: Any) -> None:
    """Write what the effects remember when a run starts at these velocities and this force [V]."""
    _begin_1(0, v1, v1, v2, u, z, 0, p)
    _begin_2(0, v2, v1, v2, u, z, 0, p)
    _begin_actuator(0, 0.0, v1, v2, u, z, 0, p)
    _begin_drivetrain(0, 0.0, v1, v2, u, z, 0, p)
    _begin_structure(0, 0.0, v1, v2, u, z, 0, p)


@inlined
def begin_piece(x1: float, x2: float, t: float, z: Any) -> None:
    """Note where and when the piece begins that is integrated next."""
    z[BEGIN_1], z[BEGIN_2], z[BEGIN_T] = x1, x2, t


@called
def finish_piece(x1: float, x2: float, s1: float, s2: float, u: float, t: float, z: Any, p: Any) -> None:
    """Bring what the effects remember to the end of a piece that went to these positions, with these directions."""
    dt = t - z[BEGIN_T]
    _finish_actuator(0, 0.0, 0.0, u, dt, z, 0, p)
    _finish_1(0, x1 - z[BEGIN_1], s1, u, dt, z, 0, p)
    _finish_2(0, x2 - z[BEGIN_2], s2, u, dt, z, 0, p)


@called
def _readings_full(
    x1: float, v1: float, x2: float, v2: float, t: float, h: float, z: Any, p: Any
) -> tuple[float, float]:
    return (
        _reading_1_full(x1, x1 + z[ANCHOR_1], v1, t, h, z, 0, p),
        _reading_2_full(x2, x2 + z[ANCHOR_2], v2, t, h, z, 0, p),
    )


@inlined
def readings(x1: float, v1: float, x2: float, v2: float, t: float, h: float, z: Any, p: Any) -> tuple[float, float]:
    """Return the positions that the encoders report [mm], sampled every h."""
    if z is None or not (raised(z, _READS_1) or raised(z, _READS_2)):
        return _reading_1_base(x1, x1, v1, t, h, z, 0, p), _reading_2_base(x2, x2, v2, t, h, z, 0, p)
    return _readings_full(x1, v1, x2, v2, t, h, z, p)


@inlined
def rate_1(raw: float, z: Any, p: Any) -> float:
    """Return the rate of encoder 1 as it is counted [mm/s]."""
    if z is None:
        return raw
    return _speed_1(raw, z, 0, p)


@inlined
def rate_2(raw: float, z: Any, p: Any) -> float:
    """Return the rate of encoder 2 as it is counted [mm/s]."""
    if z is None:
        return raw
    return _speed_2(raw, z, 0, p)
