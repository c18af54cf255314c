"""What null draws tell: rows and directions count for as much as they scatter in them."""

from dataclasses import replace

import numpy as np
import pytest

from identification.mismatch.noise.estimate import damped, first_noise
from identification.mismatch.noise.nuisance import directions
from identification.mismatch.noise.scatter import dispersed, scattered
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


def test_what_differs_from_run_to_run_is_not_counted_twice(bench):
    """It is damped already: rows that it alone scatters keep their weight, and what is beyond it loses it."""
    rng, found = np.random.default_rng(6), directions(bench, RIG)
    noise = replace(first_noise(bench, RIG), scale={d.group: 4.0 for d in found})
    noise = damped(noise, found)
    draws = np.zeros((len(bench.valid), 60))
    for rows in bench.rows:
        amplitude = np.array([4.0 * d.size * rng.standard_normal(60) for d in found])
        draws[rows] = np.column_stack([d.change[rows] for d in found]) @ amplitude
    quiet = np.zeros(len(bench.valid))
    weights = scattered(noise, draws, quiet, found).weights
    assert np.max(np.mean(noise.innovations(draws) ** 2, axis=1)) > 4.0
    assert np.mean(weights > 0.9) > 0.99
    assert np.min(scattered(noise, 10.0 * draws, quiet, found).weights) < 0.7
