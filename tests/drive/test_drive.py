"""The Drive as users meet it: values, errors, files, simulation."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from flexdrive_gym import Covariance, Drive, Observation, PControl, Provenance, load_drive, save_drive
from flexdrive_gym.drive.drive import Recorded
from flexdrive_gym.references import handout_trajectory, square
from tests.drive.drives import FRICTIONLESS, RIG
from tests.each import each

T = np.arange(2001) * 1e-3
QUANTUM = 0.0046592
SENSORS = {f"encoder_quantisation.encoder_{i}.quantum": QUANTUM for i in (1, 2)}


@each(
    ("values", "error", "text"),
    [
        ({"m2": 1e-3}, ValueError, "m1: a drive needs the mass"),
        ({"m1": -1.0}, ValueError, r"m1: must lie in \[1e-09, 1000\] V s²/mm; got -1"),
        ({"m1": float("nan")}, ValueError, "got nan"),
        ({"m1": 1e-3, "k": 0.1}, ValueError, "m2: a drive with a spring needs a second mass"),
        ({"m1": 1e-3, "saturation.limt": 8.0}, KeyError, "did you mean saturation.limit"),
    ],
)
def test_wrong_values_name_parameter_rule_and_value(values, error, text):
    with pytest.raises(error, match=text):
        Drive(values)


def test_toml_keeps_everything(tmp_path):
    drive = Drive(
        {**RIG, **SENSORS, "saturation.limit": 8.0, "input_delay.tau": 2e-3},
        intervals={"m1": (7.5e-4, 7.7e-4)},
        covariance=Covariance(("m1", "b1"), np.array([[1e-12, 1e-13], [1e-13, 1e-8]]), 9.0),
        provenance=Provenance("ml", ("square_a", "sine_b"), "0.1.0", "a note"),
        name="bench",
        run_to_run=Covariance(("d1", "d2"), np.diag([0.04, 0.09])),
        recorded=Recorded(2.5, 180.0, 20.0, 0.5, 20.0),
    )
    back = load_drive(save_drive(drive, tmp_path / "drive.toml"))
    assert dict(back.values) == dict(drive.values)
    assert back.intervals == drive.intervals
    assert back.provenance == drive.provenance
    assert back.name == drive.name
    assert back.covariance is not None
    assert np.array_equal(back.covariance.matrix, drive.covariance.matrix)
    assert back.covariance.degrees == 9.0
    assert (back.run_to_run.names, back.run_to_run.degrees) == (("d1", "d2"), np.inf)
    assert np.array_equal(back.run_to_run.matrix, drive.run_to_run.matrix)
    assert back.recorded == pickle.loads(pickle.dumps(drive)).recorded == drive.recorded
    assert 'unit = "V s²/mm"' in (tmp_path / "drive.toml").read_text()


@each(
    ("text", "message"),
    [
        ("not toml =", "must be TOML"),
        ("[parameters]\n", "must have 'schema' from 1 to 1; got None"),
        ("schema = 9\n[parameters]\n", "has schema 9, and this flexdrive reads up to 1. Update flexdrive"),
        ("schema = 1\n", r"must have a table \[parameters\]"),
        ('schema = 1\n[parameters]\nm1 = {value = 1.0, unit = "kg"}', "must be given in V s²/mm; got 'kg'"),
        ('schema = 1\n[parameters]\nm1 = {value = 1.0, unit = "kg m²"}', r"J \[kg m²\] / \(torque per volt \[N m/V\]"),
        (
            'schema = 1\n[parameters]\nk = {value = 1.0, unit = "N/m"}',
            r"k \[V/mm\] = stiffness \[N/m\] / \(force per volt",
        ),
        ("schema = 1\n[parameters]\nmass = 1.0", "no parameter of the drive is called 'mass'"),
        ("schema = 1\n[parameters]\nm1 = {value = -1.0}", "m1: must lie in"),
    ],
)
def test_bad_files_say_what_is_wrong(tmp_path, text, message):
    path = tmp_path / "drive.toml"
    path.write_text(text)
    with pytest.raises(ValueError, match=message):
        load_drive(path)


def test_missing_file_names_the_remedy(tmp_path):
    with pytest.raises(FileNotFoundError, match="flexdrive identify"):
        load_drive(tmp_path / "no.toml")


def test_toml_keeps_effects_and_their_shapes(tmp_path):
    values = {
        **RIG, "stribeck.cart_1.extra": 0.1, "stribeck.cart_1.vs": 40.0, "cogging.a_cos": -0.02, "encoder_play.encoder_2.g": 0.1,
    }  # fmt: skip
    back = load_drive(save_drive(Drive(values), tmp_path / "drive.toml"))
    assert dict(back.values) == values
    assert "[effects.stribeck.cart_1]" in (tmp_path / "drive.toml").read_text()


def test_drive_is_frozen_and_pickles():
    drive = Drive(RIG)
    with pytest.raises(TypeError):
        drive.values["m1"] = 1.0
    assert dict(pickle.loads(pickle.dumps(drive)).values) == dict(drive.values)


def test_changing_a_value_drops_its_interval():
    drive = Drive(RIG, intervals={"m1": (1e-4, 1e-3), "b1": (0.0, 1.0)})
    assert set(drive.replace(m1=8e-4).intervals) == {"b1"}


def test_velocities_are_raw_differences_of_counts():
    run = Drive({**RIG, **SENSORS}).simulate(T, square(T, 1.5, 0.5))
    counts = run.x1 / QUANTUM
    assert np.allclose(counts, np.rint(counts), atol=1e-9)
    assert np.allclose(run.v1[1:], np.diff(run.x1) / 1e-3)


def test_filtered_derivative_is_a_first_order_low_pass_of_the_raw_difference():
    cutoff = 40.0
    values = {**RIG, "velocity_processing.encoder_1.cutoff": cutoff}
    raw = Drive(RIG).simulate(T, square(T, 1.5, 0.5)).v1
    found = Drive(values).simulate(T, square(T, 1.5, 0.5)).v1
    a = np.exp(-2 * np.pi * cutoff * 1e-3)
    expected = np.zeros(len(T))
    for n in range(1, len(T)):
        expected[n] = a * expected[n - 1] + (1 - a) * raw[n]
    assert np.allclose(found, expected, atol=1e-9)


def test_command_limit_acts_on_open_loop_drives():
    limited = Drive({**RIG, "saturation.limit": 1.0}).simulate(T, square(T, 3.0, 0.5))
    assert np.array_equal(limited.v1, Drive(RIG).simulate(T, square(T, 1.0, 0.5)).v1)


@each(
    ("answer", "error", "text"),
    [
        (float("nan"), ValueError, r"controller: must return a finite command \[V\]; got nan at t = 0.002 s"),
        (float("inf"), ValueError, "controller: must return a finite command"),
        (None, TypeError, r"controller: must return one number, the command \[V\]; got None"),
    ],
)
def test_a_controller_that_answers_no_number_is_refused(answer, error, text):
    t = np.arange(5) * 1e-3
    with pytest.raises(error, match=text):
        Drive(RIG).simulate_closed_loop(t, 0.0 * t, lambda seen: 1.0 if seen.t < 0.0015 else answer)


def test_a_run_that_leaves_all_bounds_is_a_result():
    t = np.arange(400) * 1e-3
    wild = Drive({**RIG, "d1": 0.0, "d2": 0.0})
    with np.errstate(over="ignore", invalid="ignore"):
        run = wild.simulate_closed_loop(t, 0.0 * t + 1.0, lambda seen: -1e300 * (seen.xr - seen.x1))
    assert run.n >= 1


@each(("arguments", "text"), [((np.nan,), "gain: must be a finite"), ((1.0, "x3"), "feedback: must be")])
def test_p_control_checks_what_it_is_given(arguments, text):
    with pytest.raises(ValueError, match=text):
        PControl(*arguments)


def test_compiled_p_control_equals_the_protocol():
    class Same:
        def reset(self):
            self.calls = 0

        def __call__(self, observation: Observation) -> float:
            self.calls += 1
            return 0.2 * (observation.xr - observation.x2)

    drive = Drive({**RIG, **SENSORS, "saturation.limit": 8.0, "input_delay.tau": 1.3e-3})
    xr = handout_trajectory(T)
    fast = drive.simulate_closed_loop(T, xr, PControl(0.2, "x2"))
    slow = drive.simulate_closed_loop(T, xr, Same())
    for name in ("u", "x1", "x2", "v1", "v2"):
        assert np.array_equal(getattr(fast, name), getattr(slow, name))


def test_frictionless_loop_holds_below_and_grows_above_its_discrete_limit():
    # the sampled loop's own limit: poles of the zero-order-hold plant with unit delay of the reading's use, none here
    from scipy.signal import cont2discrete

    drive = Drive(FRICTIONLESS)
    ss = drive.linear.state_space()
    A, B, *_ = cont2discrete((ss.A, ss.B[:, :1], ss.C, ss.D[:, :1]), 1e-3)
    row = ss.C[1]

    def radius(gain):
        return np.abs(np.linalg.eigvals(A - gain * np.outer(B[:, 0], row))).max()

    low, high = 0.01, 1.0
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if radius(middle) < 1.0 + 1e-12 else (low, middle)
    t = np.arange(20001) * 1e-3
    for factor, grows in ((0.99, False), (1.01, True)):
        x2 = drive.simulate_closed_loop(t, np.full(len(t), 1.0), PControl(factor * low, "x2")).x2
        early, late = np.ptp(x2[5000:8000]), np.ptp(x2[-3000:])
        assert (late > early) == grows


def test_run_ends_at_the_travel_limit():
    run = Drive(RIG).simulate(T, np.full(len(T), 2.0), travel_limit=50.0)
    assert run.n < len(T)
    assert "travel" in run.notes[0]


def test_rigid_drive_simulates_one_cart():
    drive = Drive({"m1": 1.1e-3, "b1": 0.0127, "d1": 0.6})
    run = drive.simulate(T, np.full(len(T), 2.0))
    assert run.x2 is None
    assert run.v1[-1] == pytest.approx((2.0 - 0.6) / 0.0127, rel=1e-6)


@each(
    ("t", "u", "text"),
    [
        ([0.0, 0.1, 0.3], [0.0] * 3, "equal steps"),
        ([0.0, 0.1], [0.0] * 3, "shape of t"),
        ([0.0, 0.1, 0.2], [0.0, np.nan, 0.0], "u: must be finite; got nan at t = 0.1 s"),
        ([0.0], [0.0], "at least 2"),
    ],
)
def test_bad_signals_are_named(t, u, text):
    with pytest.raises(ValueError, match=text):
        Drive(RIG).simulate(t, u)


def test_too_long_a_delay_is_refused():
    drive = Drive({**RIG, "input_delay.tau": 0.02})
    with pytest.raises(ValueError, match="input_delay.tau: at most"):
        drive.simulate(np.arange(100) * 1e-4, np.zeros(100))


def test_an_effect_too_fast_to_follow_is_refused():
    # a simulation of it would hardly end
    drive = Drive({**RIG, "motor_gear_backlash.mass": 1e-20})
    with pytest.raises(
        ValueError, match=r"motor_gear_backlash.mass = 1e-20.*at most 10000 steps.*make the effect slower"
    ):
        drive.simulate(T, np.zeros_like(T))


def test_recording_checks_shapes():
    run = Drive(RIG).simulate(T, np.zeros(len(T)))
    with pytest.raises(ValueError, match="v1: must have the shape of t"):
        replace(run, v1=np.zeros(3))


def test_the_spring_s_force_is_that_of_its_laws():
    delta = np.array([[-20.0, -3.0], [0.0, 15.0]])
    drive = Drive({**RIG, "hardening_spring.k3": -4e-5, "asymmetric_spring.k2": 1e-3})
    assert Drive(RIG).spring_force(delta) == pytest.approx(RIG["k"] * delta)
    assert drive.spring_force(delta) == pytest.approx(RIG["k"] * delta + 1e-3 * delta**2 - 4e-5 * delta**3)
