"""Predictions with intervals: what the drive's uncertainty leaves, and where a prediction leaves what was recorded."""

import re

import control
import numpy as np
import pytest

from baselines.controllers.loop_shaping import stage
from baselines.lab.experiments import limit_in_the_lab
from baselines.lab.uncertainty import extrapolation, interval_in_words, loop_uncertainty, phase_margin, predict, reasons
from baselines.loop_analysis.margins import margins
from baselines.loop_analysis.stability_limit import critical_gain, critical_gain_near, critical_motion, observed_limit
from flexdrive_gym import Covariance, Drive
from flexdrive_gym.drive.drive import Recorded
from identification import identify, read_recordings
from tests.drive.drives import RIG
from tests.each import each

NAMES = ("m1", "m2", "k", "b1", "d1", "d2")
SPREAD = Covariance(NAMES, np.diag([(0.03 * RIG[n]) ** 2 for n in NAMES]))
CERTAIN = Drive({**RIG, "saturation.limit": 8.0})
DRIVE = CERTAIN.replace(covariance=SPREAD)
LINEAR = ["critical_gain_x2_linear", "resonance_hz"]


def test_interval_of_the_linear_limit_is_that_of_propagated_errors():
    found = predict(DRIVE, LINEAR, draws=1500)["critical_gain_x2_linear"]
    slopes = []
    for name in NAMES:
        up, down = (DRIVE.replace({name: RIG[name] * f}).linear.routh_critical_gain("x2") for f in (1.01, 0.99))
        slopes.append((up - down) / 0.02)
    error = 0.03 * np.linalg.norm(slopes)
    assert found.value == pytest.approx(DRIVE.linear.routh_critical_gain("x2"))
    assert np.diff(found.ci95)[0] == pytest.approx(2 * 1.96 * error, rel=0.1)
    assert found.median == pytest.approx(found.value, rel=0.01)
    assert found.draws == 1500


def test_friction_that_differs_between_runs_widens_what_friction_decides_and_nothing_else():
    wide = DRIVE.replace(run_to_run=Covariance(("d1", "d2"), np.diag([0.3, 0.3]) ** 2))
    names = ["critical_gain_x2_linear", "critical_gain_x2_simulated", "steady_error"]
    narrow, wider = (predict(d, names, draws=60) for d in (DRIVE, wide))
    assert wider["critical_gain_x2_linear"].ci95 == narrow["critical_gain_x2_linear"].ci95
    for name in names[1:]:
        assert np.diff(wider[name].ci95)[0] > 1.3 * np.diff(narrow[name].ci95)[0]


def test_answers_do_not_depend_on_threads_and_come_again():
    names = ["critical_gain_x2_simulated", "critical_gain_x2_trajectory"]
    assert predict(DRIVE, names, draws=6, threads=1) == predict(DRIVE, names, draws=6, threads=3)
    assert predict(DRIVE, LINEAR, draws=6, seed=1) != predict(DRIVE, LINEAR, draws=6, seed=2)


@each("factor", [1.0, 1.2, 0.5, 3.0])
def test_a_search_near_another_drives_limit_finds_the_same(factor):
    limit, lab = critical_gain(DRIVE), limit_in_the_lab(DRIVE)
    assert critical_gain_near(DRIVE, "x2", factor * limit) == pytest.approx(limit, rel=0.01)
    assert limit_in_the_lab(DRIVE, near=factor * lab) == pytest.approx(lab, rel=0.01)


def test_a_drive_without_a_limit_has_none_near_another():
    assert critical_gain_near(DRIVE, "x1", None) is None
    assert predict(DRIVE, ["critical_gain_x1_simulated"], draws=2)["critical_gain_x1_simulated"].ci95 == (None, None)


@each(("feedback", "gain"), [("x1", 0.05), ("x2", 0.05), ("x2", 0.3)])
def test_phase_margin_is_python_controls(feedback, gain):
    expected = control.margin(gain * DRIVE.linear.transfer_function(feedback))[1]
    assert phase_margin(DRIVE, feedback, gain) == pytest.approx(expected, abs=0.01)


