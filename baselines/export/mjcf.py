"""A drive as a MuJoCo model (MJCF): what MuJoCo has elements for, and a list of what it has not.

Carts are bodies on joints along one axis, the spring is a fixed tendon of length x1 - x2, Coulomb friction is ``frictionloss``.
MuJoCo reckons in metres (or radians) and seconds; force keeps the rig's unit of command, so that a mass in V s²/m takes the place
of one in kg.

MuJoCo's dry friction is a regularised constraint solved once per step: a cart at rest creeps, and stops and releases fall on
steps. With the shortest time constant that its solver takes (twice the step) and a step of 0.1 ms both are small;
``python -m benchmarks export`` prints them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from baselines.export.exported import Exported
from baselines.export.matlab import described, present_effects, provenance
from baselines.export.templating import fill
from flexdrive_gym import Drive
from flexdrive_gym.drive.effects import LAYOUT
from flexdrive_gym.units import Units
from flexdrive_gym.version import __version__

TIMESTEP_S = 1e-4
# how many of MuJoCo's units of length make one of the rig's
_METRES = {"mm": 1e-3, "cm": 1e-2, "m": 1.0}

_ONE_LEVEL = "joint friction is one level, alike at every speed, place and direction"
_ONE_GAIN = "an actuator's gain is one number"
_TRUE_READINGS = "sensors read the true motion"
_REASONS = {
    **dict.fromkeys(
        ("stribeck", "breakaway", "presliding", "coulomb_asymmetry", "position_friction", "load_friction", "friction_drift"),
        _ONE_LEVEL,
    ),
    **dict.fromkeys(("dead_zone", "gain_asymmetry", "gain_drift"), _ONE_GAIN),
    **dict.fromkeys(
        ("encoder_delay", "encoder_eccentricity", "encoder_play", "encoder_scale", "rectified_sensor", "encoder_quantisation",
         "velocity_processing"),
        _TRUE_READINGS,
    ),
    "viscous_asymmetry": "joint damping is alike in both directions",
    "cogging": "there is no force that repeats along a joint",
    "motor_gear_backlash": "its contacts follow another law than Hunt and Crossley's",
    "spring_hysteresis": "its springs remember nothing",
    "asymmetric_spring": "its springs are polynomials",
    "coil_bind": "its springs are polynomials",
    "saturation": "a limit of the command is hard",
}  # fmt: skip
_HELD = {
    "hardening_spring", "asymmetric_spring", "coil_bind", "coupling_backlash", "quadratic_drag", "ground_spring", "tilt",
    "input_offset", "amplifier_lag", "input_delay", "extra_mode", "base_recoil",
}  # fmt: skip


@dataclass
class _Cart:
    mass: float
    damping: list[float]
    friction: float
    at: str
    shape: str
    colour: str
    stiffness: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    appendage: dict[str, float] | None = None


def mujoco_units(units: Units) -> tuple[Units, bool]:
    """Return MuJoCo's units for a rig, and whether its carts turn (radians) or slide (metres)."""
    turns = units.length == "rad"
    metres = 1.0 if turns else _METRES.get(units.length, 1.0)
    name = "rad" if turns else "m"
    return Units(name, units.command, units.per_length / metres, units.per_command, units.per_time), turns


def export_mujoco(drive: Drive, name: str, *, command: str = "flexdrive export") -> Exported:
    """Write a drive as MJCF.

    Parameters
    ----------
    drive
        With all its effects.
    name
        Of the model.
    command
        How the file was made.

    Returns
    -------
    Exported
        Positions are joints ``x1``, ``x2`` [m or rad], the command is the control ``u`` [of the rig].
    """
    units, turns = mujoco_units(drive.units)

    def of(key: str, unit: str) -> float:
        return drive[key] / units.one(unit)

    which = present_effects(drive)
    beyond = {
        "tilt": turns,
        "asymmetric_spring": drive["asymmetric_spring.c"] > 0.0,
        "coil_bind": drive["coil_bind.n"] > 0.0,
    }
    held = [w for w in which if w[0] in _HELD and not beyond.get(w[0], False)]
    delayed = [("input_delay", "actuator")] if drive["input_delay.tau"] > 0.0 else []
    carts = _carts(drive, of, turns=turns)
    lag = of("amplifier_lag.tau", "s")
    delay = of("input_delay.tau", "s")
    gravity = 0.0
    if ("tilt", "guide") in held:
        gravity = of("tilt.F", "V") / sum(cart.mass for cart in carts)
    left_out = _left_out(drive, [w for w in which if w not in held], turns=turns)
    notes = _notes(drive, units, held)
    header = [
        f"Units: 1 {drive.units.length} is {drive.units.per_length / units.per_length:g} {units.length}.",
        f"Forces and the control u are in {units.command}, so a mass is in {units.name('V s²/mm')}.",
        *(f"Held: {line}" for line in described(drive, [*held, *delayed])),
        *(f"Left out: {line}" for line in left_out),
        *notes,
        f"Written by flexdrive {__version__}: {command}",
        *provenance(drive),
    ]
    text = fill(
        "drive.xml.j2",
        name=name,
        title=f"{drive.name}: the two-mass flexible drive"
        if drive.carts == 2
        else f"{drive.name}: a drive of one cart",
        header=header,
        integration="Friction is a constraint that is solved at every step: as stiff as the solver allows, at a short step.",
        timestep=TIMESTEP_S / drive.units.per_time,
        joint="hinge" if turns else "slide",
        axis="0 1 0" if turns else "1 0 0",
        gravity=gravity,
        carts=carts,
        track=_track(drive, of) if ("base_recoil", "guide") in held else None,
        springs=_springs(drive, of, held),
        limit=of("saturation.limit", "V") if math.isfinite(drive.voltage_limit) else 0.0,
        offset=of("input_offset.u0", "V"),
        lag=lag,
        delay=delay,
        delay_samples=math.ceil(delay / (TIMESTEP_S / drive.units.per_time)) + 2,
    )
    kept = ("masses, viscous and Coulomb friction, spring, command limit", *described(drive, [*held, *delayed]))
    return Exported(text, kept, tuple(left_out), tuple(notes))


