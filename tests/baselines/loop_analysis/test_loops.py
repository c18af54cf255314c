"""The sampled linear loop against python-control, against simulation, and its margins against trials."""

from dataclasses import dataclass

import control
import numpy as np
import pytest

from baselines.controllers import FAMILIES, design
from baselines.controllers.p_control import proportional
from baselines.loop_analysis.empirical_margins import empirical_margins
from baselines.loop_analysis.loops import closed_loop, is_stable, linear_part, loop_response, sampled_drive
from baselines.loop_analysis.margins import margins
from flexdrive_gym import DEFAULT_DRIVE, Drive, PControl
from flexdrive_gym.drive.batch.closed_loop import run_batch
from flexdrive_gym.references import handout_trajectory
from tests.drive.drives import FRICTIONLESS, RIG
from tests.each import each

LINEAR = Drive(FRICTIONLESS)
RIG_DRIVE = Drive({**RIG, "saturation.limit": 8.0})


def loop_gain(drive, controller):
    """The loop gain L(z), broken at the command, for negative feedback, by python-control."""
    A, B, C = sampled_drive(drive, controller.sample_time)
    plant = control.ss(A, B, C, np.zeros((drive.carts, 1)), controller.sample_time)
    return -controller.state_space()[0, 1 : 1 + drive.carts] * plant


def test_without_delay_it_is_python_controls_zero_order_hold():
    A, B, C = sampled_drive(LINEAR, 1e-3)
    theirs = control.sample_system(LINEAR.linear.state_space()[["x1", "x2"], "u"], 1e-3, "zoh")
    assert np.allclose(A, theirs.A, rtol=1e-12, atol=1e-14)
    assert np.allclose(B, theirs.B, rtol=1e-9)
    assert np.array_equal(C, theirs.C)


@each("tau", [0.0, 0.0004, 0.001, 0.0027, 0.003])
def test_any_delay_is_what_the_simulation_does(tau):
    drive = LINEAR.replace({"input_delay.tau": tau}) if tau else LINEAR
    u = np.random.default_rng(0).normal(size=300)
    A, B, C = sampled_drive(drive, 1e-3)
    x, seen = np.zeros(len(A)), []
    for command in u:
        seen.append(C @ x)
        x = A @ x + B[:, 0] * command
    run = drive.simulate(np.arange(300) * 1e-3, u)
    assert np.max(np.abs(np.array(seen)[:, 1] - run.x2)) < 1e-8


@each("name", ["lab4", "cascade", "lqg"])
def test_closed_loop_is_what_the_compiled_loop_does(name):
    controller = design(name, RIG_DRIVE).controller.replace(limit=np.inf)
    t = np.arange(1000) * 1e-3
    xr = handout_trajectory(t)
    push = np.where(t > 0.3, 0.4, 0.0)
    theirs = control.forced_response(closed_loop(RIG_DRIVE, controller), t, np.vstack([xr, push])).outputs
    ours = run_batch([LINEAR], xr, controller, disturbance=push)[0]
    assert np.max(np.abs(ours[2] - theirs[1])) < 1e-6
    assert np.max(np.abs(ours[4] - push - theirs[2])) < 1e-5


def test_response_is_python_controls():
    controller = design("integral", RIG_DRIVE).controller
    omega = np.geomspace(1.0, 500.0, 20)
    theirs = loop_gain(RIG_DRIVE, controller).frequency_response(omega).complex
    assert np.allclose(loop_response(RIG_DRIVE, controller, omega), theirs, rtol=1e-6)


def test_p_control_reaches_its_limit_at_rouths_gain():
    routh = RIG_DRIVE.linear.routh_critical_gain()
    found = margins(RIG_DRIVE, proportional(0.1))
    # half a sample of the hold costs 0.2 % of gain
    assert 0.1 * found.gain_margin == pytest.approx(routh, rel=5e-3)
    assert is_stable(RIG_DRIVE, proportional(0.99 * 0.1 * found.gain_margin))
    assert not margins(RIG_DRIVE, proportional(1.01 * 0.1 * found.gain_margin)).stable


def test_p_control_has_margins_and_a_black_box_has_none():
    assert margins(DEFAULT_DRIVE, PControl(0.05)) == margins(DEFAULT_DRIVE, proportional(0.05, "x2"))
    with pytest.raises(TypeError, match="must be a LinearController or PControl; got function"):
        margins(DEFAULT_DRIVE, lambda seen: seen.xr)


