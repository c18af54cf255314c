"""What every effect beyond the base promises: energy, symmetry, convergence, one cart."""

import numpy as np
import pytest

from flexdrive_gym import Drive
from flexdrive_gym.drive import parameters
from tests.drive.drives import FRICTIONLESS, RIG
from tests.drive.effects.runs import BY_ID, INSTANCES, NAMES, instants, start_values, states
from tests.each import each

T = instants(2.0)
HARD = 2.0 * np.where(T % 0.8 < 0.4, 1.0, -1.0) + 0.5 * np.sin(2 * np.pi * 5 * T)

STICK_SLIP = 0.7 * np.sin(2 * np.pi * T)
# effects that treat the two directions differently; of the periodic ones one part does
EVEN = {"coulomb_asymmetry", "viscous_asymmetry", "asymmetric_spring", "gain_asymmetry", "input_offset", "tilt"}
DISSIPATIVE = [
    "stribeck", "breakaway", "coulomb_asymmetry", "viscous_asymmetry", "quadratic_drag", "position_friction",
    "load_friction", "friction_drift",
]  # fmt: skip
# potential of effects that keep energy, of x1, x2 and δ
POTENTIALS = {
    "hardening_spring": ({"hardening_spring.k3": 4e-5}, lambda _a, _b, d: 4e-5 * d**4 / 4),
    "softening": ({"hardening_spring.k3": -2e-5}, lambda _a, _b, d: -2e-5 * d**4 / 4),
    "asymmetric_spring": ({"asymmetric_spring.k2": 5e-4}, lambda _a, _b, d: 5e-4 * d**3 / 3),
    "a spring of two stiffnesses": (
        {"asymmetric_spring.k2": 4e-3, "asymmetric_spring.c": 0.4},
        lambda _a, _b, d: np.sign(d) * 4e-3 * (d**2 / 0.8 - np.abs(d) / 0.16 + np.log1p(0.4 * np.abs(d)) / 0.064),
    ),
    "coil_bind": (
        {"coil_bind.kb": 0.2, "coil_bind.d0": 8.0},
        lambda _a, _b, d: 0.1 * np.maximum(np.abs(d) - 8.0, 0.0) ** 2,
    ),
    "coupling_backlash": (
        {"coupling_backlash.g": 1.0},
        lambda _a, _b, d: RIG["k"] / 2 * (np.maximum(np.abs(d) - 1.0, 0.0) ** 2 - d**2),
    ),
    "ground_spring": (
        {"ground_spring.kg": 1e-3, "ground_spring.kg3": 1e-7, "ground_spring.kg_2": 5e-4},
        lambda a, b, _d: 1e-3 * a**2 / 2 + 1e-7 * a**4 / 4 + 5e-4 * b**2 / 2,
    ),
    "cogging": (
        {"cogging.a_sin": 0.08, "cogging.a_cos": 0.05, "cogging.P": 20.0},
        lambda a, _b, _d: 20 / (2 * np.pi) * (0.08 * np.cos(np.pi * a / 10) - 0.05 * np.sin(np.pi * a / 10)),
    ),
    "tilt": ({"tilt.F": 0.05}, lambda a, b, _d: -0.05 * (7.6 * a + 3.4 * b) / 11.0),
}


def energy(rig, x1, v1, x2, v2):
    return 0.5 * (rig["m1"] * v1**2 + rig["m2"] * v2**2 + rig["k"] * (x1 - x2) ** 2)


@each("name", DISSIPATIVE)
def test_friction_never_adds_energy(name):
    effect = BY_ID[name]
    for where in effect.where:
        values = {**RIG, **start_values(effect, where)}
        x1, v1, x2, v2 = states(values, np.zeros(1501), start=(30.0, 150.0, 0.0, -80.0))
        assert np.all(np.diff(energy(RIG, x1, v1, x2, v2)) <= 1e-9)
        assert v1[-1] == 0.0
        assert v2[-1] == 0.0


@each("name", POTENTIALS)
def test_springs_and_potentials_keep_energy(name):
    values, potential = POTENTIALS[name]
    rig = {**FRICTIONLESS, "b1": 0.0, "b2": 0.0}
    x1, v1, x2, v2 = states({**rig, **values}, np.zeros(4001), start=(12.0, 60.0, 0.0, -20.0), physics_step=5e-4)
    total = energy(rig, x1, v1, x2, v2) + potential(x1, x2, x1 - x2)
    # a kink inside a step costs the integrator its order there
    tolerance = 2e-4 if name in {"coil_bind", "coupling_backlash"} else 1e-5
    assert np.ptp(total) < tolerance * np.ptp(potential(x1, x2, x1 - x2))


@each(
    ("values", "stored"),
    [
        ({"presliding.cart_1.fd": 0.3, "presliding.cart_1.xs": 0.5}, 0.3 * 0.5 / 2),
        ({"spring_hysteresis.level": 0.1, "spring_hysteresis.xs": 2.0}, 0.1 * 2.0 / 2),
    ],
)
def test_bristles_give_back_no_more_than_they_store(values, stored):
    rig = {**FRICTIONLESS, "b1": 0.0, "b2": 0.0}
    states_ = states({**rig, **values}, np.zeros(4001), start=(12.0, 0.0, 0.0, 0.0))
    e = energy(rig, *states_)
    lowest_so_far = np.minimum.accumulate(e)
    assert np.all(e <= lowest_so_far + stored + 1e-6)
    assert e[-1] < 0.5 * e[0]


