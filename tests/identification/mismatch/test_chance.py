"""Null draws are made without keeping other threads from their work."""

import numpy as np
import pytest
from scipy.signal import lfilter

from identification.mismatch.chance import Chance, _all_along, _draw_force


def test_straight_lines_between_points_are_those_of_numpy():
    rng = np.random.default_rng(0)
    y, x = rng.standard_normal(50), rng.uniform(-20.0, 90.0, 1000)
    assert _all_along(x, (-3.0, 1.5, y)) == pytest.approx(np.interp(x, -3.0 + 1.5 * np.arange(50), y), abs=1e-12)


def test_a_drawn_force_is_the_sum_that_the_page_states():
    """F = -sgn(v)·d·(wander + rough track) + own friction, noise, slope and hills; at joints, straight between them."""
    rng = np.random.default_rng(2)
    n, step = 100, 3
    joints = np.arange(-(-n // step) + 1)
    way, steps, knots = rng.uniform(-9.0, 9.0, len(joints)), rng.standard_normal(5), rng.standard_normal(14)
    track, hills, slopes = (rng.standard_normal(21) for _ in range(3))
    sign, out, keep = rng.integers(-1, 2, n).astype(float), np.empty(n), 0.7
    tables = ((-10.0, 1.0, profile) for profile in (track, hills, slopes))
    _draw_force(step, way, keep, steps, 50, knots, 10, *tables, 0.3, 0.05, 0.1, 0.02, 0.04, 0.006, 0.5, 0.01, sign, out)
    slow = lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], steps)
    at, grid = joints * step, np.arange(-10.0, 11.0)
    wander, noise = np.interp(at / 50, np.arange(5), slow), np.interp(at / 10, np.arange(14), knots)
    friction = 0.3 * (0.05 * wander + 0.1 * np.interp(way, grid, track)) + 0.02
    push = 0.04 * noise + 0.006 * (np.interp(way, grid, slopes) - 0.5) + 0.01 * np.interp(way, grid, hills)
    t = np.arange(n)
    assert out == pytest.approx(np.interp(t, at, push) + sign * np.interp(t, at, friction), abs=1e-12)


def test_a_surprise_is_rare_if_few_draws_have_one_as_great():
    rng = np.random.default_rng(1)
    # one name feeds on chance, the other hardly
    gains = rng.uniform(0.0, 1.0, (199, 2, 1)) * np.array([0.2, 0.01])[:, None]
    luck = Chance.of([("cogging", "drivetrain"), ("tilt", "guide")], gains)
    assert luck.probability(("tilt", "guide"), [0.05]) == 1 / 200
    assert luck.probability(("cogging", "drivetrain"), [0.05]) > 0.9
    beyond = [max(luck.surprise(name, gain)) for gain in gains for name, gain in zip(luck.names, gain, strict=True)]
    assert luck.lucky < max(beyond)
    assert np.mean(np.max(np.reshape(beyond, (-1, 2)), axis=1) > luck.lucky) == pytest.approx(0.1, abs=0.02)
