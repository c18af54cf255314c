"""Fits of a drive to short runs whose parameters are known."""

from types import SimpleNamespace

import numpy as np
import pytest

from identification.mismatch.fitting.fit import fit, gain_between, gain_of
from identification.mismatch.noise.estimate import first_noise
from identification.mismatch.settings import Settings
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


def _gain_where(shown, present, size=1.0):
    """Gain of one column that has information in some of twelve experiments and is present in some of them."""
    rng = np.random.default_rng(4)
    bench = SimpleNamespace(
        settings=Settings(), products=lambda white: np.array([w.T @ w for w in np.split(white, 12)])
    )
    column = rng.normal(size=(12, 200)) * np.isin(np.arange(12), shown)[:, None]
    residual = rng.normal(size=(12, 200)) + size * column * np.isin(np.arange(12), present)[:, None]
    whole = np.column_stack([column.ravel(), residual.ravel()])
    return gain_between(bench, whole[:, 1:], whole)


def test_what_only_two_experiments_can_show_counts():
    gain = _gain_where([0, 7], [0, 7])
    # half of 200 rows each, give or take
    assert 150.0 < gain.sum() < 250.0
    assert np.all(np.abs(np.delete(gain, [0, 7])) < 1e-9)


def test_what_one_experiment_alone_shows_is_no_property_of_a_rig():
    assert abs(_gain_where(range(12), [0]).sum()) < 5.0


def test_one_odd_experiment_does_not_hide_what_the_others_show():
    assert _gain_where(range(12), range(1, 12)).sum() > 700.0


def test_a_fit_gains_its_likelihood_ratio_less_its_parameters():
    """Leaving experiments out comes to that (M. Stone, 1977), and no experiment gains more than the two predictions differ by."""
    with bench_of(data_set(force=0.05)) as bench:
        noise = first_noise(bench, RIG)
        without = fit(bench, noise, {**RIG, "d2": 0.0}, [n for n in NAMES if n != "d2"])
        with_ = fit(bench, noise, without.values, (*without.names, "d2"))
        gain = gain_of(without, with_)
        apart = bench.sums(noise.white(without.residual - with_.residual)[:, None] ** 2)[:, 0]
    assert gain.sum() < 0.5 * (without.cost - with_.cost)
    assert (np.abs(gain) <= 0.5 * apart + 1e-9).all()
    assert gain.sum() > 0.25 * (without.cost - with_.cost)
