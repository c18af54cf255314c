"""Dry friction along a motion."""

import numpy as np
import pytest

from identification.mismatch.noise.friction import level_along
from tests.drive.drives import RIG
from tests.identification.mismatch.lab import KINDS, bench_of, data_set


@pytest.fixture(scope="module")
def run():
    with bench_of(data_set(kinds=KINDS[3:4])) as bench:
        yield bench.runs[0]


def test_coulomb_friction_is_the_same_everywhere(run):
    assert level_along(RIG, run, 1) == pytest.approx(np.full(len(run.u), RIG["d2"]))


def test_a_load_adds_its_share_of_the_springs_force(run):
    level = level_along({**RIG, "load_friction.cart_2.mu": 0.1}, run, 1)
    pull = RIG["k"] * np.abs(run.track[0] - run.track[1])
    assert level == pytest.approx(RIG["d2"] + 0.1 * pull)
    assert np.ptp(level) > 0.1 * RIG["d2"]
    assert level_along({**RIG, "load_friction.cart_2.mu": 0.1}, run, 0) == pytest.approx(np.full(len(run.u), RIG["d1"]))


def test_bristles_hold_what_presliding_has_taken_over(run):
    taken = {**RIG, "d1": 0.1, "presliding.cart_1.fd": 0.3, "presliding.cart_1.xs": 0.01}
    assert level_along(taken, run, 0) == pytest.approx(np.full(len(run.u), 0.4))
