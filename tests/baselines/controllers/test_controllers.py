"""Designs: Lab 4's numbers by hand, demands kept, and each family's own promise."""

import pickle

import control
import numpy as np
import pytest

from baselines.controllers import FAMILIES, Specification, design
from baselines.controllers._design import DEMANDS, count_jump
from baselines.controllers.h_infinity import coprime_stabiliser
from baselines.controllers.input_shaping import zero_vibration
from baselines.controllers.loop_shaping import design_lab_4, notch, refine
from baselines.controllers.lqg import _solved
from baselines.controllers.p_control import gain_for_phase_margin
from baselines.lab.lab4_study import study_lab_4, verdict
from baselines.loop_analysis.loops import is_stable
from baselines.loop_analysis.margins import margins
from flexdrive_gym import DEFAULT_DRIVE, Drive
from flexdrive_gym.references import handout_trajectory
from tests.drive.drives import RIG
from tests.each import each

RIG_DRIVE = Drive({**RIG, "saturation.limit": 8.0})
TUNED = ("pd_x1", "cascade", "lqg", "lqg_both", "h_infinity")
T = np.arange(4001) * 1e-3


def needs(name):
    if name == "h_infinity":
        pytest.importorskip("slycot", reason="needs the extra control")


@pytest.mark.slow
@each("name", FAMILIES)
def test_every_family_is_stable_keeps_its_limit_and_pickles(name):
    needs(name)
    made = design(name, RIG_DRIVE, limit=4.0)
    assert made.controller.limit == 4.0
    assert is_stable(RIG_DRIVE, made.controller)
    run = RIG_DRIVE.simulate_closed_loop(T, handout_trajectory(T), pickle.loads(pickle.dumps(made.controller)))
    assert np.max(np.abs(run.u)) <= 4.0
    assert np.max(np.abs(run.xr - run.x2)) < 40.0
    assert made.title
    assert all(np.isfinite(value) for value, _unit in made.values.values())


@pytest.mark.slow
@each("name", TUNED)
def test_tuned_families_keep_the_demands(name):
    needs(name)
    made = design(name, DEFAULT_DRIVE)
    found = margins(DEFAULT_DRIVE, made.controller)
    assert not made.notes
    assert found.sensitivity_peak <= 1.01 * DEMANDS.sensitivity
    assert found.gain_margin >= 2.0
    assert found.phase_margin_deg >= 29.5
    assert found.delay_margin >= 0.99 * DEMANDS.delay_margin
    assert count_jump(DEFAULT_DRIVE, made.controller) <= DEMANDS.count


def test_gain_for_a_phase_margin_is_python_controls():
    for feedback, margin in (("x2", 30.0), ("x2", 0.0), ("x1", 30.0)):
        Kp, omega = gain_for_phase_margin(RIG_DRIVE, margin, feedback)
        _gm, pm, _wg, wc = control.margin(Kp * RIG_DRIVE.linear.transfer_function(feedback))
        assert omega == pytest.approx(wc, rel=1e-6)
        assert pm == pytest.approx(margin, abs=1e-4)
    assert gain_for_phase_margin(RIG_DRIVE, 0.0)[0] == pytest.approx(RIG_DRIVE.linear.routh_critical_gain(), rel=1e-6)


def test_lab_4_by_the_handouts_formulas():
    found = design_lab_4(RIG_DRIVE)
    # the leads bring the demanded phase to -140° at 25 rad/s, each at the centre of its lead
    loop = RIG_DRIVE.linear.transfer_function("x2") * control.tf(
        [1.0, 2.0 * found.zeta * found.omega_n, found.omega_n**2], [1.0, 2.0 * found.omega_n, found.omega_n**2]
    )
    lead = control.tf([found.alpha * found.T, 1.0], [found.T, 1.0])
    value = (found.Kp * loop * lead * lead)(25j)
    assert abs(value) == pytest.approx(1.0, rel=1e-6)
    assert np.angle(value, deg=True) == pytest.approx(-140.0, abs=1e-6)
    assert np.sin(np.deg2rad(found.phi_max_deg)) == pytest.approx((found.alpha - 1.0) / (found.alpha + 1.0))
    assert 1.0 / (found.T * np.sqrt(found.alpha)) == pytest.approx(25.0)
    assert pytest.approx((1.0 / (found.alpha * found.T), 1.0 / found.T)) == (found.Z, found.P)
    assert found.omega_i == pytest.approx(25.0 * np.tan(np.deg2rad(10.0)))


def test_notch_cancels_the_drives_resonance():
    found = design_lab_4(RIG_DRIVE)
    assert np.sort_complex(notch(found).zeros()) == pytest.approx(
        np.sort_complex(RIG_DRIVE.linear.oscillatory_poles), rel=1e-6
    )


def test_refined_lab_4_meets_the_whole_specification():
    study = study_lab_4(RIG_DRIVE)
    assert study.met
    assert all(line.met for line in study.lines)
    last = study.stages[-1].margins
    assert last.crossover == pytest.approx(25.0, rel=0.01)
    assert last.gain_margin >= 2.0
    assert last.phase_margin_deg >= 30.0
    assert study.stages[-1].disturbance.final == pytest.approx(0.0, abs=0.02)
    assert study.stages[0].disturbance.final == pytest.approx(1.0 / study.by_hand.gain_pm30, rel=0.1)
    # feed-forward and integral are what carries x2 along
    rms = [stage.tracking[8.0].rms for stage in study.stages]
    assert rms[-1] < 0.6 * rms[-2] < 0.6 * rms[2]


def test_a_specification_out_of_reach_says_which_line_and_by_how_much():
    asked = Specification(crossover=45.0)
    _values, met = refine(RIG_DRIVE, asked)
    study = study_lab_4(RIG_DRIVE, specification=asked)
    assert not met
    text = " ".join(verdict(study))
    assert "cannot be met on this drive" in text
    assert "phase margin missed by" in text or "gain margin missed by" in text or "lead" in text


