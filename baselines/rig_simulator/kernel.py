r"""The compiled kernel of the blind rig, and the names of the numbers it reads.

Velocities are advanced before positions (semi-implicit Euler) at 20 µs, three orders below the drive's fastest time
constant. Dry friction is set-valued: a resting cart stays at rest while the other forces lie within its static level, a
moving cart that would reverse within a step is stopped first (D. Karnopp, J. Dyn. Sys. Meas. Control 107, 1985). What
depends on time alone or on place alone comes as tables: force, friction and gain over time, friction and force along the
track. So a random nuisance and a deterministic effect use one road.

Names and kernel share a file because the compiler's cache watches the kernel's file only.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numba
import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

_CART_NUMBERS = {
    "m": 0.0,  # mass [V s²/mm]
    "b": 0.0,  # viscous friction [V s/mm]
    "d": 0.0,  # Coulomb level [V]
    "hump": 0.0,  # Lorentzian Stribeck hump over the Coulomb level [-]
    "vs": 10.0,  # its half-width [mm/s]
    "static": 0.0,  # static over kinetic level, at rest only [-]
    "bristle": 0.0,  # LuGre bristle stiffness [V/mm]; 0: rigid contact
    "d_skew": 0.0,  # level (1 ± d_skew) in the two directions [-]
    "b_skew": 0.0,  # viscous friction (1 ± b_skew), blended over a few mm/s [-]
    "drag": 0.0,  # drag·v·sqrt(v² + 15²) [V s²/mm²]
    "load": 0.0,  # friction per spring force [-]
    "cube": 0.0,  # brake cube·v³, outside the catalogue [V s³/mm³]
    "young": 0.0,  # extra level after a reversal [-], outside the catalogue
    "age": 0.2,  # its decay time [s]
    "scale": 0.0,  # encoder reads (1 + scale)·x [-]
    "late": 0.0,  # encoder delay [s]
    "play": 0.0,  # encoder reading lags by ±play [mm]
    "wobble": 0.0,  # eccentric wheel: amplitude of the reading's ripple [mm]
    "wheel": 60.0,  # its circumference [mm]
    "turn": 0.0,  # its phase [rad]
}

_DRIVE_NUMBERS = {
    "k": 0.1,  # spring [V/mm]
    "bend": 0.0,  # 1/width of sinh (>0) or tanh (<0) hardening [1/mm]
    "k_skew": 0.0,  # stiffness (1 ± k_skew) pulled or pushed [-]
    "k_soft": 4.0,  # blending width of that [mm]
    "gap": 0.0,  # coupling free for abs(δ) < gap [mm]
    "bind_at": 1e9,  # coils touch beyond this δ [mm]
    "bind_k": 0.0,  # stiffness of touching coils, a Hertz-like contact [V/mm^1.5]
    "damper": 0.0,  # spring damping, a Maxwell element of 1 ms [V s/mm]
    "slip_k": 0.0,  # Iwan stack: stiffness [V/mm]
    "slip_at": 1.0,  # and the deflection at which its last element slips [mm]
    "offset": 0.0,  # added to the command [V]
    "notch": 0.0,  # dead zone of the command [V]
    "ceiling": 1e9,  # soft ceiling of the command [V]
    "sharp": 6.0,  # its sharpness [-]
    "wait": 0.0,  # delay of the command [s]
    "lag": 0.0,  # amplifier time constant [s]
    "gain_skew": 0.0,  # gain (1 ± gain_skew) [-]
    "slew": 1e9,  # slew limit [V/s], outside the catalogue
    "rotor": 0.0,  # share of m1 that is the motor, behind a gap or a belt [-]
    "lash": 0.0,  # half gap between motor and cart 1 [mm]
    "belt": 0.0,  # belt slips beyond this force [V], outside the catalogue; 0: gears
    "tail_m": 0.0,  # appendage: mass [V s²/mm]
    "tail_k": 0.0,  # stiffness [V/mm]
    "tail_b": 0.0,  # damping [V s/mm]
    "tail_on": 2.0,  # the cart it hangs on
    "push_friction": 0.0,  # level of cart 1 per volt of command [-], outside the catalogue
    "mutual": 0.0,  # force on a cart per acceleration of the other [V s²/mm], outside the catalogue
}

NULLS: Mapping[str, float] = MappingProxyType(
    {f"{name}{cart}": null for cart in (1, 2) for name, null in _CART_NUMBERS.items()} | _DRIVE_NUMBERS
)
INDEX: Mapping[str, int] = MappingProxyType({name: i for i, name in enumerate(NULLS)})
CART = len(_CART_NUMBERS)
OFFSET: Mapping[str, int] = MappingProxyType({name: i for i, name in enumerate(_CART_NUMBERS)})

SAMPLE_S = 1e-3
COUNT_MM = 0.0046592
LIMIT_V = 8.0
STEPS = 50  # fine steps per sample
TRACK_STEP_MM = 0.05
TRACK_HALF_MM = 1000.0
TRACK_POINTS = round(2 * TRACK_HALF_MM / TRACK_STEP_MM) + 1
# rows of the tables over time
FRICTION_1, FRICTION_2, VISCOUS_1, VISCOUS_2, FORCE_1, FORCE_2, GAIN = range(7)
# rows of the tables along the track: friction (relative) and force [V] on each cart
ROUGH_1, ROUGH_2, HILL_1, HILL_2 = range(4)
LAW_HEAD = 3  # a controller's limit [V], friction level [V] and its threshold [mm/s], then its matrices

SLIDERS = 8
RING = 1024  # fine steps an encoder can look back, 20 ms
REMEMBERED = 21  # numbers of the motion that a run remembers, then zero and phase of both encoders

# numba reads module constants, not mappings
(_M, _B, _D, _HUMP, _VS, _STATIC, _BRISTLE, _D_SKEW, _B_SKEW, _DRAG, _LOAD, _CUBE, _YOUNG, _AGE) = (
    OFFSET[n]
    for n in "m b d hump vs static bristle d_skew b_skew drag load cube young age".split()  # noqa: SIM905
)
(_SCALE, _LATE, _PLAY, _WOBBLE, _WHEEL, _TURN) = (
    OFFSET[n] for n in ("scale", "late", "play", "wobble", "wheel", "turn")
)
(_K, _BEND, _K_SKEW, _K_SOFT, _GAP, _BIND_AT, _BIND_K, _DAMPER, _SLIP_K, _SLIP_AT) = (
    INDEX[n]
    for n in "k bend k_skew k_soft gap bind_at bind_k damper slip_k slip_at".split()  # noqa: SIM905
)
(_NOTCH, _CEILING, _SHARP, _WAIT, _LAG, _GAIN_SKEW, _SLEW, _ROTOR, _LASH, _BELT) = (
    INDEX[n]
    for n in "notch ceiling sharp wait lag gain_skew slew rotor lash belt".split()  # noqa: SIM905
)
(_TAIL_M, _TAIL_K, _TAIL_B, _TAIL_ON, _PUSH, _MUTUAL, _OFFSET) = (
    INDEX[n] for n in ("tail_m", "tail_k", "tail_b", "tail_on", "push_friction", "mutual", "offset")
)


def compiled(function: Any) -> Any:
    """Compile a kernel; the cache is numba's own, beside the file."""
    return numba.njit(cache=True, fastmath=False, error_model="numpy")(function)


