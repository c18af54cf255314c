"""Output error: what a recording counts, and bounds that rounding does not cross."""

import numpy as np

from identification.mismatch.fitting.fit import Coordinates, fit
from identification.mismatch.fitting.levels import Levels
from identification.mismatch.selection.levels import held_first
from tests.drive.drives import RIG
from tests.identification.mismatch.lab import bench_of, data_set


def test_a_recording_that_a_model_describes_badly_counts_as_for_the_other_one():
    with bench_of(data_set()[2:4]) as bench:
        good = np.ones(len(bench.valid))
        bad = good.copy()
        bad[bench.rows[0]] = 10.0
        alone, held = Levels.of(bench, bad), Levels.of(bench, bad, good)
        first = bench.rows[0]
        assert np.allclose(held.weights[first], Levels.of(bench, good).weights[first])
        assert np.all(held.weights[first] >= alone.weights[first])


def test_a_gap_is_not_closed_by_friction_of_the_wrong_size():
    """A fit from half the friction, with the gap that prediction errors found, ends at the rig and no higher than one at once."""
    truth = {**RIG, "coupling_backlash.g": 0.6}
    with bench_of(data_set({"coupling_backlash.g": 0.6})) as bench:
        start = {**truth, "d1": 0.5 * RIG["d1"]}
        names = ("m1", "m2", "b1", "b2", "d1", "d2", "k", "coupling_backlash.g")
        levels = Levels.of(bench, bench.residual(truth))
        held, at_once = held_first(bench, levels, start, names), fit(bench, levels, start, names)
    assert held.cost <= 1.001 * at_once.cost
    assert abs(held.values["coupling_backlash.g"] - 0.6) < 0.1
    assert abs(held.values["d1"] / RIG["d1"] - 1.0) < 0.1


def test_a_parameter_at_its_bound_is_within_it():
    c = Coordinates(["saturating_friction.cart_1.v0"], {"saturating_friction.cart_1.v0": 5.0})
    assert c.to(np.array([-100.0]), {})["saturating_friction.cart_1.v0"] >= 5.0
