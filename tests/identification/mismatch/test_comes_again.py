"""What was found is asked of recordings kept away: how much of it they show, and how much chance would."""

import pytest

from identification.mismatch.comes_again import KeptAway
from identification.mismatch.crew import Crew
from identification.mismatch.settle import settle
from identification.mismatch.shapes import free_shapes
from tests.drive.drives import RIG
from tests.identification.mismatch.lab import SHORT, short_day, workbench

NAMES = ("m1", "m2", "b1", "b2", "k", "d1", "d2")
HARDER = {"hardening_spring.k3": 1e-4}


@pytest.mark.parametrize("there", [0.0, 0.5, 1.0])
def test_recordings_show_as_much_of_a_finding_as_there_is(there):
    day = short_day({key: there * value for key, value in HARDER.items()})
    with Crew(2) as pool:
        again = KeptAway(day, pool).comes_again(RIG, {**RIG, **HARDER}, NAMES)
    for seen in again.values():
        assert seen.size == pytest.approx(there, abs=2.5 * seen.spread + 0.05)
        assert seen.too_small is (there < 1.0)
        assert (seen.probability < 0.02) is (there > 0.0)


def test_what_foretells_nothing_does_not_come_again():
    with Crew(1) as pool:
        again = KeptAway(short_day(kinds=SHORT[:2]), pool).comes_again(RIG, dict(RIG), NAMES)
    assert all(seen.probability == 1.0 for seen in again.values())


@pytest.mark.parametrize("k3", [0.0, 1e-4])
def test_a_free_shape_comes_again_if_it_is_a_force_of_the_rig(k3):
    with Crew(2) as pool:
        bench = workbench(short_day({"hardening_spring.k3": 1e-4}), pool)
        shapes = free_shapes(bench, settle(bench, RIG, NAMES))
        cubic = next(s for s in shapes if (s.where, s.variable) == ("cart_1", "δ"))
        others = short_day({"hardening_spring.k3": k3}, kinds=(("square", 1.8, 0.8), ("sine", 2.5, 3.0)))
        seen = KeptAway(others, pool).shape_comes_again(RIG, cubic, NAMES)["comparable"]
    assert (seen.probability < 0.01) is (k3 > 0.0)
    assert seen.size == pytest.approx(1.0 if k3 else 0.0, abs=2.5 * seen.spread + 0.1)
