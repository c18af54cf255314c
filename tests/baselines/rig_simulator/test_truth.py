"""Concealed truths: reproducible, within realistic ranges, mixed as documented, sealed."""

import json
from collections import Counter

import numpy as np
import pytest

from baselines.rig_simulator.catalogue import CATALOGUE, LOOK_ALIKES, OUTSIDE, size_one
from baselines.rig_simulator.kernel import NULLS
from baselines.rig_simulator.truth import KINDS, MIXTURE, SIZES, draw_drive, draw_truth, find, seal
from tests.each import each

# ids of the catalogue of left-out physics; the handout's ratios are hypothesis zero and random in every case,
# an encoder that drops out is a fault
PHYSICS = """stribeck breakaway presliding coulomb_asymmetry viscous_asymmetry quadratic_drag position_friction load_friction
friction_drift hardening_spring asymmetric_spring coupling_backlash coil_bind spring_damping spring_hysteresis dead_zone
saturation input_delay amplifier_lag gain_asymmetry input_offset cogging motor_gear_backlash gain_drift tilt ground_spring
encoder_scale encoder_delay encoder_eccentricity encoder_play extra_mode rectified_sensor""".split()  # noqa: SIM905
TWO_CARTS = PHYSICS[:9]
TWO_ENCODERS = ["encoder_delay", "encoder_play", "rectified_sensor"]


def test_every_effect_can_be_concealed_at_every_place():
    places = Counter(m.id for m in CATALOGUE)
    assert set(places) == set(PHYSICS)
    assert [name for name, n in places.items() if n == 2] == [*TWO_CARTS, *TWO_ENCODERS]
    assert len(OUTSIDE) >= 6
    assert not {m.id for m in OUTSIDE} & set(PHYSICS)
    assert all(pair <= set(PHYSICS) for pair in LOOK_ALIKES)


def test_everything_follows_from_the_seed():
    assert draw_truth(5).json() == draw_truth(5).json()
    assert seal(draw_truth(5).json()) != seal(draw_truth(6).json())


def test_a_truth_is_json_and_says_what_it_conceals():
    told = json.loads(draw_truth(3, "pair", size=1.0).json())
    assert [set(e) for e in told["effects"]] == [{"id", "where", "parameters", "size"}] * 2
    assert set(told["drive"]) == {"m1", "m2", "b1", "b2", "k", "d1", "d2"}
    assert (told["kind"], told["seed"]) == ("pair", 3)


def test_kinds_hold_what_they_say():
    named = {m.id for m in CATALOGUE}
    for seed in range(40):
        assert draw_truth(seed, "null").effects == ()
        one = draw_truth(seed, "effect")
        assert len(one.effects) == 1
        assert one.effects[0].id in named
        assert one.effects[0].size in SIZES
        two = [e.id for e in draw_truth(seed, "pair").effects]
        assert len(set(two)) == 2
        assert frozenset(two) not in LOOK_ALIKES
        assert draw_truth(seed, "outside").effects[0].id not in named
        assert 1 <= draw_truth(seed, "fault").n_faults <= 4


def test_the_mixture_is_the_documented_one():
    kinds = Counter(draw_truth(seed).kind for seed in range(400))
    assert sum(MIXTURE.values()) == pytest.approx(1.0)
    for kind in KINDS:
        p = MIXTURE[kind]
        assert abs(kinds[kind] / 400 - p) < 4 * np.sqrt(p * (1 - p) / 400)


def test_drives_are_realistic_and_some_obey_the_handout():
    drives = [draw_drive(np.random.default_rng(seed)) for seed in range(300)]
    for d in drives:
        assert 4e-4 < d["m1"] < 1.3e-3
        assert 0.2 < d["m2"] / d["m1"] < 0.9
        assert 0.06 < d["k"] < 0.16
        assert d["d1"] + d["d2"] < 1.1, "1.5 V must move the carts"
    ratios = [d["d2"] / d["d1"] for d in drives if abs(d["m2"] / d["m1"] - 0.54) < 1e-3 and d["b2"] < 0.101 * d["b1"]]
    assert 15 < len(ratios) < 90
    assert ratios == pytest.approx([0.1] * len(ratios), rel=1e-3)


@each("maker", [*CATALOGUE, *OUTSIDE], ids=lambda m: f"{m.id}@{m.where}")
def test_numbers_are_finite_and_grow_with_size(maker):
    drive = draw_drive(np.random.default_rng(1))
    small, large = (maker.make(np.random.default_rng(2), drive, s * size_one(maker)) for s in (0.5, 1.0))
    assert all(np.isfinite(v) for v in large.values())
    assert small.keys() == large.keys()
    assert (small != large) == (maker.id != "rectified_sensor")
    kernel = {n: v for n, v in large.items() if n in NULLS}
    assert all(v != NULLS[n] for n, v in kernel.items() if n != "tail_on")


def test_an_unknown_effect_is_refused():
    with pytest.raises(KeyError, match="nothing makes 'warp_drive'"):
        find("warp_drive")
