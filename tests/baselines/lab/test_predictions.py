"""Predictions follow from the drive, and agree with what statics say."""

import pytest

from baselines.lab.predictions import predictions, settled_error
from flexdrive_gym import Drive
from tests.drive.drives import FRICTIONLESS, RIG
from tests.identification.mismatch.lab import diagnosis


def test_without_friction_p_control_settles_on_the_reference():
    assert settled_error(Drive({**FRICTIONLESS, "b1": 0.02}), gain=0.02) == pytest.approx(0.0, abs=0.5)


def test_with_friction_it_rests_within_the_friction_over_the_gain():
    error = settled_error(Drive(RIG), gain=0.05)
    assert 0.0 < error <= (RIG["d1"] + RIG["d2"]) / 0.05


def test_every_figure_is_there_before_and_after():
    found = predictions(diagnosis(drive=Drive({**RIG, "k": 2.0 * RIG["k"]})))
    by = {p.name: p for p in found}
    limit = by["critical gain from x2, linear"]
    # Routh's limit of the non-collocated loop grows with the stiffness
    assert limit.after > limit.before == pytest.approx(Drive(RIG).linear.routh_critical_gain("x2"))
    assert by["resonance frequency"].after == pytest.approx(2**0.5 * by["resonance frequency"].before, rel=0.02)
    assert by["critical gain from x2, simulated"].before > limit.before


def test_one_cart_has_no_limit_and_no_resonance():
    rigid = Drive({"m1": 1e-3, "b1": 0.01, "d1": 0.3})
    found = predictions(diagnosis(drive=rigid, free=rigid))
    assert [p.unit for p in found] == ["mm"]