def _carts(drive: Drive, of: Any, *, turns: bool) -> list[_Cart]:
    carts = []
    for i in range(1, drive.carts + 1):
        at = f"0 {0.1 * (i - 1):g} 0" if turns else f"{0.2 * (i - 1):g} 0 0"
        shape = 'type="box" size="0.03 0.005 0.05"' if turns else 'type="box" size="0.04 0.03 0.02"'
        cart = _Cart(
            of(f"m{i}", "V s²/mm"),
            [of(f"b{i}", "V s/mm"), of(f"quadratic_drag.cart_{i}.c", "V s²/mm²")],
            of(f"d{i}", "V"),
            at,
            shape,
            ("0.2 0.4 0.8 1", "0.9 0.5 0.1 1")[i - 1],
        )
        mass = of(f"extra_mode.mass_{i}", "V s²/mm")
        if mass > 0.0:
            w = 2.0 * math.pi * of("extra_mode.frequency", "Hz")
            cart.appendage = {
                "mass": mass,
                "stiffness": mass * w * w,
                "damping": 2.0 * drive["extra_mode.zeta"] * w * mass,
            }
        carts.append(cart)
    carts[0].stiffness = [of("ground_spring.kg", "V/mm"), 0.0, of("ground_spring.kg3", "V/mm³")]
    if drive.carts == 2:
        carts[1].stiffness = [of("ground_spring.kg_2", "V/mm"), 0.0, 0.0]
    return carts


def _track(drive: Drive, of: Any) -> dict[str, float]:
    stiffness, w = 1.0 / of("base_recoil.compliance", "mm/V"), 2.0 * math.pi * of("base_recoil.frequency", "Hz")
    mass = stiffness / (w * w)
    return {"mass": mass, "stiffness": stiffness, "damping": 2.0 * drive["base_recoil.zeta"] * w * mass}


def _springs(drive: Drive, of: Any, held: Sequence[tuple[str, str]]) -> list[dict[str, Any]]:
    if drive.carts == 1:
        return []
    square = of("asymmetric_spring.k2", "V/mm²") if ("asymmetric_spring", "spring") in held else 0.0
    stiffness = [of("k", "V/mm"), square, of("hardening_spring.k3", "V/mm³")]
    play = of("coupling_backlash.g", "mm")
    springs = [{"name": "spring", "stiffness": stiffness, "damping": of("C", "V s/mm"), "play": play}]
    if ("coil_bind", "spring") in held:
        beyond = play + of("coil_bind.d0", "mm")
        springs.append({"name": "coil_bind", "stiffness": [of("coil_bind.kb", "V/mm")], "damping": 0.0, "play": beyond})
    return springs


def _left_out(drive: Drive, which: Sequence[tuple[str, str]], *, turns: bool) -> list[str]:
    """Return a line per effect that MuJoCo has no element for, base effects of the sensors included."""
    base = [
        (slot.effect.id, slot.where)
        for key, slot in LAYOUT.items()
        if slot.effect.base
        and slot.effect.id in _REASONS
        and drive[key] != slot.parameter.null
        and key != "saturation.limit"
    ]
    carts = {"encoder_1", "encoder_2"} if drive.carts == 2 else {"encoder_1"}
    names = dict.fromkeys(w for w in (*which, *base) if not w[1].startswith("encoder") or w[1] in carts)
    reasons = _REASONS | ({"tilt": "gravity does not turn a wheel that is balanced"} if turns else {})
    return [f"{effect} at {where}: {reasons.get(effect, 'MuJoCo has no element for it')}" for effect, where in names]


def _notes(drive: Drive, units: Units, held: Sequence[tuple[str, str]]) -> list[str]:
    notes = [
        "dry friction is MuJoCo's regularised constraint: a cart at rest creeps a little, and stops and releases fall on steps",
    ]
    ids = {effect for effect, _where in held}
    if "coupling_backlash" in ids and drive["C"] > 0.0:
        notes.append("the spring's damping also acts within the play")
    if drive["coupling_backlash.loss"] > 0.0:
        notes.append("the loss of the contacts of the play is left out")
    if {"base_recoil", "extra_mode"} <= ids:
        notes.append("the appendage is carried along by the track, which flexdrive's is not")
    if units.length == "m" and drive.units.length not in _METRES:
        notes.append(f"1 {drive.units.length} is taken for 1 m")
    return notes