def test_without_a_covariance_there_are_no_intervals():
    found = predict(CERTAIN, LINEAR)["resonance_hz"]
    assert (found.median, found.ci95, found.draws) == (None, None, 0)
    assert interval_in_words(found) == "–"


def test_an_unknown_figure_is_refused_by_name():
    with pytest.raises(ValueError, match=r"names: must be among .*resonance_hz.*; got 'resonance'"):
        predict(DRIVE, ["resonance"])


def test_one_cart_has_figures_of_its_own():
    rigid = Drive({"m1": 1e-3, "b1": 0.01, "d1": 0.3}, covariance=Covariance(("m1", "d1"), np.diag([1e-5, 0.01]) ** 2))
    found = predict(rigid, draws=5)
    assert set(found) == {"critical_gain_x1_linear", "critical_gain_x1_simulated", "phase_margin_x1", "steady_error"}
    assert found["steady_error"].ci95[0] > 0.0


def test_a_motion_beyond_the_recordings_extrapolates_and_says_why():
    limit = critical_gain(DRIVE)
    motion = critical_motion(DRIVE, limit, "x2")
    reached = float(np.abs(motion.u).max())
    far = Recorded(u=10.0, v=2000.0, deflection=200.0, slowest=0.5, fastest=20.0)
    assert extrapolation(DRIVE, motion) is None  # the drive does not know what was recorded
    assert extrapolation(DRIVE.replace(recorded=far), motion) is None
    near = DRIVE.replace(recorded=Recorded(2.0, 2000.0, 200.0, 0.5, 20.0))
    assert (
        extrapolation(near, motion)
        == f"In the predicted motion the command reaches {reached:.3g} V, 2 V were recorded."
    )
    slow = DRIVE.replace(recorded=Recorded(10.0, 2000.0, 200.0, 0.01, 0.5))
    # at the limit the loop vibrates near the crossing of the linear one, 14.5 rad/s
    assert "it vibrates at 2." in extrapolation(slow, motion)
    found = predict(near, ["critical_gain_x2_simulated", *LINEAR], draws=2)
    assert reasons(found.values()) == [
        f"Extrapolated: critical gain from x2, simulated. {found['critical_gain_x2_simulated'].extrapolated}"
    ]


def test_a_loop_keeps_its_margins_on_drives_like_its_own():
    design = stage("integral", DRIVE)
    found = loop_uncertainty(DRIVE, design.controller, draws=40)
    assert found.unstable == 0.0
    own = margins(DRIVE, design.controller)
    for name, (low, high) in found.ci95.items():
        assert low < getattr(own, name) < high
    # the loop gain at crossover goes with the mass, so 3 % of it are no more than a few per cent of the crossover
    assert np.diff(found.ci95["crossover"])[0] < 0.3 * own.crossover
    assert loop_uncertainty(CERTAIN, design.controller) is None


def test_open_loop_runs_alone_predict_the_gain_at_which_the_real_rig_rang(shared_recordings):
    runs = read_recordings(shared_recordings / "mte360_2022")
    drive = identify([r for r in runs if not r.closed_loop]).drive
    found = predict(drive, ["critical_gain_x2_trajectory"])["critical_gain_x2_trajectory"]
    low, high = found.ci95
    assert low <= observed_limit(runs).holds <= high
    assert observed_limit(runs).holds == pytest.approx(0.2345)
    assert high / low < 1.35


def test_the_second_rigs_limit_is_an_extrapolation(shared_recordings):
    runs = read_recordings(shared_recordings / "mte360_2025")
    drive = identify([r for r in runs if not r.closed_loop]).drive
    found = predict(drive, ["critical_gain_x2_simulated"], draws=0)["critical_gain_x2_simulated"]
    reached = re.search(r"the command reaches ([\d.]+) V, 2 V were recorded", found.extrapolated)
    assert float(reached[1]) > 4.0
