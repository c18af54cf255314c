"""Axes of the strip chart: round steps, all that was seen."""

from dataclasses import replace
from math import inf, nan

import pytest

from flexdrive_gym.rendering.chart import command_range, position_range
from flexdrive_gym.rendering.history import History
from flexdrive_gym.rendering.scale import Scale, round_out, round_step, text
from tests.each import each
from tests.rendering.frames import REST


class TestAxes:
    @staticmethod
    def history(x, u=0.0):
        history = History(4.0)
        history.add(replace(REST, x1=x, u=u))
        return history

    @each("x", [0.0, 3.0, -47.0, 230.0, -399.0, 800.0])
    def test_position_axis_shows_zero_and_all_that_was_seen(self, x):
        low, high = position_range(self.history(x), 400.0)
        assert low < min(x, 0.0)
        assert high > max(x, 0.0)
        assert (high > 400.0) == (x > 240.0)
        assert (low < -400.0) == (x < -240.0)

    @each("u", [0.0, 1.0, -7.9, 8.0, 20.0])
    def test_command_axis_is_symmetric_and_shows_all(self, u):
        largest = command_range(self.history(0.0, u), 8.0)
        assert largest > abs(u)
        assert (largest > 8.0) == (abs(u) > 4.8)
        assert command_range(self.history(0.0, u), inf) > abs(u)

    @each(("least", "step"), [(1.0, 1.0), (1.1, 2.0), (0.3, 0.5), (0.07, 0.1), (600.0, 1000.0)])
    def test_steps_are_round(self, least, step):
        assert round_step(least) == pytest.approx(step)

    def test_ticks_lie_within_and_ranges_widen_outward(self):
        assert Scale(-1.0, 1.0, 0.0, 100.0).ticks(4) == [-1.0, -0.5, 0.0, 0.5, 1.0]
        low, high = round_out(-47.0, 13.0)
        assert (low, high) == (-60.0, 20.0)
        scale = Scale(-10.0, 30.0, 400.0, 200.0)
        assert (scale(-10.0), scale(30.0), scale(10.0)) == (400.0, 200.0, 300.0)

    @each(
        ("value", "digits", "written"),
        [
            (-1.234, 2, "−1.23"),
            (-0.001, 2, "0.00"),
            (0.5, None, "0.5"),
            (-0.0, None, "0"),
            (nan, 2, "–"),
            (1e300, 2, "1e+300"),
            (-inf, 1, "–"),
        ],
    )
    def test_numbers_as_text(self, value, digits, written):
        assert text(value, digits) == written