def test_an_input_delay_costs_phase_and_the_leads_know():
    late = design_lab_4(RIG_DRIVE.replace({"input_delay.tau": 0.004}))
    # 4 ms at 25 rad/s are 5.73°, shared by two leads
    assert late.phi_max_deg - design_lab_4(RIG_DRIVE).phi_max_deg == pytest.approx(0.5 * np.rad2deg(0.1), abs=1e-6)


def test_zero_vibration_shaper_leaves_none():
    omega, zeta, Ts = 14.0, 0.12, 1e-3
    omega_d = omega * np.sqrt(1.0 - zeta**2)
    t = np.arange(3000) * Ts
    shaped = np.zeros_like(t)
    for delay, weight in zero_vibration(omega_d, zeta, Ts):
        shaped[delay:] += weight
    mode = control.tf([omega**2], [1.0, 2.0 * zeta * omega, omega**2])
    y = control.forced_response(mode, t, shaped).outputs
    after = y[round(np.pi / omega_d / Ts) + 2 :]
    # python-control joins samples by lines, so its step rises over one; an unshaped step overshoots by 68 %
    assert np.max(np.abs(after - 1.0)) < 5e-3


def test_friction_compensation_lowers_the_error():
    xr = handout_trajectory(T)

    def rms(name):
        return np.sqrt(
            np.mean((xr - DEFAULT_DRIVE.simulate_closed_loop(T, xr, design(name, DEFAULT_DRIVE).controller).x2) ** 2)
        )

    assert rms("lab4_friction") < 0.9 * rms("lab4")


def test_observer_estimates_the_disturbance_away():
    found = margins(RIG_DRIVE, design("lqg", RIG_DRIVE).controller)
    assert found.static_stiffness == np.inf


def test_h_infinity_reaches_the_best_possible_robustness():
    pytest.importorskip("slycot", reason="needs the extra control")
    shaped = control.ss(20.0 * RIG_DRIVE.linear.transfer_function("x2") * 0.01)
    _K, gamma = coprime_stabiliser(shaped)
    # γmin = √(1 + λmax(XZ)) with the two Riccati solutions of the shaped plant (McFarlane and Glover 1992)
    X, _e, _g = control.care(shaped.A, shaped.B, shaped.C.T @ shaped.C)
    Z, _e, _g = control.care(shaped.A.T, shaped.C.T, shaped.B @ shaped.B.T)
    best = np.sqrt(1.0 + np.max(np.linalg.eigvals(X @ Z).real))
    assert gamma == pytest.approx(best, rel=0.05)


def test_a_saturating_step_does_not_wind_up():
    t = np.arange(3001) * 1e-3
    controller = design("integral", RIG_DRIVE, limit=4.0).controller
    step = np.where(t > 0.1, 30.0, 0.0)
    run = RIG_DRIVE.simulate_closed_loop(t, step, controller)
    assert np.max(np.abs(run.u)) == pytest.approx(4.0)
    assert np.max(run.x2) < 1.2 * 30.0
    without = RIG_DRIVE.simulate_closed_loop(t, step, controller.replace(L=np.zeros(controller.order)))
    assert np.max(without.x2) > np.max(run.x2)


def test_unknown_names_and_rigid_drives_are_refused():
    with pytest.raises(ValueError, match="Did you mean 'lab4'"):
        design("lab", RIG_DRIVE)
    with pytest.raises(ValueError, match="got a rigid drive"):
        design("lab4", Drive({"m1": 1e-3, "b1": 0.01}))
    rigid = design("p_x1", Drive({"m1": 1e-3, "b1": 0.01, "d1": 0.3}))
    assert is_stable(Drive({"m1": 1e-3, "b1": 0.01}), rigid.controller)


@each("name", ["lab4", "lqg", "p_x2"])
def test_a_lag_and_a_late_encoder_count_as_delay(name):
    late = RIG_DRIVE.replace({"input_delay.tau": 0.006})
    folded = RIG_DRIVE.replace({"amplifier_lag.tau": 0.004, "encoder_delay.encoder_2.tau": 0.002})
    assert np.allclose(design(name, folded).controller.law().entries, design(name, late).controller.law().entries)
    # encoder 1 is not in this loop
    other = RIG_DRIVE.replace({"encoder_delay.encoder_1.tau": 0.005})
    assert np.allclose(design(name, other).controller.law().entries, design(name, RIG_DRIVE).controller.law().entries)


def test_the_motor_behind_a_gap_is_part_of_the_mass():
    split = RIG_DRIVE.replace({"m1": 0.6 * RIG_DRIVE["m1"], "motor_gear_backlash.mass": 0.4 * RIG_DRIVE["m1"]})
    assert np.allclose(
        design("pd_x1", split).controller.law().entries, design("pd_x1", RIG_DRIVE).controller.law().entries
    )


def test_an_encoder_that_reads_too_much_is_corrected():
    drive = RIG_DRIVE.replace({"encoder_scale.s": 0.02})
    plain, corrected = (design("lab4", d).controller for d in (RIG_DRIVE, drive))
    assert np.allclose(1.02 * corrected.D[:, 2], plain.D[:, 2])
    assert np.array_equal(corrected.D[:, :2], plain.D[:, :2])


def test_roundoff_that_stops_one_riccati_solver_does_not_stop_a_design():
    def solve(*matrices, method="slycot"):
        if method == "slycot":
            raise ArithmeticError("After reordering, roundoff changed values of some complex eigenvalues")
        return (*matrices, method)

    assert _solved(solve, 1, 2) == (1, 2, "scipy")
