"""Fits of a drive to short runs whose parameters are known."""

import numpy as np
import pytest

from identification.mismatch.fit import fit
from identification.mismatch.noise import first_noise
from tests.drive.drives import RIG
from tests.identification.mismatch.lab import bench_of, data_set

NAMES = ("m1", "m2", "b1", "k", "d1")


@pytest.fixture(scope="module")
def bench():
    with bench_of(data_set(force=0.0)) as made:
        yield made


@pytest.fixture(scope="module")
def found(bench):
    start = {**RIG, "m1": 1.15 * RIG["m1"], "k": 0.9 * RIG["k"], "d1": 0.8 * RIG["d1"]}
    return fit(bench, first_noise(bench, RIG), start, NAMES)


def test_a_fit_finds_the_drive(found):
    for name in NAMES:
        assert found.values[name] == pytest.approx(RIG[name], rel=0.02)
    assert found.interior.all()


def test_derivatives_of_a_fit_nearby_lead_to_the_same_optimum(bench, found):
    start = {**found.values, "k": 1.05 * found.values["k"]}
    again = fit(bench, found.metric, start, (*NAMES, "b2"), near=found)
    assert again.cost <= 1.01 * found.cost
    assert again.values["k"] == pytest.approx(found.values["k"], rel=0.01)


def test_derivatives_are_those_at_the_optimum(bench, found):
    step = 1e-3 * found.values["k"]
    moved = bench.residual({**found.values, "k": found.values["k"] + step})
    slope = (moved - found.residual) / step * found.scale[NAMES.index("k")]
    own = found.jacobian[:, NAMES.index("k")]
    assert np.linalg.norm(slope - own) < 0.1 * np.linalg.norm(own)


def test_a_first_try_ends_when_steps_no_longer_help(bench, found):
    again = fit(bench, found.metric, found.values, NAMES, iterations=4, near=found)
    assert again.values["k"] == pytest.approx(found.values["k"], rel=1e-3)
    assert again.cost <= found.cost


def test_every_start_within_a_factor_of_three_ends_in_the_same_optimum(bench, found):
    rng = np.random.default_rng(0)
    far = np.exp(rng.uniform(-np.log(3.0), np.log(3.0), (12, len(NAMES))))
    for factors in far:
        start = {**RIG, **{n: RIG[n] * f for n, f in zip(NAMES, factors, strict=True)}}
        assert fit(bench, found.metric, start, NAMES).cost == pytest.approx(found.cost, rel=1e-3)
