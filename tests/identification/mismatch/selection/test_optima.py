"""Optima of the base model and of candidates."""

from dataclasses import replace

import numpy as np
import pytest

from identification.mismatch.candidates.catalogue import catalogue
from identification.mismatch.fitting.fit import fit
from identification.mismatch.noise.estimate import first_noise
from identification.mismatch.selection.optima import (
    carried_over,
    contained,
    fit_candidates,
    imitating,
    refit_base,
    without,
)
from identification.topology import TWO_CARTS
from tests.drive.drives import RIG
from tests.identification.mismatch.lab import KINDS, bench_of, data_set

CANDIDATES = catalogue(TWO_CARTS, {}, None)


@pytest.fixture(scope="module")
def base():
    with bench_of(data_set(kinds=KINDS[2:4])) as bench:
        yield fit(bench, first_noise(bench, RIG), RIG, TWO_CARTS.free, iterations=2)


def test_a_start_that_no_simulation_resolves_is_left_out(base):
    backlash = next(c for c in CANDIDATES if c.name[0] == "motor_gear_backlash")
    rotor = {"motor_gear_backlash.mass": 1e-15, "motor_gear_backlash.gap": 0.8, "motor_gear_backlash.kc": 20.0}
    assert fit_candidates(base, base.metric, [(backlash, {**base.values, **rotor})]) == {}


def test_a_better_optimum_of_the_base_model_is_no_gain_of_a_candidate(base):
    drag = next(c for c in CANDIDATES if c.name == ("quadratic_drag", "cart_1"))
    nothing = fit(base.bench, base.metric, {**base.values, drag.keys[0]: 0.0}, (*base.names, *drag.keys))
    worse = replace(base, cost=base.cost + 100.0)
    better = refit_base(worse, base.metric, [(drag, nothing)])
    assert better.cost <= base.cost + 1.0
    assert set(better.values) == set(base.values)


def test_candidates_follow_the_base_model_to_a_better_optimum(base):
    drag = next(c for c in CANDIDATES if c.name == ("quadratic_drag", "cart_1"))
    better = fit(base.bench, base.metric, base.values, base.names)
    far = {**base.values, "k": 3.0 * base.values["k"], drag.keys[0]: 1e-5}
    behind = fit(base.bench, base.metric, far, (*base.names, *drag.keys), iterations=1)
    assert behind.cost > better.cost
    found = carried_over(base, better, base.metric, {drag.name: (drag, behind)})
    assert found[drag.name][1].cost < better.cost
    assert carried_over(base, base, base.metric, {drag.name: (drag, behind)}) == {drag.name: (drag, behind)}


def test_no_candidate_is_worse_than_the_model_it_contains(base):
    without = replace(TWO_CARTS, free=tuple(n for n in TWO_CARTS.free if n != "d1"))
    friction = next(c for c in catalogue(without, {}, None) if c.name == ("coulomb_friction", "cart_1"))
    plain = fit(base.bench, base.metric, {**base.values, "d1": 0.0}, without.free)
    # what holds the cart has no slope that leads back
    held = {**plain.values, "d1": 4.0}
    assert fit(base.bench, base.metric, held, (*plain.names, "d1")).cost > 10.0 * plain.cost
    _, found = fit_candidates(plain, plain.metric, [(friction, held)])[friction.name]
    assert found.cost < plain.cost


def test_candidates_are_compared_from_the_best_ones_base_parameters(base):
    drag, stribeck = (
        next(c for c in CANDIDATES if c.name == name) for name in (("quadratic_drag", "cart_1"), ("stribeck", "cart_1"))
    )
    far = {**base.values, "k": 30.0 * base.values["k"], "m2": 30.0 * base.values["m2"]}
    jobs = [(drag, {**base.values, **drag.start}), (stribeck, {**far, **stribeck.start})]
    found = fit_candidates(base, base.metric, jobs)
    assert found[stribeck.name][1].cost < 1.05 * found[drag.name][1].cost