@each("zeta", [0.0, 0.1])
def test_appendages_never_add_energy(zeta):
    rig = {**FRICTIONLESS, "b1": 0.0, "b2": 0.0}
    own = {"extra_mode.mass_1": 8e-5, "extra_mode.mass_2": 4e-5, "extra_mode.zeta": zeta, "extra_mode.frequency": 12.0}
    x1, v1, x2, v2 = states({**rig, **own}, np.zeros(4001), start=(12.0, 60.0, 0.0, -20.0))
    e = energy(rig, x1, v1, x2, v2)
    at_start = e[0] + 0.5 * (8e-5 * 60.0**2 + 4e-5 * 20.0**2)  # appendages move with their carts
    assert np.all(e <= at_start * (1 + 1e-4))
    assert (e[-1000:].max() > 0.97 * at_start) == (zeta == 0.0)


@each(("effect", "where"), INSTANCES, ids=NAMES)
def test_mirror_symmetry_holds_exactly_where_it_should(effect, where):
    values = {**RIG, **start_values(effect, where)}
    # the parts that make a ripple lopsided about x = 0: a force must be odd, a level of friction even
    lopsided = {"cogging": ("a_cos",), "position_friction": ("a_sin", "slope")}.get(effect.id, ())
    values.update({effect.key(where, name): 0.0 for name in lopsided})
    mirrored = np.array_equal(states(values, HARD), -states(values, -HARD))
    assert mirrored == (effect.id not in EVEN)


@each(("effect", "where"), INSTANCES, ids=NAMES)
def test_a_millisecond_is_fine_enough(effect, where):
    values = {**RIG, **start_values(effect, where)}
    coarse, fine = states(values, HARD), states(values, HARD, physics_step=1.25e-4)
    kinks = effect.id in {"coupling_backlash", "coil_bind", "motor_gear_backlash", "presliding"}
    assert np.abs(coarse - fine)[[1, 3]].max() <= (1e-3 if kinks else 2e-5) * np.abs(fine[[1, 3]]).max()


@each(
    ("effect", "where"),
    [
        pytest.param(*i, id=name)
        for i, name in zip(INSTANCES, NAMES, strict=True)
        # a rigid drive has no spring that could press a cart on its rail
        if i[1] not in {"cart_2", "spring"} and i[0].id != "load_friction"
    ],
)
def test_a_rigid_drive_has_it_too(effect, where):
    rig = {"m1": 1.1e-3, "b1": 0.0127, "d1": 0.6}
    # a cart that is driven hard never rests, and what holds a resting one does nothing then
    differs = []
    for u in (HARD, 0.25 * HARD):
        run, plain = (Drive(v).simulate(T, u) for v in ({**rig, **start_values(effect, where)}, rig))
        assert np.all(np.isfinite(run.v1))
        differs.append(np.abs(run.v1 - plain.v1).max() > 1e-6)
    assert any(differs)


@each(("effect", "where"), INSTANCES, ids=NAMES)
def test_a_size_grows_from_nothing(effect, where):
    # a hundredth of the size does about a hundredth of the harm, so a sensitivity at null means something
    sizes = [q for q in effect.parameters if q.role == "size"]
    assert sizes
    u, start = STICK_SLIP if effect.id == "breakaway" else HARD, (0.0, 0.0, 0.0, 0.0)
    if (effect.id, where) == ("breakaway", "cart_1"):
        # a held command jumps by more than a small breakaway; the spring of a moving cart 2 does not
        u, start = np.zeros_like(T), (0.0, 0.0, 0.0, 150.0)
    for q in sizes:
        # a detail of a law is nothing by itself
        whole = {effect.key(where, s.name): s.starts[0] for s in sizes if q.finer and not s.finer}
        others = {effect.key(where, s.name): s.starts[0] for s in effect.parameters if s.role == "shape"}
        key, rig = effect.key(where, q.name), {**RIG, **whole, **others}
        plain = states(rig, u, start=start)
        runs = [states({**rig, key: q.starts[0] * f}, u, start=start) for f in (1.0, 0.01)]
        change = [np.abs(run - plain).max() for run in runs]
        assert 0.0 < change[1] < 0.1 * change[0]


def test_shapes_alone_leave_the_fast_variant():
    shapes = {"stribeck.cart_1.vs": 20.0, "cogging.P": 5.0, "extra_mode.frequency": 50.0}
    assert parameters.workspace(shapes) is None
    assert parameters.substeps(shapes, 5e-3, 5e-3) == 1
    assert set(Drive({**RIG, **shapes, "stribeck.cart_1.vs": 40.0}).values) == {*RIG, *shapes}


@each(
    ("effect", "where"),
    # a drive with others is linear between events, and goes by its table there
    [
        pytest.param(*i, id=name)
        for i, name in zip(INSTANCES, NAMES, strict=True)
        if not {"command", "breakaway"} & set(i[0].hooks)
    ],
)
def test_what_has_nothing_to_do_is_left_out_to_the_last_bit(effect, where):
    """Chains without work are skipped; beside a spring too weak to change any digit they are not, and nothing else changes."""
    with_it = {**RIG, **start_values(effect, where)}
    weak = "hardening_spring.k3" if effect.id != "hardening_spring" else "asymmetric_spring.k2"
    beside = {**with_it, weak: 1e-300}
    for u in (HARD, STICK_SLIP):
        assert np.array_equal(states(with_it, u), states(beside, u))