@compiled
def _along(table: FloatArray, row: int, x: float) -> float:
    """Read a table along the track at x."""
    place = (x + TRACK_HALF_MM) / TRACK_STEP_MM
    place = min(max(place, 0.0), TRACK_POINTS - 1.001)
    i = int(place)
    return float(table[row, i] + (place - i) * (table[row, i + 1] - table[row, i]))


@compiled
def _shaped(u: float, p: FloatArray) -> float:
    """Return what the amplifier makes of a command: smooth-edged dead zone, soft ceiling, two gains."""
    if p[_NOTCH] > 0.0:
        r = abs(u) / p[_NOTCH]
        u -= u / (1.0 + r**6.0) ** (1.0 / 6.0)
    if p[_CEILING] < 1e6:
        u /= (1.0 + (abs(u) / p[_CEILING]) ** p[_SHARP]) ** (1.0 / p[_SHARP])
    return u * (1.0 + p[_GAIN_SKEW] * math.tanh(10.0 * u))


@compiled
def _elastic(delta: float, rate: float, p: FloatArray) -> float:
    """Return the force of the coupling's springs [V]."""
    k = p[_K]
    if p[_GAP] > 0.0:
        # Hunt-Crossley contact: a loss that grows with the penetration, never a pull
        depth = abs(delta) - p[_GAP]
        if depth <= 0.0:
            return 0.0
        side = math.copysign(1.0, delta)
        return side * k * depth * max(0.0, 1.0 + 2e-4 * side * rate)
    force = k * delta
    w = p[_BEND]
    if w > 0.0:
        force = k * math.sinh(w * delta) / w
    elif w < 0.0:
        force = k * math.tanh(-w * delta) / -w
    if p[_K_SKEW] != 0.0:
        force *= 1.0 + p[_K_SKEW] * math.tanh(delta / p[_K_SOFT])
    beyond = abs(delta) - p[_BIND_AT]
    if beyond > 0.0:
        force += math.copysign(p[_BIND_K] * beyond**1.5, delta)
    return force


