"""The null distribution: multipliers, and p-values of data in which nothing is left out."""

import numpy as np
import pytest

from identification.diagnosis.null import Null, multipliers


@pytest.mark.parametrize("recordings", [6, 20])
def test_multipliers_have_mean_zero_and_variance_one(recordings):
    found = multipliers(20_000, recordings, 12, np.random.default_rng(0))
    assert np.allclose(found.mean(axis=0), 0.0, atol=0.05)
    assert np.allclose(found.var(axis=0), 1.0, atol=0.05)


def test_few_recordings_have_more_than_two_multipliers():
    assert len(np.unique(multipliers(500, 6, 12, np.random.default_rng(0)))) == 6
    assert len(np.unique(multipliers(500, 12, 12, np.random.default_rng(0)))) == 2


def test_p_value_is_the_share_of_draws_whose_largest_score_is_larger():
    name = ("stribeck", "cart_1")
    null = Null({name: 1.0}, {name: 2.0}, np.arange(99.0), {name: 0.0}, {name: 1.0}, np.arange(99.0))
    assert null.score(name, 5.0) == 2.0
    # 97 of 99 draws reach a score of 2
    assert null.p_value(name, 5.0) == pytest.approx(0.98)
    assert null.p_without_best(name, 1000.0) == pytest.approx(0.01)
