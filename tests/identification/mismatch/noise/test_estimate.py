"""Unknown forces of a data set, and what they must not take over."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from identification.mismatch.fitting.fit import fit
from identification.mismatch.noise.estimate import estimate, first_noise, of_most, with_usual_forces
from tests.drive.drives import RIG
from tests.identification.mismatch.lab import bench_of, data_set


@pytest.fixture(scope="module")
def bench():
    with bench_of(data_set()) as made:
        yield made


def test_forces_of_a_usual_size_are_left_as_they_are(bench):
    noise = estimate(bench, RIG, bench.residual(RIG), ())
    assert max(noise.forces.slow) < 0.1
    assert with_usual_forces(noise) is None


def test_forces_at_the_most_they_may_be_are_made_small(bench):
    noise = first_noise(bench, RIG)
    command = np.sqrt(np.mean(np.concatenate([run.u for run in bench.runs]) ** 2))
    most = replace(noise, forces=replace(noise.forces, slow=(0.1 * command, 0.0)))
    small = with_usual_forces(most)
    assert small is not None
    assert max(small.forces.slow) < 0.5 * max(most.forces.slow)
    assert small.forces.white == most.forces.white


@pytest.mark.parametrize("level", [0.3, 3.0])
def test_forces_at_the_most_they_may_be_are_unusual_however_large_friction_is(bench, level):
    """A rig that friction holds most of the time hides a constant force in them as well."""
    noise = first_noise(bench, {**RIG, "d1": level, "d2": level})
    command = np.sqrt(np.mean(np.concatenate([run.u for run in bench.runs]) ** 2))
    most = replace(noise, forces=replace(noise.forces, slow=(0.1 * command, 0.0)))
    assert np.allclose(of_most(most)[1], (1.0, 0.0))
    small = with_usual_forces(most)
    assert small is not None
    assert max(small.forces.slow) <= 0.5001 * max(most.forces.slow)


def test_what_was_left_out_makes_a_residual_less_probable():
    with bench_of(data_set({"input_offset.u0": 0.15})) as bench:
        without, with_ = (
            estimate(bench, values, bench.residual(values), ()) for values in (RIG, {**RIG, "input_offset.u0": 0.15})
        )
    assert with_.cost < without.cost - 100.0


def test_recordings_whitened_side_by_side_are_the_same(bench):
    noise = first_noise(bench, RIG)
    x = np.random.default_rng(0).normal(size=(len(bench.valid), 3))
    with ThreadPoolExecutor(2) as pool:
        np.testing.assert_array_equal(noise.white(x, pool.map), noise.white(x))
    np.testing.assert_array_equal(noise.white(x[:, 0]), noise.white(x)[:, 0])


def test_a_likelihood_that_is_no_number_is_an_error(bench):
    with pytest.raises(ValueError, match="recordings: their likelihood must be a number; got nan"):
        estimate(bench, RIG, np.full(len(bench.valid), np.nan), ())


def test_forces_that_nobody_knows_are_no_friction():
    """Of a drive that they shake rest is an outcome: who believes every rest of the data finds a seventh too much."""
    names, found = ("m1", "m2", "b1", "k", "d1", "d2"), []
    kinds = (("sine", 0.9, 0.5), ("sine", 1.2, 0.8), ("square", 1.0, 0.8), ("sine", 1.5, 1.2), ("sine", 2.0, 2.0))
    for seed in range(8):
        with bench_of(data_set(force=1.5, kinds=kinds, t=np.arange(5001) * 1e-3, first=100 * seed)) as bench:
            noise = estimate(bench, RIG, bench.residual(RIG), ())
            values = fit(bench, noise, RIG, names).values
            found.append(values["d1"] + values["d2"])
    assert np.mean(found) == pytest.approx(RIG["d1"] + RIG["d2"], rel=0.08)
