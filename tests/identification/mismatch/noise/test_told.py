"""Amplitudes told beside changes that are millions of standard deviations, as around a drive whose second cart hardly holds."""

import numpy as np

from identification.mismatch.noise.told import inverse


def test_what_is_huge_does_not_hide_what_is_not():
    rng = np.random.default_rng(2)
    rows = rng.normal(size=(3000, 4))
    # two columns of 1e10 that are nearly one, whose products alone err by more than those of the others are
    rows[:, 1] = 1e10 * (rows[:, 0] + 1e-3 * rows[:, 1])
    rows[:, 0] *= 1e10
    residual = rows[:, 2:] @ [0.5, -0.2]
    told = inverse(rows.T @ rows + np.eye(4)) @ (rows.T @ residual)
    assert np.allclose(told[2:], [0.5, -0.2], atol=1e-2)


def test_round_off_of_a_difference_leaves_no_negative_information():
    """Where amplitudes of recordings explain a common change, what is left of its information is round-off of the whole."""
    left = np.array([[-3e6, 0.0], [0.0, 100.0]])
    found = inverse(left + np.eye(2), np.array([1e22, 200.0]))
    assert np.all(np.linalg.eigvalsh(found) > 0.0)
    assert np.isclose(found[1, 1], 1.0 / 101.0, rtol=1e-6)
