"""Null draws are made without keeping other threads from their work."""

import numpy as np
import pytest

from identification.mismatch.chance import Chance, _between, _push


def test_straight_lines_between_points_are_those_of_numpy():
    rng = np.random.default_rng(0)
    y, x = rng.standard_normal(50), rng.uniform(-20.0, 90.0, 1000)
    assert _between(x, -3.0, 1.5, y) == pytest.approx(np.interp(x, -3.0 + 1.5 * np.arange(50), y), abs=1e-12)


def test_a_push_is_straight_between_its_joints_and_friction_has_a_sign():
    rng = np.random.default_rng(2)
    push, friction, sign, out = (
        rng.standard_normal(35),
        rng.standard_normal(35),
        rng.integers(-1, 2, 100),
        np.empty(100),
    )
    _push(3.0, push, friction, sign.astype(float), out)
    joints = 3.0 * np.arange(35)
    expected = np.interp(np.arange(100), joints, push) + sign * np.interp(np.arange(100), joints, friction)
    assert out == pytest.approx(expected, abs=1e-12)


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
