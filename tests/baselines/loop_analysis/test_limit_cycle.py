"""The critical gain over amplitude: harmonic balance, its linear limit, and the simulated drive."""

import numpy as np
import pytest

from baselines.controllers.p_control import proportional
from baselines.lab.stability_study import study_stability
from baselines.loop_analysis.limit_cycle import limit_cycle, limit_cycle_curve, simulated_limit
from flexdrive_gym import Drive
from tests.drive.drives import FRICTIONLESS, RIG
from tests.each import each

UNIT = proportional(1.0)
RIG_DRIVE = Drive({**RIG, "saturation.limit": 8.0})


def test_without_friction_the_amplitude_does_not_matter():
    drive = Drive(FRICTIONLESS)
    for amplitude in (1.0, 10.0, 100.0):
        found = limit_cycle(drive, UNIT, amplitude)
        assert found.factor == pytest.approx(drive.linear.routh_critical_gain(), rel=5e-3)


def test_large_vibrations_feel_no_friction_small_ones_much():
    curve = limit_cycle_curve(Drive(RIG), UNIT, [3.0, 10.0, 30.0, 1000.0])
    factors = [s.factor for s in curve]
    assert factors == sorted(factors, reverse=True)
    assert factors[-1] == pytest.approx(Drive(RIG).linear.routh_critical_gain(), rel=0.02)


@each("amplitude", [12.0, 20.0, 32.0])
def test_simulation_confirms_harmonic_balance(amplitude):
    start = limit_cycle(RIG_DRIVE, UNIT, amplitude, limit=8.0)
    assert simulated_limit(RIG_DRIVE, UNIT, start) == pytest.approx(start.factor, rel=0.025)


def test_a_limited_command_cannot_feed_any_vibration():
    assert limit_cycle(RIG_DRIVE, UNIT, 80.0, limit=8.0).factor == np.inf
    assert np.isfinite(limit_cycle(RIG_DRIVE, UNIT, 80.0).factor)


def test_amplitude_must_be_positive():
    with pytest.raises(ValueError, match="positive amplitude"):
        limit_cycle(RIG_DRIVE, UNIT, 0.0)


def test_a_student_finds_the_linear_limit_only_without_friction():
    study = study_stability(RIG_DRIVE)
    routh = study.limits["x2"].critical_gain_linear
    assert study.student > 1.2 * routh
    assert study.student_without_friction == pytest.approx(routh, rel=0.05)
    assert study.agreement < 0.03
    assert list(study.runs) == list(study.runs_without_friction) == ["2.1", "2.2", "2.3", "2.4"]


def test_a_student_on_the_identified_rig_finds_nearly_what_the_real_students_found(shared_recordings):
    from baselines.lab.experiments import limit_in_the_lab
    from identification.likelihood import identify_by_likelihood
    from identification.recordings import read_recordings

    drive = identify_by_likelihood(read_recordings(shared_recordings / "mte360_2022")).drive
    # they measured 0.2345 V/mm; Routh's gain of the same drive is a quarter below
    assert limit_in_the_lab(drive) == pytest.approx(0.2345, rel=0.12)
    assert drive.linear.routh_critical_gain() < 0.8 * 0.2345


def test_a_vibration_that_leaves_all_bounds_has_grown():
    soft = Drive({**RIG, "saturation.limit": 8.0, "hardening_spring.k3": -RIG["k"] / (3.0 * 40.0**2)})
    start = limit_cycle(soft, UNIT, 30.0, limit=8.0)
    assert simulated_limit(soft, UNIT, start) < 1.1 * simulated_limit(RIG_DRIVE, UNIT, start)
