"""Statistics over training seeds, against cases worked by hand and against scipy."""

import numpy as np
import pytest
from scipy.stats import bootstrap, mannwhitneyu

from baselines.evaluation.statistics import estimate_iqm, estimate_mean, interquartile_mean, probability_of_improvement

RNG = np.random.default_rng(3)


def test_the_interquartile_mean_is_the_mean_of_the_middle_half():
    assert interquartile_mean([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 100.0]) == pytest.approx((3 + 4 + 5 + 6) / 4)
    assert interquartile_mean([4.0, 1.0, 9.0]) == pytest.approx(14 / 3)  # a quarter of three, rounded down, is none
    assert estimate_iqm([[[1.0, 2.0], [3.0, 1e9]], [[0.0], [5.0]]]).value == pytest.approx(11 / 4)


def test_a_failed_seed_does_not_move_it():
    scores = RNG.normal(2.0, 0.1, (5, 40))
    scores[4] = np.inf
    found = estimate_iqm([scores])
    assert 1.9 < found.value < 2.2
    assert found.high > 1000.0  # but the interval knows that agents fail


def test_without_seeds_the_interval_is_scipys_over_the_drives():
    drives = RNG.normal(3.0, 1.0, 60)
    ours = estimate_mean([drives])
    theirs = bootstrap((drives,), np.mean, method="percentile", rng=np.random.default_rng(5)).confidence_interval
    assert ours.value == pytest.approx(drives.mean())
    assert (ours.low, ours.high) == pytest.approx((theirs.low, theirs.high), abs=0.06)


def test_seeds_that_differ_widen_the_interval_however_many_drives_there_are():
    seeds = np.array([1.0, 2.0, 3.0, 4.0, 5.0])
    scores = seeds[:, None] + RNG.normal(0.0, 0.01, (5, 500))
    found = estimate_mean([scores])
    # the mean of five draws from 1 … 5 has a standard deviation of sqrt(2/5)
    assert found.value == pytest.approx(3.0, abs=0.01)
    assert found.high - found.low == pytest.approx(2 * 1.96 * np.sqrt(2 / 5), rel=0.15)


def test_one_run_on_one_drive_has_no_interval():
    found = estimate_iqm([[[2.5]]])
    assert (found.value, found.low, found.high) == (2.5, 2.5, 2.5)
    assert str(estimate_iqm([])) == "–"


def test_improvement_by_hand():
    # on drive 1 both seeds are better, on drive 2 one is and one ties, on drive 3 none is
    found = probability_of_improvement([[[1.0, 2.0, 9.0], [0.0, 5.0, 9.0]]], [[3.0, 5.0, 8.0]])
    assert found.value == pytest.approx((1.0 + 0.75 + 0.0) / 3)
    assert 0.0 <= found.low <= found.value <= found.high <= 1.0
    assert probability_of_improvement([[[1.0]]], [[2.0]]).value == 1.0


def test_improvement_is_mann_whitneys_u_drive_by_drive():
    ours, theirs = RNG.normal(0.0, 1.0, (5, 8)), RNG.normal(0.3, 1.0, 8)
    u = [mannwhitneyu([y], x).statistic / 5 for x, y in zip(ours.T, theirs, strict=True)]
    assert probability_of_improvement([ours], [theirs]).value == pytest.approx(np.mean(u))


def test_what_is_no_number_is_left_out_in_pairs():
    found = probability_of_improvement([[[1.0, np.nan, 1.0]]], [[2.0, 0.0, np.nan]])
    assert found.value == 1.0
    assert estimate_iqm([[[np.nan, 4.0]]]).value == 4.0


def test_tables_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match=r"same drives, shape \(1, 3\); got \(1, 2\)"):
        probability_of_improvement([[[1.0, 2.0, 3.0]]], [[1.0, 2.0]])
    with pytest.raises(ValueError, match="must have the same seeds; got 1, 2"):
        estimate_iqm([[[1.0]], [[1.0], [2.0]]])
