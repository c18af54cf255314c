"""Sine and cosine are those of the library to round-off."""

import numba
import numpy as np

from flexdrive_gym.drive.compilation import OPTIONS
from flexdrive_gym.drive.simd.functions import sine_and_cosine
from tests.each import each


@numba.njit(**OPTIONS)
def _waves(x, sine, cosine):
    for i in range(len(x)):
        sine[i], cosine[i] = sine_and_cosine(x[i])


def _of(x):
    sine, cosine = np.empty_like(x), np.empty_like(x)
    _waves(x, sine, cosine)
    return sine, cosine


@each("far", [1.0, 1e2, 1e5])
def test_waves_are_exact_to_two_units_in_the_last_place_of_one(far):
    x = np.random.default_rng(0).uniform(-far, far, 100_000)
    sine, cosine = _of(x)
    assert np.max(np.abs(sine - np.sin(x))) <= 2.0 * np.finfo(float).eps
    assert np.max(np.abs(cosine - np.cos(x))) <= 2.0 * np.finfo(float).eps


def test_small_angles_are_their_own_sines():
    x = np.array([0.0, 1e-300, -1e-9, 1e-5])
    sine, cosine = _of(x)
    assert np.allclose(sine, np.sin(x), rtol=4e-16, atol=0.0)
    assert cosine[0] == 1.0


def test_what_is_no_angle_has_no_sine():
    sine, cosine = _of(np.array([np.nan, np.inf, -np.inf]))
    assert np.isnan([sine, cosine]).all()


def test_the_interpreter_gets_the_same():
    assert sine_and_cosine(0.0) == (0.0, 1.0)