@compiled
def _stack(delta: float, sliders: FloatArray, p: FloatArray) -> float:
    """Return the force of an Iwan stack of spring-slider elements whose slips are spread evenly."""
    force = 0.0
    each = p[_SLIP_K] / SLIDERS
    for i in range(SLIDERS):
        reach = p[_SLIP_AT] * (i + 1) / SLIDERS
        stretch = delta - sliders[i]
        if stretch > reach:
            sliders[i] = delta - reach
        elif stretch < -reach:
            sliders[i] = delta + reach
        force += each * (delta - sliders[i])
    return force


@compiled
def _advance(
    v: float, force: float, level: float, m: float, h: float, c: int, bristles: FloatArray, cart: int, p: FloatArray
) -> float:
    """Return the velocity after h under a force [V] and dry friction of a level [V]."""
    if p[c + _BRISTLE] > 0.0:
        peak = level * (1.0 + math.copysign(1.0, v) * p[c + _D_SKEW])
        peak *= 1.0 + p[c + _HUMP] / (1.0 + (v / p[c + _VS]) ** 2)
        stiff = p[c + _BRISTLE]
        old = bristles[cart]
        new = (old + h * v) / (1.0 + h * abs(v) * stiff / peak)
        bristles[cart] = new
        inner = 0.6 * math.sqrt(stiff * m) / (1.0 + (v / 20.0) ** 2)
        return v + h * (force - stiff * new - inner * (new - old) / h) / m
    left = h
    if v != 0.0:
        side = math.copysign(1.0, v)
        kinetic = level * (1.0 + side * p[c + _D_SKEW])
        kinetic *= 1.0 + p[c + _HUMP] / (1.0 + (v / p[c + _VS]) ** 2)
        new = v + h * (force - side * kinetic) / m
        if new * v >= 0.0:
            return new
        # it comes to rest within the step; what is left of the step decides whether it turns round or stays
        left = h * new / (new - v)
    side = math.copysign(1.0, force)
    kinetic = level * (1.0 + side * p[c + _D_SKEW])
    if abs(force) <= kinetic * (1.0 + p[c + _HUMP] + p[c + _STATIC]):
        return 0.0
    return left * (force - side * kinetic * (1.0 + p[c + _HUMP])) / m


