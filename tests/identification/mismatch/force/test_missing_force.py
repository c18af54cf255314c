"""The smoother finds a force that was put there."""

import numpy as np
import pytest

from flexdrive_gym.references import sine
from identification.mismatch.force.missing_force import missing_force
from tests.drive.drives import FRICTIONLESS, RIG
from tests.identification.mismatch.lab import pushed_run

N = 4001
T = np.arange(N) * 1e-3
U = sine(T, 2.5, 1.0)


@pytest.mark.parametrize("cart", [0, 1])
def test_a_known_force_is_found_on_its_cart(cart):
    push = np.zeros((2, N))
    push[cart] = 0.15 * np.sin(2 * np.pi * 1.7 * T)
    found = missing_force(FRICTIONLESS, pushed_run(FRICTIONLESS, U, push))
    inner = (found.t > 0.3) & (found.t < 3.7)
    expected = np.interp(found.t, T, push[cart])
    error = np.sqrt(np.mean((found.g[cart] - expected)[inner] ** 2))
    assert error < 0.1 * 0.15 / np.sqrt(2)
    assert np.sqrt(np.mean(found.g[1 - cart][inner] ** 2)) < 0.1 * 0.15 / np.sqrt(2)


def test_nothing_missing_is_found_as_nothing():
    found = missing_force(FRICTIONLESS, pushed_run(FRICTIONLESS, U, np.zeros((2, N))))
    assert np.max(np.abs(found.g[:, 50:-50])) < 0.01


def test_with_friction_a_force_is_found_where_the_carts_move():
    push = np.zeros((2, N))
    push[0] = 0.1
    found = missing_force(RIG, pushed_run(RIG, U, push))
    assert 0.5 < found.usable[0].mean() < 1.0
    # encoders start at zero wherever the spring is, so a constant force cannot be put on one cart: their sum is known
    both = found.usable.all(axis=0)
    assert found.g.sum(axis=0)[both].mean() == pytest.approx(0.1, abs=0.005)


def test_rest_says_nothing():
    found = missing_force(RIG, pushed_run(RIG, np.zeros(N), np.zeros((2, N))))
    assert not found.usable.any()
