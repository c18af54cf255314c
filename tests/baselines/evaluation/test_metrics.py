"""Measures of runs whose answer is known."""

import numpy as np
import pytest

from baselines.evaluation.metrics import dwells, measure, measure_recording
from flexdrive_gym import Drive, PControl
from flexdrive_gym.references import handout_trajectory
from tests.drive.drives import RIG

DRIVE = Drive(RIG)
T = np.arange(4001) * 1e-3
XR = handout_trajectory(T)


def run(x2, u=None, v=None):
    zero = np.zeros_like(x2)
    v = zero if v is None else v
    return measure(DRIVE, XR, np.array([x2, v, x2, v]), zero if u is None else u, 1e-3, limit=8.0)


def test_the_handouts_trajectory_rests_after_every_move():
    found = dwells(XR, 1e-3)
    assert [d.move for d in found] == pytest.approx([50.0, -50.0, 50.0, -50.0])
    # 50 mm at 100 mm/s and 500 mm/s² take 0.7 s; the next move begins at the full second
    assert [d.begin * 1e-3 for d in found] == pytest.approx([0.7, 1.7, 2.7, 3.7], abs=2e-3)


def test_perfect_tracking():
    found = run(XR)
    assert (found.rms, found.peak, found.settling, found.overshoot, found.vibration) == (0.0, 0.0, 0.0, 0.0, 0.0)
    assert found.stable
    assert found.success


def test_a_constant_lag_is_rms_and_peak_and_never_settles():
    found = run(XR - 3.0)
    assert (found.rms, found.peak) == pytest.approx((3.0, 3.0))
    assert found.settling == np.inf
    assert found.stable
    assert not found.success


def test_overshoot_counts_in_the_moves_direction():
    beyond = XR.copy()
    first, second = dwells(XR, 1e-3)[:2]
    beyond[first.begin + 20] += 4.0  # above 50 after a move up
    beyond[second.begin + 20] += 9.0  # above 0 after a move down is no overshoot
    assert run(beyond).overshoot == pytest.approx(8.0)


def test_settling_is_when_the_band_is_entered_for_good():
    late = XR.copy()
    first = dwells(XR, 1e-3)[0]
    late[first.begin + 100] += 2.1
    assert run(late).settling == pytest.approx(0.101, abs=2e-3)


def test_vibration_is_energy_not_a_held_deflection():
    x1, still = XR + 2.0, np.zeros_like(XR)
    held = measure(DRIVE, XR, np.array([x1, still, XR, still]), still, 1e-3)
    assert held.vibration == 0.0
    moving = measure(DRIVE, XR, np.array([x1, still + 10.0, XR, still]), still, 1e-3)
    assert moving.vibration == pytest.approx(0.5 * RIG["m1"] * 100.0, rel=1e-9)


def test_growth_and_leaving_the_travel_are_unstable():
    assert not run(XR + 30.0 * (T / 4.0) ** 2 * np.sin(14.0 * T)).stable
    assert not run(XR + 300.0).stable
    assert not run(np.full_like(XR, np.nan)).stable


def test_effort_and_share_of_limited_samples():
    u = np.where(T < 1.0, 8.0, 0.0)
    found = run(XR, u)
    assert found.limited == pytest.approx(0.25, abs=1e-3)
    assert found.effort == pytest.approx(4.0, rel=1e-3)
    assert found.effort_peak == 8.0


def test_a_recording_is_measured_by_its_encoders():
    recording = DRIVE.simulate_closed_loop(T, XR, PControl(0.1))
    found = measure_recording(DRIVE, recording)
    assert found.rms == pytest.approx(np.sqrt(np.mean((XR - recording.x2) ** 2)))
    with pytest.raises(ValueError, match="needs xr"):
        measure_recording(DRIVE, DRIVE.simulate(T, np.zeros_like(T)))
