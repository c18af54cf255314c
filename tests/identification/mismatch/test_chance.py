"""Null draws are made without keeping other threads from their work."""

import numpy as np
import pytest

from identification.mismatch.chance import _between


def test_straight_lines_between_points_are_those_of_numpy():
    rng = np.random.default_rng(0)
    y, x = rng.standard_normal(50), rng.uniform(-20.0, 90.0, 1000)
    assert _between(x, -3.0, 1.5, y) == pytest.approx(np.interp(x, -3.0 + 1.5 * np.arange(50), y), abs=1e-12)
