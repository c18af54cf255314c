"""Output error: what a recording counts, and bounds that rounding does not cross."""

import numpy as np

from identification.mismatch.fitting.fit import Coordinates
from identification.mismatch.selection.levels import Levels
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


def test_a_parameter_at_its_bound_is_within_it():
    c = Coordinates(["saturating_friction.cart_1.v0"], {"saturating_friction.cart_1.v0": 5.0})
    assert c.to(np.array([-100.0]), {})["saturating_friction.cart_1.v0"] >= 5.0
