"""Maps show a function that is there, and say nothing of noise."""

import numpy as np
import pytest

from flexdrive_gym import Excitation, Recording
from identification.mismatch.force.maps import draw_maps, harmonics
from identification.mismatch.force.missing_force import MissingForce

N = 2000


def forces(function, *, noise=0.02, runs=5):
    """Missing force of cart 1 as a function of v1, with noise; cart 2 misses noise alone."""
    rng = np.random.default_rng(4)
    made = []
    for r in range(runs):
        t = np.arange(N) * 4e-3
        v = np.vstack(
            [150.0 * np.sin(2 * np.pi * (0.3 + 0.2 * r) * t), 120.0 * np.sin(2 * np.pi * (0.3 + 0.2 * r) * t - 1.0)]
        )
        g = noise * rng.normal(size=(2, N))
        g[0] += function(v[0])
        x = np.cumsum(v, axis=1) * 4e-3
        made.append(
            MissingForce(f"run {r}", t, np.zeros(N), x, v, g, np.full((2, N), noise), np.ones((2, N), dtype=bool))
        )
    return made


def hump(v):
    return -0.1 * np.sign(v) * np.exp(-((v / 40.0) ** 2))


def wave(v):
    return 0.06 * np.sin(v / 60.0)


def test_a_known_function_of_v1_is_recovered():
    first = draw_maps(forces(hump))[0]
    assert (first.where, first.variable) == ("cart_1", "v1")
    # away from the jump at rest, and within a bin's spread of the function
    away = np.abs(first.centre) > 15.0
    assert np.allclose(first.mean[away], hump(first.centre[away]), atol=0.01)


def test_the_share_explained_is_that_of_the_variances():
    noise = 0.03
    first = draw_maps(forces(wave, noise=noise))[0]
    signal = np.concatenate([wave(f.v[0]) for f in forces(wave)]).var()
    assert first.explained == pytest.approx(signal / (signal + noise**2), abs=0.04)


def test_noise_follows_nothing():
    maps = [m for m in draw_maps(forces(hump)) if m.where == "cart_2"]
    assert len(maps) == 7
    assert all(m.explained < 0.02 for m in maps)
    assert "is not predicted by" in maps[0].sentence


def test_harmonics_are_those_of_the_force():
    t = np.arange(2000) * 4e-3
    g = np.vstack([0.05 * np.sin(2 * np.pi * t) + 0.02 * np.cos(2 * np.pi * 2 * t), np.zeros(2000)])
    force = MissingForce("sine", t, t, g, g, g, g, np.ones((2, 2000), dtype=bool))
    run = Recording("sine", t, t, excitation=Excitation("sine", 2.5, 1.0))
    first = harmonics([force], [run])[0]
    assert first.amplitude == pytest.approx((0.05, 0.02, 0.0, 0.0, 0.0), abs=1e-4)
    assert first.even == pytest.approx(0.02**2 / (0.05**2 + 0.02**2), rel=0.01)