@compiled
def _smooth(v: float, factor: float, c: int, p: FloatArray) -> float:
    """Return the friction that needs no stick: viscous in two directions, drag, brake [V]."""
    b = factor * p[c + _B]
    if p[c + _B_SKEW] != 0.0:
        b *= 1.0 + p[c + _B_SKEW] * math.tanh(v / 5.0)
    force = b * v
    if p[c + _DRAG] != 0.0:
        force += p[c + _DRAG] * v * math.sqrt(v * v + 225.0)
    if p[c + _CUBE] != 0.0:
        force += p[c + _CUBE] * v * v * v
    return force


@compiled
def _read(x: float, c: int, p: FloatArray) -> float:
    """Return the place an encoder's disc shows for a place of the cart [mm]."""
    y = x * (1.0 + p[c + _SCALE])
    if p[c + _WOBBLE] != 0.0:
        angle = 2.0 * math.pi * x / p[c + _WHEEL] + p[c + _TURN]
        y += p[c + _WOBBLE] * (math.sin(angle) + 0.15 * math.sin(2.0 * angle + 1.0))
    return y


@compiled
def _transmit(xm: float, vm: float, x1: float, v1: float, slider: float, p: FloatArray) -> tuple[float, float]:
    """Return the force from the motor to cart 1 [V] through a belt that slips, or gears with a gap."""
    if p[_BELT] > 0.0:
        stretch, stiff = xm - x1 - slider, 30.0
        reach = p[_BELT] / stiff
        slider += max(0.0, stretch - reach) + min(0.0, stretch + reach)
        return stiff * (xm - x1 - slider) + 0.01 * (vm - v1) * (abs(stretch) < reach), slider
    stretch = xm - x1
    depth = abs(stretch) - p[_LASH]
    if depth <= 0.0:
        return 0.0, slider
    side = math.copysign(1.0, stretch)
    return side * 30.0 * depth * max(0.0, 1.0 + 0.01 * side * (vm - v1)), slider


@compiled
def _decide(law: FloatArray, n: int, z: FloatArray, xr: float, y1: float, y2: float) -> float:
    """Return a controller's command [V] and advance its n states z; the law's layout is :meth:`rig.Law.flat`'s."""
    rows = law[LAW_HEAD:].reshape((n + 2, n + 4))
    put = np.zeros(n + 2)
    for i in range(n + 2):
        put[i] = rows[i, n] * xr + rows[i, n + 1] * y1 + rows[i, n + 2] * y2
        for j in range(n):
            put[i] += rows[i, j] * z[j]
    u = put[n]
    if law[1] != 0.0:
        u += law[1] * min(max(put[n + 1] / law[2], -1.0), 1.0)
    allowed = min(max(u, -law[0]), law[0])
    for i in range(n):
        z[i] = put[i] + rows[i, n + 3] * (allowed - u)
    return allowed


@compiled
def _look(
    i: int, x1: float, v1: float, x2: float, v2: float, r1: float, r2: float, zero: FloatArray, p: FloatArray,
    counts: FloatArray, states: FloatArray, shown: FloatArray,
) -> None:  # fmt: skip
    """Write sample i: the states, what the discs show for the places r1, r2, and the counts since the start."""
    states[0, i], states[1, i], states[2, i], states[3, i] = x1, v1, x2, v2
    shown[0, i], shown[1, i] = _read(r1, 0, p), _read(r2, CART, p)
    for k in range(2):
        counts[k, i] = math.floor(shown[k, i] / COUNT_MM + zero[2 + k]) - zero[k]


