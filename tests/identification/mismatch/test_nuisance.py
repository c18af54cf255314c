"""What differs between recordings of any rig."""

import numpy as np
import pytest

from identification.mismatch.noise import estimate
from identification.mismatch.nuisance import INSTANT, directions
from tests.drive.drives import RIG
from tests.identification.mismatch.lab import KINDS, bench_of, data_set


@pytest.fixture(scope="module")
def bench():
    with bench_of(data_set(kinds=KINDS[2:5])) as made:
        yield made


def test_a_command_may_fall_anywhere_within_a_sample(bench):
    (instant,) = [d for d in directions(bench, RIG) if d.group == "sampling instant"]
    assert instant.size == pytest.approx(INSTANT)
    # to first order a delay is minus the rate of the motion
    h = bench.runs[0].sample_time
    late = bench.residual({**RIG, "input_delay.tau": 0.3 * h}) - bench.residual(RIG)
    assert np.linalg.norm(late - 0.3 * instant.change) < 0.2 * np.linalg.norm(late)


def test_every_cart_has_its_own_friction_and_ripples(bench):
    groups = {d.group for d in directions(bench, RIG)}
    assert {"friction of cart 1", "friction of cart 2", "wander", "rough track", "start deflection"} <= groups


def test_no_clock_is_off_by_more_than_its_sample(bench):
    found = directions(bench, RIG)
    (instant,) = [d for d in found if d.group == "sampling instant"]
    late = bench.residual({**RIG, "input_delay.tau": 8e-3})
    assert estimate(bench, RIG, late, found).scale["sampling instant"] <= 1.0
    assert instant.size < 0.5