def test_a_motor_behind_a_gap_is_found_from_a_base_model_that_counts_it_to_the_cart():
    """A first try from the split mass leads to the gap; from the whole one it is as much too heavy as the motor is."""
    truth = {
        "motor_gear_backlash.mass": 0.4 * RIG["m1"],
        "motor_gear_backlash.gap": 0.3,
        "motor_gear_backlash.kc": 30.0,
    }
    motors = [c for c in CANDIDATES if c.behind_gap]
    assert {c.id for c in motors} == {"motor_gear_backlash"}
    with bench_of(data_set(truth, rig={**RIG, "m1": 0.6 * RIG["m1"]}, kinds=KINDS[2:5])) as bench:
        whole = fit(bench, first_noise(bench, RIG), RIG, TWO_CARTS.free)
        split = [(c, c.beside(whole.values, c.start)) for c in motors]
        heavy = [(c, {**whole.values, **c.start}) for c in motors]
        _, found = fit_candidates(whole, whole.metric, split)["motor_gear_backlash", "drivetrain"]
        fits = [
            [fit(bench, whole.metric, v, (*whole.names, *c.keys), iterations=4) for c, v in jobs]
            for jobs in (split, heavy)
        ]
        # the squared error of velocities, whatever the noise is held to be
        first, other = (min(float(np.sum(bench.residual(f.values)[bench.valid] ** 2)) for f in each) for each in fits)
    assert found.values["motor_gear_backlash.gap"] == pytest.approx(0.3, rel=0.1)
    assert first < 0.7 * other


def test_a_cart_gets_back_the_mass_that_a_candidate_had_taken():
    motor = next(c for c in CANDIDATES if c.behind_gap)
    drive = motor.beside(RIG, motor.start)
    assert drive["m1"] == pytest.approx(RIG["m1"] - motor.start["motor_gear_backlash.mass"])
    assert without(motor, drive, TWO_CARTS.free)["m1"] == pytest.approx(RIG["m1"])
    # a motor heavier than all that moves leaves the cart something
    assert motor.beside(RIG, {"motor_gear_backlash.mass": 1.0})["m1"] > 0.0


def test_a_look_alike_begins_where_it_does_what_the_leader_does():
    """To carts that move together one constant force is the same on either of them (Newton's second law of both)."""
    pull, offset = (next(c for c in CANDIDATES if c.id == id_) for id_ in ("tilt", "input_offset"))
    names = ("m1", "b1", "d1", "k")
    with bench_of(data_set({"tilt.F": 0.12}, kinds=KINDS[2:5], force=0.0)) as bench:
        noise = first_noise(bench, RIG)
        plain = fit(bench, noise, RIG, names)
        there = fit(bench, noise, {**plain.values, "tilt.F": 0.05}, (*names, "tilt.F"))
        starts = {c.name: v for c, v in imitating(plain, noise, CANDIDATES, pull, there)}
    assert starts[offset.name]["m1"] == pytest.approx(there.values["m1"])
    assert starts[offset.name]["input_offset.u0"] == pytest.approx(0.12, rel=0.1)
    assert "tilt.F" not in starts[offset.name]


def test_what_acts_in_no_proportion_to_its_size_is_not_imitated(base):
    bind = next(c for c in CANDIDATES if c.behind_gap)
    there = replace(base, values={**base.values, **bind.start})
    assert imitating(base, base.metric, CANDIDATES, bind, there) == []


def test_what_a_model_contains_is_taken_without_what_else_it_has(base):
    spring = next(c for c in CANDIDATES if c.keys == ("ground_spring.kg",))
    richer = replace(base, values={**base.values, "ground_spring.kg": 0.01, "ground_spring.kg3": 1e-6})
    starts = [v for c, v in contained(base, richer, CANDIDATES) if c.keys == spring.keys]
    assert starts == [{**base.values, "ground_spring.kg": 0.01}]
