"""What a rig may conceal: makers of the catalogue's effects and of effects that are in nobody's catalogue.

A maker turns a strength into numbers; strength 1 times :func:`size_one` is "plainly present" (see ``calibrate.py``).
Numbers named in :mod:`baselines.rig_simulator.kernel` go to the rig's kernel, the others to the tables of
:mod:`baselines.rig_simulator.ingredients`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from baselines.rig_simulator.kernel import SAMPLE_S
from baselines.rig_simulator.rig import quiet, run
from baselines.rig_simulator.sizes import SIZES

Numbers = dict[str, float]
Make = Callable[[np.random.Generator, Mapping[str, float], float], Numbers]


@dataclass(frozen=True)
class Maker:
    """Makes one effect at one place: ``make(rng, drive, strength)`` returns its numbers."""

    id: str
    where: str
    make: Make


def size_one(maker: Maker) -> float:
    """Return the strength that is plainly present."""
    return SIZES.get(f"{maker.id}@{maker.where}", (1.0, 0.0, 0.0))[0]


def _sign(rng: np.random.Generator) -> float:
    return 1.0 if rng.random() < 0.5 else -1.0


def _stribeck(c: int) -> Make:
    return lambda rng, _d, s: {f"hump{c}": 0.35 * s, f"vs{c}": rng.uniform(8.0, 25.0)}


def _breakaway(c: int) -> Make:
    return lambda _r, _d, s: {f"static{c}": 0.5 * s}


def _presliding(c: int) -> Make:
    # the reach d/stiffness is what a student would call the give of the contact
    return lambda _r, d, s: {f"bristle{c}": d[f"d{c}"] / (0.6 * s)}


def _d_skew(c: int) -> Make:
    return lambda rng, _d, s: {f"d_skew{c}": _sign(rng) * min(0.12 * s, 0.8)}


def _b_skew(c: int) -> Make:
    return lambda rng, _d, s: {f"b_skew{c}": _sign(rng) * min(0.12 * s, 0.8)}


def _drag(c: int) -> Make:
    # 100 mm/s is a typical speed: strength 1 adds 0.2 V there
    return lambda _r, _d, s: {f"drag{c}": 2e-5 * s}


def _place_friction(_c: int) -> Make:
    def make(rng: np.random.Generator, _d: Mapping[str, float], s: float) -> Numbers:
        places = np.sort(rng.uniform(-70.0, 70.0, 3))
        return {
            "height": 0.8 * s,
            "width": rng.uniform(8.0, 20.0),
            **{f"at_{i}": float(x) for i, x in enumerate(places)},
        }

    return make


def _load(c: int) -> Make:
    return lambda _r, _d, s: {f"load{c}": 0.06 * s}


def _drift(_c: int) -> Make:
    # the first runs of the day are stiff, and every run begins stiffer than it ends
    return lambda rng, _d, s: {
        "day": 0.4 * s,
        "day_runs": rng.uniform(4.0, 9.0),
        "run": 0.2 * s,
        "run_s": rng.uniform(1.5, 4.0),
    }


def reach(drive: Mapping[str, float]) -> float:
    """Return how far the spring is deflected by 2.5 V sines around its resonance, abs(δ) [mm].

    It differs sixfold between drives, and with it all that depends on large deflections.
    """
    t = np.arange(4000) * SAMPLE_S
    most = 0.0
    for frequency in (2.5, 3.0, 3.5, 4.0):
        x1, _v1, x2, _v2 = run(drive, quiet(len(t)), 2.5 * np.sin(2.0 * np.pi * frequency * t)).states
        most = max(most, float(np.max(np.abs(x1 - x2)[2000:])))
    return most


def _hardening(rng: np.random.Generator, d: Mapping[str, float], s: float) -> Numbers:
    # (bend·δ)²/6 is the relative change of stiffness, 10 % at the largest deflection
    return {"bend": _sign(rng) * math.sqrt(0.6 * s) / reach(d)}


def _asymmetric(rng: np.random.Generator, _d: Mapping[str, float], s: float) -> Numbers:
    return {"k_skew": _sign(rng) * min(0.15 * s, 0.8), "k_soft": rng.uniform(2.0, 6.0)}


def _backlash(_r: np.random.Generator, _d: Mapping[str, float], s: float) -> Numbers:
    return {"gap": 0.5 * s}


def _bind(_r: np.random.Generator, d: Mapping[str, float], s: float) -> Numbers:
    at, beyond = 0.6 * reach(d), 0.4 * reach(d)
    return {"bind_at": at, "bind_k": 0.2 * d["k"] * s / math.sqrt(beyond)}


def _damper(_r: np.random.Generator, _d: Mapping[str, float], s: float) -> Numbers:
    return {"damper": 0.0012 * s}


def _hysteresis(rng: np.random.Generator, d: Mapping[str, float], s: float) -> Numbers:
    return {"slip_k": 0.25 * d["k"] * s, "slip_at": rng.uniform(0.15, 0.4) * reach(d)}


def _dead_zone(_r: np.random.Generator, _d: Mapping[str, float], s: float) -> Numbers:
    return {"notch": 0.15 * s}


def _saturation(rng: np.random.Generator, _d: Mapping[str, float], s: float) -> Numbers:
    # (2.5/ceiling)^sharp/sharp of a 2.5 V command is lost
    n = rng.uniform(6.0, 10.0)
    return {"ceiling": 2.5 / (n * min(0.10 * s, 0.5)) ** (1.0 / n), "sharp": n}


def _wait(_r: np.random.Generator, _d: Mapping[str, float], s: float) -> Numbers:
    return {"wait": 0.004 * s}


def _lag(_r: np.random.Generator, _d: Mapping[str, float], s: float) -> Numbers:
    return {"lag": 0.005 * s}


def _gain_skew(rng: np.random.Generator, _d: Mapping[str, float], s: float) -> Numbers:
    return {"gain_skew": _sign(rng) * min(0.03 * s, 0.5)}


def _offset(rng: np.random.Generator, _d: Mapping[str, float], s: float) -> Numbers:
    return {"offset": _sign(rng) * 0.05 * s}


def _cogging(rng: np.random.Generator, _d: Mapping[str, float], s: float) -> Numbers:
    return {"force": 0.15 * s, "period": rng.uniform(5.0, 25.0), "phase": rng.uniform(0.0, 2.0 * math.pi)}


def _lash(rng: np.random.Generator, _d: Mapping[str, float], s: float) -> Numbers:
    return {"rotor": rng.uniform(0.3, 0.6), "lash": 0.15 * s}


def _gain_drift(rng: np.random.Generator, _d: Mapping[str, float], s: float) -> Numbers:
    return {"loss": 0.08 * s, "loss_s": rng.uniform(2.0, 5.0)}


def _tilt(rng: np.random.Generator, d: Mapping[str, float], s: float) -> Numbers:
    # gravity pulls each cart by its mass
    force, share = _sign(rng) * 0.05 * s, d["m2"] / (d["m1"] + d["m2"])
    return {"pull_1": force * (1.0 - share), "pull_2": force * share}


def _ground(rng: np.random.Generator, d: Mapping[str, float], s: float) -> Numbers:
    # a cable on cart 1, or a bowed track under both
    share = d["m2"] / (d["m1"] + d["m2"]) if rng.random() < 0.5 else 0.0
    return {
        "stiffness_1": 0.004 * s * (1.0 - share),
        "stiffness_2": 0.004 * s * share,
        "bow": rng.uniform(60.0, 120.0),
        "centre": rng.uniform(-15.0, 15.0),
    }


def _scale(rng: np.random.Generator, _d: Mapping[str, float], s: float) -> Numbers:
    return {"scale2": _sign(rng) * 0.04 * s}


def _late(c: int) -> Make:
    return lambda _r, _d, s: {f"late{c}": min(0.004 * s, 0.02)}


def _wobble(rng: np.random.Generator, _d: Mapping[str, float], s: float) -> Numbers:
    return {"wobble2": 0.4 * s, "wheel2": rng.uniform(25.0, 80.0), "turn2": rng.uniform(0.0, 2.0 * math.pi)}


def _play(c: int) -> Make:
    return lambda _r, _d, s: {f"play{c}": 0.2 * s}


def _tail(rng: np.random.Generator, d: Mapping[str, float], s: float) -> Numbers:
    cart, frequency = int(rng.integers(1, 3)), rng.uniform(6.0, 11.0)
    mass = 0.12 * d[f"m{cart}"] * s
    rate = 2.0 * math.pi * frequency
    return {"tail_m": mass, "tail_k": mass * rate**2, "tail_b": 0.06 * mass * rate, "tail_on": float(cart)}


def _rectified(_r: np.random.Generator, _d: Mapping[str, float], _s: float) -> Numbers:
    return {}


def _both(effect_id: str, make: Callable[[int], Make]) -> tuple[Maker, Maker]:
    return Maker(effect_id, "cart_1", make(1)), Maker(effect_id, "cart_2", make(2))


CATALOGUE: tuple[Maker, ...] = (
    *_both("stribeck", _stribeck),
    *_both("breakaway", _breakaway),
    *_both("presliding", _presliding),
    *_both("coulomb_asymmetry", _d_skew),
    *_both("viscous_asymmetry", _b_skew),
    *_both("quadratic_drag", _drag),
    *_both("position_friction", _place_friction),
    *_both("load_friction", _load),
    *_both("friction_drift", _drift),
    Maker("hardening_spring", "spring", _hardening),
    Maker("asymmetric_spring", "spring", _asymmetric),
    Maker("coupling_backlash", "spring", _backlash),
    Maker("coil_bind", "spring", _bind),
    Maker("spring_damping", "spring", _damper),
    Maker("spring_hysteresis", "spring", _hysteresis),
    Maker("dead_zone", "actuator", _dead_zone),
    Maker("saturation", "actuator", _saturation),
    Maker("input_delay", "actuator", _wait),
    Maker("amplifier_lag", "actuator", _lag),
    Maker("gain_asymmetry", "actuator", _gain_skew),
    Maker("input_offset", "actuator", _offset),
    Maker("cogging", "drivetrain", _cogging),
    Maker("motor_gear_backlash", "drivetrain", _lash),
    Maker("gain_drift", "actuator", _gain_drift),
    Maker("tilt", "guide", _tilt),
    Maker("ground_spring", "guide", _ground),
    Maker("encoder_scale", "encoder_2", _scale),
    Maker("encoder_delay", "encoder_1", _late(1)),
    Maker("encoder_delay", "encoder_2", _late(2)),
    Maker("encoder_eccentricity", "encoder_2", _wobble),
    Maker("encoder_play", "encoder_1", _play(1)),
    Maker("encoder_play", "encoder_2", _play(2)),
    Maker("extra_mode", "structure", _tail),
    Maker("rectified_sensor", "encoder_1", _rectified),
    Maker("rectified_sensor", "encoder_2", _rectified),
)


def _periodic(rng: np.random.Generator, _d: Mapping[str, float], s: float) -> Numbers:
    # a fan, a pump: not locked to the command
    return {"shake": 0.25 * s, "shake_hz": rng.uniform(1.6, 7.3), "shake_on": float(rng.integers(1, 3))}


def _brake(rng: np.random.Generator, d: Mapping[str, float], s: float) -> Numbers:
    # 100 mm/s: strength 1 adds 0.3 V; with a resonance
    cart = int(rng.integers(1, 3))
    return {f"cube{cart}": 3e-7 * s, **_tail(rng, d, 0.8 * s)}


def _mutual(rng: np.random.Generator, d: Mapping[str, float], s: float) -> Numbers:
    return {"mutual": _sign(rng) * min(0.15 * s, 0.6) * math.sqrt(d["m1"] * d["m2"])}


def _impacts(rng: np.random.Generator, _d: Mapping[str, float], s: float) -> Numbers:
    return {"blow": 2.0 * s, "blows_hz": rng.uniform(0.8, 2.5), "blow_s": rng.uniform(0.01, 0.03)}


def _stop(rng: np.random.Generator, _d: Mapping[str, float], s: float) -> Numbers:
    # a rubber bumper on one side
    return {
        "bumper": 0.01 * s,
        "bumper_at": _sign(rng) * rng.uniform(5.0, 25.0),
        "bumper_cart": float(rng.integers(1, 3)),
    }


def _young(rng: np.random.Generator, _d: Mapping[str, float], s: float) -> Numbers:
    cart = int(rng.integers(1, 3))
    return {f"young{cart}": 0.6 * s, f"age{cart}": rng.uniform(0.05, 0.2)}


def _belt(rng: np.random.Generator, _d: Mapping[str, float], s: float) -> Numbers:
    return {"rotor": rng.uniform(0.35, 0.55), "belt": max(0.8, 2.25 - 0.35 * s)}


def _push(_r: np.random.Generator, _d: Mapping[str, float], s: float) -> Numbers:
    return {"push_friction": 0.1 * s}


def _slew(_r: np.random.Generator, _d: Mapping[str, float], s: float) -> Numbers:
    return {"slew": 80.0 / s}


def _detent(rng: np.random.Generator, _d: Mapping[str, float], s: float) -> Numbers:
    return {"detent": 0.5 * s, "detent_at": rng.uniform(-25.0, 25.0), "detent_width": rng.uniform(4.0, 9.0)}


OUTSIDE: tuple[Maker, ...] = (
    Maker("periodic_disturbance", "outside", _periodic),
    Maker("cubic_brake_with_resonance", "outside", _brake),
    Maker("inertial_coupling", "outside", _mutual),
    Maker("random_impacts", "outside", _impacts),
    Maker("one_sided_stop", "outside", _stop),
    Maker("friction_since_reversal", "outside", _young),
    Maker("slipping_belt", "outside", _belt),
    Maker("command_friction", "outside", _push),
    Maker("slew_limit", "outside", _slew),
    Maker("magnet_detent", "outside", _detent),
)

# what the handout's recordings alone hardly separate; a pair of such would be a riddle without an answer
LOOK_ALIKES: frozenset[frozenset[str]] = frozenset(
    frozenset(pair)
    for pair in (
        ("stribeck", "presliding"),
        ("stribeck", "quadratic_drag"),
        ("stribeck", "breakaway"),
        ("breakaway", "dead_zone"),
        ("breakaway", "presliding"),
        ("coulomb_asymmetry", "gain_asymmetry"),
        ("coulomb_asymmetry", "input_offset"),
        ("coulomb_asymmetry", "tilt"),
        ("coulomb_asymmetry", "asymmetric_spring"),
        ("coulomb_asymmetry", "viscous_asymmetry"),
        ("viscous_asymmetry", "gain_asymmetry"),
        ("viscous_asymmetry", "ground_spring"),
        ("gain_asymmetry", "input_offset"),
        ("gain_asymmetry", "tilt"),
        ("input_offset", "tilt"),
        ("load_friction", "spring_damping"),
        ("hardening_spring", "spring_damping"),
        ("hardening_spring", "coupling_backlash"),
        ("hardening_spring", "coil_bind"),
        ("coil_bind", "coupling_backlash"),
        ("spring_hysteresis", "spring_damping"),
        ("dead_zone", "saturation"),
        ("input_delay", "amplifier_lag"),
        ("amplifier_lag", "encoder_delay"),
        ("input_delay", "encoder_delay"),
        ("motor_gear_backlash", "breakaway"),
        ("gain_drift", "friction_drift"),
        ("cogging", "encoder_eccentricity"),
        ("encoder_play", "breakaway"),
        ("encoder_play", "presliding"),
        # not in the catalogue's column, but both put a motor inertia or an appendage behind a spring
        ("motor_gear_backlash", "presliding"),
    )
)
