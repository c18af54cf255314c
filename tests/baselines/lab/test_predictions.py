"""Predictions follow from the drive, and agree with what statics say."""

import numpy as np
import pytest

from baselines.lab.predictions import predictions
from baselines.lab.uncertainty import settled_error
from flexdrive_gym import Covariance, Drive
from identification.mismatch.answer.finding import Finding
from tests.drive.drives import FRICTIONLESS, RIG
from tests.identification.mismatch.lab import diagnosis


def test_without_friction_p_control_settles_on_the_reference():
    assert settled_error(Drive({**FRICTIONLESS, "b1": 0.02}), gain=0.02) == pytest.approx(0.0, abs=0.5)


def test_with_friction_it_rests_within_the_friction_over_the_gain():
    error = settled_error(Drive(RIG), gain=0.05)
    assert 0.0 < error <= (RIG["d1"] + RIG["d2"]) / 0.05


def test_every_figure_is_there_before_and_after():
    finding = Finding("hardening_spring", "spring", {}, (), None, 0.5, 0.001, 9.0, 5.0)
    stiff = Drive({**RIG, "k": 2.0 * RIG["k"]})
    found = predictions(diagnosis(drive=stiff, findings=(finding,)), draws=0)
    by = {p.name: p for p in found}
    limit = by["critical_gain_x2_linear"]
    # Routh's limit of the non-collocated loop grows with the stiffness
    assert limit.after.value > limit.before.value == pytest.approx(Drive(RIG).linear.routh_critical_gain("x2"))
    assert by["resonance_hz"].after.value == pytest.approx(2**0.5 * by["resonance_hz"].before.value, rel=0.02)
    assert by["critical_gain_x2_simulated"].before.value > limit.before.value
    assert all(p.before.ci95 is None for p in found)


def test_the_interval_is_that_of_the_drawn_drives():
    spread = Covariance(("k",), np.array([[(0.05 * RIG["k"]) ** 2]]))
    found = predictions(diagnosis(drive=Drive(RIG, covariance=spread)), draws=60, threads=1)
    resonance = next(p for p in found if p.name == "resonance_hz")
    # half the relative spread of the stiffness, two standard deviations to either side
    low, high = resonance.after.ci95
    assert np.log(high / low) == pytest.approx(4.0 * 0.5 * 0.05, rel=0.35)
    assert low < resonance.after.value < high


def test_one_cart_has_no_limit_and_no_resonance():
    rigid = Drive({"m1": 1e-3, "b1": 0.01, "d1": 0.3})
    found = predictions(diagnosis(drive=rigid, base=rigid))
    assert "resonance_hz" not in {p.name for p in found}
    by = {p.name: p for p in found}
    assert by["critical_gain_x1_linear"].after.value is None
    assert by["steady_error"].unit == "mm"