def test_margins_of_a_textbook_loop():
    # rigid drive, P-control, no friction: L = Kp/(s(ms + b)) crosses 1 where ω√(m²ω² + b²) = Kp
    m, b, Kp = 1e-3, 0.01, 0.2
    drive = Drive({"m1": m, "b1": b})
    omega = np.sqrt((-(b**2) + np.sqrt(b**4 + 4 * m**2 * Kp**2)) / (2 * m**2))
    lag = np.pi / 2 - np.arctan(m * omega / b)
    found = margins(drive, proportional(Kp, "x1"))
    assert found.crossover == pytest.approx(omega, rel=1e-3)
    assert np.deg2rad(found.phase_margin_deg) == pytest.approx(lag - 0.0005 * omega, rel=2e-3)
    assert found.delay_margin == pytest.approx(lag / omega - 0.0005, rel=2e-3)
    assert found.static_stiffness == pytest.approx(Kp, rel=1e-3)


def test_disk_margin_and_sensitivity_are_python_controls():
    controller = design("lead", RIG_DRIVE).controller
    omega = np.geomspace(1.0, 300.0, 400)
    found = margins(RIG_DRIVE, controller)
    sensitivity = 1.0 / (1.0 + loop_gain(RIG_DRIVE, controller).frequency_response(omega).complex)
    assert found.sensitivity_peak == pytest.approx(np.max(np.abs(sensitivity)), rel=2e-3)
    try:
        alpha, _gm, _pm = control.disk_margins(loop_gain(RIG_DRIVE, controller), omega)
    except (TypeError, IndexError, ValueError):
        pytest.skip("python-control's disk_margins fails on a single loop with this slycot")
    assert found.disk_margin == pytest.approx(alpha, rel=2e-3)


def test_integral_action_holds_any_steady_disturbance():
    assert margins(RIG_DRIVE, design("integral", RIG_DRIVE).controller).static_stiffness == np.inf
    assert margins(RIG_DRIVE, design("lead", RIG_DRIVE).controller).static_stiffness < 1.0


@pytest.mark.slow
@each("name", FAMILIES)
def test_margins_by_trial_agree_with_python_control(name):
    if name == "h_infinity":
        pytest.importorskip("slycot", reason="needs the extra control")
    controller = design(name, DEFAULT_DRIVE).controller
    analytic, trial = margins(DEFAULT_DRIVE, controller), empirical_margins(DEFAULT_DRIVE, controller)
    assert trial.gain_margin == pytest.approx(analytic.gain_margin, rel=0.02)
    assert trial.delay_margin == pytest.approx(analytic.delay_margin, rel=0.02)


@dataclass
class BlackBox:
    """P-control that nobody can look into."""

    gain: float

    def reset(self):
        pass

    def __call__(self, observation):
        return self.gain * (observation.xr - observation.x2)


def test_trials_need_nothing_but_the_protocol():
    found = empirical_margins(RIG_DRIVE, BlackBox(0.12), duration=6.0)
    analytic = margins(RIG_DRIVE, proportional(0.12))
    assert found.gain_margin == pytest.approx(analytic.gain_margin, rel=0.02)
    assert found.delay_margin == pytest.approx(analytic.delay_margin, rel=0.02)


def test_on_the_rig_friction_leaves_a_larger_margin():
    linear = empirical_margins(RIG_DRIVE, proportional(0.1), quantities=("gain",))
    full = empirical_margins(RIG_DRIVE, proportional(0.1), on="full", quantities=("gain",))
    assert full.gain_margin > 1.2 * linear.gain_margin
    assert np.isnan(full.delay_margin)


def test_a_loop_that_grows_has_no_margins():
    with pytest.raises(ValueError, match="grows as it is"):
        empirical_margins(RIG_DRIVE, proportional(0.5))


def test_linear_part_keeps_what_linear_theory_knows():
    assert dict(linear_part(RIG_DRIVE.replace({"input_delay.tau": 0.002})).values) == {
        **{k: v for k, v in RIG.items() if k not in {"d1", "d2"}},
        "input_delay.tau": 0.002,
    }
