"""Every effect of the catalogue, present and future, keeps these promises."""

from importlib import import_module

import numpy as np

from flexdrive_gym import Drive
from flexdrive_gym.drive.effects import EFFECTS, LAYOUT
from flexdrive_gym.drive.parameters import vector
from flexdrive_gym.references import square
from tests.drive.drives import RIG
from tests.each import each

T = np.arange(1501) * 1e-3
U = square(T, 2.0, 1.0)


CATALOGUE = {
    "stribeck", "breakaway", "presliding", "coulomb_asymmetry", "viscous_asymmetry", "quadratic_drag",
    "position_friction", "load_friction", "friction_drift", "hardening_spring", "asymmetric_spring",
    "coupling_backlash", "coil_bind", "spring_damping", "spring_hysteresis", "dead_zone", "saturation", "input_delay",
    "amplifier_lag", "gain_asymmetry", "input_offset", "cogging", "motor_gear_backlash", "gain_drift", "tilt",
    "ground_spring", "encoder_scale", "encoder_delay", "encoder_eccentricity", "encoder_play", "extra_mode",
    "rectified_sensor", "base_recoil", "saturating_friction",
}  # fmt: skip


def test_the_catalogue_is_complete():
    # handout_ratios is a property of the parameters, encoder_dropout a fault of the data
    ids = {effect.id for effect in EFFECTS}
    assert ids >= CATALOGUE
    assert ids - CATALOGUE == {
        "coulomb_friction", "viscous_friction", "spring", "encoder_quantisation", "velocity_processing",
    }  # fmt: skip


@each("effect", EFFECTS, ids=lambda e: e.id)
def test_documents_itself(effect):
    module = import_module(f"flexdrive_gym.drive.effects.{effect.id}")
    assert module.EFFECT is effect
    assert set(effect.looks_like) <= {e.id for e in EFFECTS}
    assert effect.base or (effect.separating_experiment and "Worked check:" in " ".join(module.__doc__.split()))
    assert not (effect.states and effect.memory)
    assert effect.equation
    assert effect.tells_itself_by
    assert effect.reference
    assert effect.where
    for parameter in effect.parameters:
        assert parameter.meaning
        assert parameter.lower <= parameter.null <= parameter.upper
        assert parameter.starts
        assert all(parameter.lower <= start <= parameter.upper for start in parameter.starts)


@each("key", LAYOUT)
def test_null_is_exactly_the_identity(key):
    without = {k: v for k, v in RIG.items() if k != key}
    with_null = Drive({**without, key: LAYOUT[key].parameter.null})
    a, b = Drive(without).simulate(T, U), with_null.simulate(T, U)
    for name in ("x1", "x2", "v1", "v2"):
        assert np.array_equal(getattr(a, name), getattr(b, name))


@each("effect", EFFECTS, ids=lambda e: e.id)
def test_does_something_when_present(effect):
    for where in effect.where:
        values = dict(RIG)
        for parameter in effect.parameters:
            key = effect.key(where, parameter.name)
            start = parameter.starts[0]
            values[key] = 0.5 * start if values.get(key) == start else start
        # what holds a resting cart does nothing to one that is driven too hard to rest
        runs = [(Drive(RIG).simulate(T, f * U), Drive(values).simulate(T, f * U)) for f in (1.5, 0.4, 0.2)]
        assert any(np.abs([a.v1 - b.v1, a.v2 - b.v2]).max() > 1e-6 for a, b in runs)


def test_parameters_have_one_place_each():
    places = [slot.index for slot in LAYOUT.values()]
    assert sorted(places) == list(range(2, 2 + len(places)))
    assert len(vector({})) == 2 + len(places)