@compiled
def advance_run(
    p: FloatArray, over_time: FloatArray, track: FloatArray, start: FloatArray, command: FloatArray, law: FloatArray,
    order: int, factor: float, feedforward: FloatArray, steps: int, begin: int, end: int, keep: FloatArray, u: FloatArray,
    counts: FloatArray, states: FloatArray, shown: FloatArray,
) -> None:  # fmt: skip
    """Run samples ``begin`` … ``end`` - 1 and fill u, counts, states and shown, these three also at ``end``; see :func:`rig.run`.

    A run may be made in parts, one after the other, which share ``keep``; it begins at ``start`` (x1, x2 [mm], encoder phases).
    """
    h = SAMPLE_S / steps
    c1, c2 = 0, CART
    cut = REMEMBERED + 6 + SLIDERS
    zero, bristles, sliders = keep[REMEMBERED:][:4], keep[REMEMBERED + 4 :][:2], keep[REMEMBERED + 6 : cut]
    ring1, ring2, memory = keep[cut:][:RING], keep[cut + RING :][:RING], keep[cut + 2 * RING :]
    back1, back2 = round(p[c1 + _LATE] / h), round(p[c2 + _LATE] / h)
    if begin == 0:
        place, other = start[0], start[1]
        keep[0], keep[1], keep[4], keep[8], keep[9] = place, other, place, place, other  # y1, y2: what play leaves
        keep[6], keep[15], keep[16] = (place if p[_TAIL_ON] == 1.0 else other), 9.0, 9.0
        zero[2], zero[3] = start[2], start[3]
        zero[0] = math.floor(_read(place, c1, p) / COUNT_MM + start[2])
        zero[1] = math.floor(_read(other, c2, p) / COUNT_MM + start[3])
        ring1[:], ring2[:], sliders[:] = place, other, place - other
        _look(0, place, 0.0, other, 0.0, place, other, zero, p, counts, states, shown)
    x1, x2, v1, v2, xm, vm, xt, vt = keep[0], keep[1], keep[2], keep[3], keep[4], keep[5], keep[6], keep[7]
    y1, y2, held, amplified, slewed, maxwell = keep[8], keep[9], keep[10], keep[11], keep[12], keep[13]
    slider, age1, age2, sign1, sign2, a1, a2 = keep[14], keep[15], keep[16], keep[17], keep[18], keep[19], keep[20]
    m1, m2 = p[c1 + _M] * (1.0 - p[_ROTOR]), p[c2 + _M]
    tick = begin * steps
    for i in range(begin, end):
        u[i] = command[i]
        if order >= 0:
            wish = _decide(law, order, memory, command[i], COUNT_MM * counts[0, i], COUNT_MM * counts[1, i])
            u[i] = min(max(factor * wish + feedforward[i], -LIMIT_V), LIMIT_V)
        for j in range(steps):
            f = (j + 0.5) / steps
            past = i + math.floor((j + 0.5 - p[_WAIT] / h) / steps)
            asked = u[past] if past >= 0 else 0.0
            if j == 0 or p[_WAIT] > 0.0:
                held = _shaped(asked + p[_OFFSET], p)
            slewed += min(max(held - slewed, -p[_SLEW] * h), p[_SLEW] * h)
            # exact for a held command
            amplified = slewed + (amplified - slewed) * math.exp(-h / p[_LAG]) if p[_LAG] > 0.0 else slewed
            drive = amplified * (over_time[GAIN, i] + f * (over_time[GAIN, i + 1] - over_time[GAIN, i]))

            delta, rate = x1 - x2, v1 - v2
            spring = _elastic(delta, rate, p)
            if p[_SLIP_K] > 0.0:
                spring += _stack(delta, sliders, p)
            if p[_DAMPER] > 0.0:
                maxwell += h * (p[_DAMPER] * rate - maxwell) / 1e-3
                spring += maxwell
            noise1 = over_time[FORCE_1, i] + f * (over_time[FORCE_1, i + 1] - over_time[FORCE_1, i])
            noise2 = over_time[FORCE_2, i] + f * (over_time[FORCE_2, i + 1] - over_time[FORCE_2, i])
            force1 = noise1 + _along(track, HILL_1, x1) - spring - _smooth(v1, over_time[VISCOUS_1, i], c1, p)
            force2 = noise2 + _along(track, HILL_2, x2) + spring - _smooth(v2, over_time[VISCOUS_2, i], c2, p)
            if p[_ROTOR] > 0.0:
                through, slider = _transmit(xm, vm, x1, v1, slider, p)
                # a third of the viscous friction of cart 1 is in the motor's bearings, none of the dry one
                vm += h * (drive - through - 0.3 * p[c1 + _B] * vm) / (p[c1 + _M] * p[_ROTOR])
                xm += h * vm
                force1 += through + 0.3 * p[c1 + _B] * v1
            else:
                force1 += drive
            if p[_TAIL_M] > 0.0:
                xc, vc = (x1, v1) if p[_TAIL_ON] == 1.0 else (x2, v2)
                pull = p[_TAIL_K] * (xt - xc) + p[_TAIL_B] * (vt - vc)
                vt -= h * pull / p[_TAIL_M]
                xt += h * vt
                if p[_TAIL_ON] == 1.0:
                    force1 += pull
                else:
                    force2 += pull
            if p[_MUTUAL] != 0.0:
                force1, force2 = force1 - p[_MUTUAL] * a2, force2 - p[_MUTUAL] * a1

            level1 = p[c1 + _D] * over_time[FRICTION_1, i] * max(0.05, 1.0 + _along(track, ROUGH_1, x1))
            level2 = p[c2 + _D] * over_time[FRICTION_2, i] * max(0.05, 1.0 + _along(track, ROUGH_2, x2))
            level1 += p[c1 + _LOAD] * abs(spring) + p[_PUSH] * abs(drive)
            level2 += p[c2 + _LOAD] * abs(spring)
            if p[c1 + _YOUNG] > 0.0:
                level1 *= 1.0 + p[c1 + _YOUNG] * math.exp(-age1 / p[c1 + _AGE])
            if p[c2 + _YOUNG] > 0.0:
                level2 *= 1.0 + p[c2 + _YOUNG] * math.exp(-age2 / p[c2 + _AGE])
            w1 = _advance(v1, force1, level1, m1, h, c1, bristles, 0, p)
            w2 = _advance(v2, force2, level2, m2, h, c2, bristles, 1, p)
            if p[_MUTUAL] != 0.0:
                # a light smoothing keeps the explicit coupling of the accelerations stable
                a1 += 0.05 * ((w1 - v1) / h - a1)
                a2 += 0.05 * ((w2 - v2) / h - a2)
            v1, v2 = w1, w2
            x1 += h * v1
            x2 += h * v2
            age1, age2 = age1 + h, age2 + h
            if v1 * sign1 < 0.0 or (v1 != 0.0 and sign1 == 0.0):
                age1, sign1 = 0.0, math.copysign(1.0, v1)
            if v2 * sign2 < 0.0 or (v2 != 0.0 and sign2 == 0.0):
                age2, sign2 = 0.0, math.copysign(1.0, v2)
            y1 = min(max(y1, x1 - p[c1 + _PLAY]), x1 + p[c1 + _PLAY])
            y2 = min(max(y2, x2 - p[c2 + _PLAY]), x2 + p[c2 + _PLAY])
            tick += 1
            ring1[tick % RING], ring2[tick % RING] = y1, y2
        if i + 1 < len(u):
            r1, r2 = ring1[(tick - back1) % RING], ring2[(tick - back2) % RING]
            _look(i + 1, x1, v1, x2, v2, r1, r2, zero, p, counts, states, shown)
    keep[0], keep[1], keep[2], keep[3], keep[4], keep[5], keep[6], keep[7] = x1, x2, v1, v2, xm, vm, xt, vt
    keep[8], keep[9], keep[10], keep[11], keep[12], keep[13] = y1, y2, held, amplified, slewed, maxwell
    keep[14], keep[15], keep[16], keep[17], keep[18], keep[19], keep[20] = slider, age1, age2, sign1, sign2, a1, a2
