"""Optima of the base model and of candidates."""

from dataclasses import replace

import pytest

from identification.mismatch.candidates.catalogue import catalogue
from identification.mismatch.fitting.fit import fit
from identification.mismatch.noise.estimate import first_noise
from identification.mismatch.selection.optima import fit_candidates, refit_base
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
    better, _ = refit_base(worse, base.metric, [(drag, nothing)])
    assert better.cost <= base.cost + 1.0
    assert set(better.values) == set(base.values)


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
