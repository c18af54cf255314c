"""The stability limit of the handout, 2.1-2.4."""

from dataclasses import replace

import numpy as np
import pytest

from baselines.lab.experiments import p_control, stability_experiments
from baselines.loop_analysis.stability_limit import (
    critical_gain,
    explain,
    grows,
    observed_limit,
    stability_limit,
    swings,
)
from flexdrive_gym import Drive, LinearDrive
from tests.drive.drives import FRICTIONLESS, RIG

RIG_DRIVE = Drive({**RIG, "saturation.limit": 8.0})


def test_three_ways_to_the_linear_limit_agree():
    limit = stability_limit(RIG_DRIVE, "x2")
    assert limit.critical_gain_linear == pytest.approx(limit.critical_gain_margin, rel=1e-6)
    linear = RIG_DRIVE.linear
    # the imaginary crossing solved by hand for C = 0: w² = a3/a1, Kp = (a2 w² - w⁴)/n0
    _one, a1, a2, a3, _zero = linear.denominator
    w2 = a3 / a1
    assert limit.critical_gain_linear == pytest.approx((a2 * w2 - w2**2) / linear.numerator("x2")[-1], rel=1e-9)
    assert limit.vibration == pytest.approx(np.sqrt(w2), rel=1e-6)


def test_without_friction_the_simulated_limit_is_the_linear_one():
    # the criterion needs a swing of 25 mm within 12 s, and the sampled loop loses half a millisecond of phase
    drive = Drive(FRICTIONLESS)
    limit = stability_limit(drive, "x2")
    assert limit.critical_gain_simulated == pytest.approx(limit.critical_gain_linear, rel=0.03)


def test_friction_raises_the_limit_and_the_sentence_says_so():
    limit = stability_limit(RIG_DRIVE, "x2")
    assert limit.critical_gain_simulated > 1.1 * limit.critical_gain_linear
    assert "raises the limit" in explain(RIG_DRIVE, limit)


def test_collocated_loop_has_no_limit_in_linear_theory():
    limit = stability_limit(RIG_DRIVE, "x1")
    assert limit.critical_gain_linear is None
    assert limit.critical_gain_margin is None


def test_the_limit_separates_holding_from_growing():
    limit = critical_gain(RIG_DRIVE, "x2")
    below, above = swings(RIG_DRIVE, np.array([0.99 * limit, 1.01 * limit]), "x2")
    assert below <= 25.0 < above


def test_a_spring_that_softens_until_it_pushes_is_unstable_not_at_rest():
    # k δ + k3 δ³ turns round at 29 mm: what vibrates farther leaves all bounds, and its numbers with it
    k3 = -RIG["k"] / (3.0 * 29.0**2)
    soft = Drive({**RIG, "saturation.limit": 8.0, "hardening_spring.k3": k3})
    assert swings(soft, np.array([0.05, 1.0]), "x2").tolist() == [pytest.approx(0.0, abs=0.1), np.inf]
    assert critical_gain(soft, "x2") == pytest.approx(critical_gain(RIG_DRIVE, "x2"), rel=0.1)
    assert "2.3" in stability_experiments(soft)


def test_rigid_drive_is_stable_from_its_own_encoder():
    rigid = Drive({"m1": 1.1e-3, "b1": 0.0127, "d1": 0.4})
    assert stability_limit(rigid, "x1").critical_gain_linear is None
    assert LinearDrive(1.1e-3, np.inf, 0.0127, 0.0, 0.0).routh_critical_gain("x1") == np.inf


def test_experiments_are_stable_critical_unstable_and_collocated():
    runs = stability_experiments(RIG_DRIVE)
    assert list(runs) == ["2.1", "2.2", "2.3", "2.4"]
    assert not grows(runs["2.1"])
    assert not grows(runs["2.2"])
    assert grows(runs["2.3"])
    assert not grows(runs["2.4"])
    assert runs["2.3"].excitation.gain > runs["2.2"].excitation.gain
    assert runs["2.4"].excitation.gain == pytest.approx(runs["2.3"].excitation.gain)
    assert runs["2.1"].n == 4001


def test_growth_is_seen_in_a_recording():
    limit = critical_gain(RIG_DRIVE, "x2")
    runs = [p_control(RIG_DRIVE, factor * limit, "x2") for factor in (0.3, 1.3)]
    runs = [replace(r, excitation=replace(r.excitation, limit=8.0)) for r in runs]
    observed = observed_limit(runs)
    assert observed.holds == pytest.approx(0.3 * limit)
    assert observed.grows == pytest.approx(1.3 * limit)


def test_predicted_limit_of_the_real_rig_is_nearer_than_the_linear_one(shared_recordings):
    from identification.likelihood import identify_by_likelihood
    from identification.recordings import read_recordings

    runs = read_recordings(shared_recordings / "mte360_2022")
    limit = stability_limit(identify_by_likelihood(runs).drive, "x2")
    observed = observed_limit(runs)
    assert observed.holds == pytest.approx(0.2345, rel=1e-3)
    assert observed.grows == pytest.approx(0.235, rel=1e-3)
    assert abs(limit.critical_gain_simulated - 0.2345) < abs(limit.critical_gain_linear - 0.2345)
