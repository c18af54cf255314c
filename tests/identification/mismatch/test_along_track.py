"""A force that stands on the track is found although every run began anywhere, and none is found where there is none."""

from dataclasses import replace

import numpy as np
import pytest

from identification.mismatch.along_track import place_shapes
from identification.mismatch.chance import null_residuals
from identification.mismatch.crew import Crew
from identification.mismatch.settle import settle
from identification.mismatch.shapes import ALONG_TRACK
from identification.topology import TWO_CARTS
from tests.drive.drives import RIG
from tests.identification.mismatch.lab import pushed_run, short_day, workbench

DRAWS = 59
PLACES_MM = (0.0, 14.0, -9.0, 4.0, -20.0)


def held(run, begins):
    """The same run past a magnet 10 mm along the track, which draws cart 1 towards it within a few millimetres."""
    x = np.cumsum(run.v1) * 1e-3 + begins - 10.0
    push = np.zeros((2, len(run.u)))
    push[0] = -0.5 * x / 4.0 * np.exp(0.5 - 0.5 * (x / 4.0) ** 2)
    drawn = pushed_run(RIG, run.u, push, excitation=run.excitation)
    free = pushed_run(RIG, run.u, np.zeros_like(push))
    return replace(run, v1=run.v1 + drawn.v1 - free.v1, v2=run.v2 + drawn.v2 - free.v2)


def shapes_of(recordings):
    with Crew(2) as pool:
        bench = workbench(recordings, pool)
        model = settle(bench, RIG, TWO_CARTS.free)
        null = null_residuals(bench, model.values, np.random.default_rng(1), DRAWS)
        return {s.where: s for s in place_shapes(bench, model, null)}


def test_a_magnet_is_a_force_along_the_track_of_its_cart():
    day = [held(run, begins) for run, begins in zip(short_day(), PLACES_MM, strict=True)]
    found = shapes_of(day)
    assert list(found) == ["cart_1"]
    one = found["cart_1"]
    assert one.variable == ALONG_TRACK
    assert one.predicted > 0.3
    assert one.probability == pytest.approx(2 / (1 + DRAWS))
    # it draws towards a place: the force falls through nothing there, from where it is largest to where it is smallest
    high, low = one.knots[np.argmax(one.force)], one.knots[np.argmin(one.force)]
    assert 3.0 < low - high < 15.0


def test_a_level_track_has_none():
    assert shapes_of(short_day()) == {}
