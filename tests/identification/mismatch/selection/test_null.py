"""The null distribution: how rare gains are, p-values, and draws that look as the noise does."""

from dataclasses import replace

import numpy as np
import pytest

from identification.mismatch.noise.estimate import Forces, first_noise
from identification.mismatch.noise.scatter import scattered
from identification.mismatch.selection.null import Null
from tests.drive.drives import RIG
from tests.identification.mismatch.lab import bench_of, data_set


def test_rarity_is_the_share_of_draws_whose_largest_score_is_larger():
    name = ("stribeck", "cart_1")
    # one draw in ten gains 2, one in a hundred 20, as the index 1 has it: 200 is two decades beyond the first
    null = Null({name: (2.0, 1.0)}, np.arange(99.0))
    assert null.score(name, 200.0) == pytest.approx(2.0)
    assert null.score(name, 1.0) == -0.5
    # 97 of 99 draws reach a score of 2
    assert null.rarity(name, 200.0 * (1.0 - 1e-12)) == pytest.approx(0.98)
    assert null.rarity(name, 1e102) == pytest.approx(0.01)


def test_a_name_is_judged_by_its_own_draws():
    rng = np.random.default_rng(0)
    quiet, loud = ("tilt", "guide"), ("stribeck", "cart_1")
    null = Null.of({quiet: rng.exponential(1.0, 400), loud: 50.0 + 20.0 * rng.normal(size=400)})
    assert null.rarity(loud, 60.0) > 0.2
    assert null.rarity(quiet, 60.0) < 0.01


def test_the_gain_that_is_needed_is_the_least_significant_one():
    rng = np.random.default_rng(4)
    tilt, far = ("tilt", "guide"), ("ground_spring", "guide")
    null = Null.of({tilt: rng.exponential(1.0, 480), far: 9.0 * (rng.pareto(2.0, 480) + 1.0)})
    for name in (tilt, far):
        gain = null.needed(name, 0.01)
        assert null.p_value(name, gain * (1.0 + 1e-9)) <= 0.01
        assert null.p_value(name, gain * (1.0 - 1e-9)) > 0.01
    # of 50 draws none tells what happens in one of a hundred
    assert Null.of({tilt: np.ones(50)}).needed(tilt, 0.01) == np.inf


def test_a_name_with_a_heavy_tail_does_not_set_the_level_of_the_others():
    rng = np.random.default_rng(1)
    usual, heavy = ("encoder_delay", "encoder_2"), ("ground_spring", "guide")
    null = Null.of({usual: 5.0 * rng.exponential(1.0, 480), heavy: 2.0 * (rng.pareto(1.0, 480) + 1.0)})
    # some draws of the heavy one gain hundreds
    assert null.rarity(usual, 60.0) < 0.01
    assert null.rarity(heavy, 60.0) > 0.05


def test_the_index_of_a_tail_comes_from_every_draw_in_it():
    """Hill's estimate is that of a Pareto tail; few draws hardly move it from what half a chi-squared has."""
    rng = np.random.default_rng(3)
    name = ("tilt", "guide")
    assert Null.of({name: 2.0 * (rng.pareto(1.0, 4000) + 1.0)}).tail[name][1] == pytest.approx(1.0, abs=0.1)
    assert Null.of({name: np.zeros(120)}).tail[name] == (1.5, pytest.approx(0.4))


def test_rarities_of_data_in_which_nothing_is_left_out_are_uniform():
    rng = np.random.default_rng(2)
    names = [(f"effect {i}", "cart_1") for i in range(20)]

    def gains(n):
        shared = rng.exponential(1.0, n)
        return {
            k: rng.exponential(1.0 + i, n) + shared + (rng.pareto(1.5, n) if i % 4 == 0 else 0.0)
            for i, k in enumerate(names)
        }

    p = []
    for _ in range(300):
        null, data = Null.of(gains(240)), gains(1)
        p.append(min(null.rarity(k, float(g[0])) for k, g in data.items()))
    assert np.quantile(p, [0.1, 0.5, 0.9]) == pytest.approx([0.1, 0.5, 0.9], abs=0.06)
    assert np.mean(np.array(p) <= 0.02) <= 0.04


def test_a_p_value_is_no_smaller_than_a_likelihood_ratio_among_so_many_names_allows():
    """Draws are as good as the model of the noise; the best of n ratios reaches n / p in at most one data set in 1 / p."""
    names = [(f"effect {i}", "cart_1") for i in range(50)]
    null = Null(dict.fromkeys(names, (1.5, 0.4)), np.full(479, -1.0))
    gain = float(np.log(50 / 0.04))
    assert null.rarity(names[0], gain) == pytest.approx(1 / 480)
    assert null.p_value(names[0], gain) == pytest.approx(0.04)
    assert null.p_value(names[0], 1.0) == 1.0
    # and no smaller than draws resolve
    assert null.p_value(names[0], 100.0) == pytest.approx(1 / 480)


def test_a_blow_counts_no_more_than_the_edge_of_a_normal_distribution():
    with bench_of(data_set(force=0.0)[2:3]) as bench:
        noise = replace(first_noise(bench, RIG), forces=Forces((5e-3, 2e-3), (0.02, 0.01), 0.2))
        left = np.zeros(len(bench.valid))
        at = int(np.flatnonzero(bench.moves)[100])
        left[at] = 1e3
        quiet = np.zeros((len(left), 4))
        hit, before = (noise_.white(left)[at] for noise_ in (scattered(noise, quiet, left, ()), noise))
        assert abs(before) > 100.0
        assert abs(hit) == pytest.approx(4.2, rel=1e-6)
