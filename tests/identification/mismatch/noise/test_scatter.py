"""What null draws tell: a direction counts for as much as they scatter in it."""

import numpy as np
import pytest

from identification.mismatch.noise.estimate import first_noise
from identification.mismatch.noise.scatter import dispersed
from tests.drive.drives import RIG
from tests.identification.mismatch.lab import bench_of, data_set


@pytest.fixture(scope="module")
def bench():
    with bench_of(data_set()) as made:
        yield made


def test_simulations_that_scatter_widely_in_a_direction_tell_less_of_it(bench):
    rng = np.random.default_rng(5)
    n, noise = len(bench.valid), first_noise(bench, RIG)
    columns, rows = rng.normal(size=(n, 3)), bench.rows[0]
    draws = rng.normal(size=(n, 200))
    unchanged, same = dispersed(noise, columns, draws)
    assert all(not own.size for own in unchanged.spread)
    np.testing.assert_array_equal(same, draws)
    creeps = columns[rows, 0] / np.linalg.norm(columns[rows, 0])
    draws[rows] += 10.0 * np.outer(creeps, rng.normal(size=200))
    found, white = dispersed(noise, columns, draws)
    assert np.var(creeps @ white[rows]) == pytest.approx(1.0, abs=0.2)
    # the others tell what they told
    np.testing.assert_array_equal(white[bench.rows[1]], draws[bench.rows[1]])
    x = rng.normal(size=n)
    before, after = noise.white(x), found.white(x)
    assert creeps @ after[rows] == pytest.approx(0.1 * (creeps @ before[rows]), rel=0.2)
    np.testing.assert_array_equal(after[bench.rows[1]], before[bench.rows[1]])
