"""The drive in two lines of text."""

import re
import sys
from dataclasses import replace

import numpy as np

from flexdrive_gym.rendering import Renderer
from tests.each import each
from tests.rendering.frames import REST, STATES


class TestAnsi:
    @staticmethod
    def lines(frame):
        renderer = Renderer("ansi")
        renderer.add(frame)
        return renderer.render().split("\n")

    @each("frame", STATES.values(), ids=STATES)
    def test_is_two_lines_of_plain_characters(self, frame):
        rail, numbers = self.lines(frame)
        assert rail[0] == rail[-1] == "|"
        assert len(rail) == 79
        assert numbers.isascii()
        assert len(numbers) < 100

    def test_rest(self):
        rail, numbers = self.lines(replace(REST, xr=100.0))
        assert re.fullmatch(r"\|-+\[1]~{5}\[2]-+v-+\|", rail)
        assert numbers == "t = 0.000 s  x1 = 0.00 mm  x2 = 0.00 mm  xr = 100.00 mm  u = 0.00 V"

    def test_places_are_monotone_and_reach_both_ends(self):
        rails = [self.lines(replace(REST, x1=x, x2=x, xr=-x))[0] for x in np.linspace(-400.0, 400.0, 200)]
        for token in ("[1]", "[2]"):
            assert np.all(np.diff([rail.index(token[1]) for rail in rails]) >= 0)
        goals = [rail.index("v") for rail in rails if "v" in rail]
        assert len(goals) > 150
        assert np.all(np.diff(goals) <= 0)
        assert rails[0].startswith("|[1]")
        assert rails[-1].endswith("[2]|")

    def test_spring_stretches(self):
        counts = [self.lines(replace(REST, x2=x))[0].count("~") for x in (-30.0, 0.0, 60.0)]
        assert counts[0] < counts[1] < counts[2]

    def test_reference_at_cart_2_and_missing_channels(self):
        assert "v" not in self.lines(REST)[0]
        rail, numbers = self.lines(STATES["rigid"])
        assert "[2]" not in rail
        assert "~" not in rail
        assert "x2" not in numbers

    def test_needs_no_pygame(self, monkeypatch):
        monkeypatch.setitem(sys.modules, "pygame", None)
        assert self.lines(REST)
