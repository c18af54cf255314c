"""A linear controller is one thing: called in Python, compiled, batched."""

import numpy as np
import pytest
from scipy.stats import t as student

from flexdrive_gym import Covariance, Drive, LinearController, PControl
from flexdrive_gym.drive.batch.closed_loop import run_batch
from flexdrive_gym.references import handout_trajectory
from tests.called import Called
from tests.drive.drives import FRICTIONLESS, RIG
from tests.each import each

T = np.arange(2001) * 1e-3
XR = handout_trajectory(T)
RIG_DRIVE = Drive({**RIG, "saturation.limit": 8.0})


def proportional(gain, **more):
    D = np.array([[gain, 0.0, -gain], [0.0, 0.0, 0.0]])
    return LinearController(np.zeros((0, 0)), np.zeros((0, 3)), np.zeros((2, 0)), D, **more)


def dynamic(**more):
    """Two states, both readings, friction compensation, anti-windup, shaped reference."""
    return LinearController(
        A=np.array([[0.97, 0.0], [0.01, 1.0]]),
        B=np.array([[0.03, -0.02, -0.01], [0.0, 0.0, 0.0]]),
        C=np.array([[0.05, 0.2], [30.0, 0.0]]),
        D=np.array([[0.2, -0.1, -0.1], [10.0, -10.0, 0.0]]),
        L=np.array([0.0, 0.02]),
        **{"limit": 2.0, "friction": 0.3, "threshold": 8.0, "shaper": ((0, 0.6), (37, 0.4)), **more},
    )


def test_static_gain_is_p_control():
    ours = RIG_DRIVE.simulate_closed_loop(T, XR, proportional(0.1))
    theirs = RIG_DRIVE.simulate_closed_loop(T, XR, PControl(0.1))
    assert np.max(np.abs(ours.x2 - theirs.x2)) < 1e-9


def test_called_and_compiled_agree():
    compiled = RIG_DRIVE.simulate_closed_loop(T, XR, dynamic())
    called = RIG_DRIVE.simulate_closed_loop(T, XR, Called(dynamic()))
    assert np.max(np.abs(compiled.u)) == pytest.approx(2.0)  # the limit is reached, so anti-windup acts
    assert np.max(np.abs(compiled.u - called.u)) < 1e-9
    assert np.max(np.abs(compiled.x2 - called.x2)) < 1e-9


def test_a_transfer_function_is_made_discrete_by_tustins_rule():
    own = LinearController.from_tf([0.5, 3.0], [0.02, 1.0], reads="x1", sample_time=2e-3, limit=5.0)
    z = np.exp(1j * np.array([3.0, 40.0, 300.0]) * 2e-3)
    s = 2.0 / 2e-3 * (z - 1.0) / (z + 1.0)
    law = own.tf
    assert law.input_labels == ["xr", "x1", "x2"]
    assert law.output_labels == ["u"]
    expected = (0.5 * s + 3.0) / (0.02 * s + 1.0)
    assert law["u", "xr"](z) == pytest.approx(expected)
    assert law["u", "x1"](z) == pytest.approx(-expected)
    assert np.all(law["u", "x2"](z) == 0.0)
    assert (own.reads, own.limit, own.order) == ("x1", 5.0, 1)


def test_a_discrete_transfer_function_and_named_inputs_are_taken_as_they_are():
    own = LinearController.from_tf([1.0, -0.5], [1.0, -0.9], domain="z")
    z = np.exp(0.3j)
    assert own.tf["u", "x2"](z) == pytest.approx(-(z - 0.5) / (z - 0.9))
    two = LinearController.from_ss([[0.9]], [[1.0, 2.0]], [[0.5]], [[0.0, 3.0]], inputs=("x2", "xr"))
    assert two.tf["u", "x2"](z) == pytest.approx(0.5 / (z - 0.9))
    assert two.tf["u", "xr"](z) == pytest.approx(1.0 / (z - 0.9) + 3.0)
    assert PControl(0.1).linear().tf["u", "xr"](z) == pytest.approx(0.1)
    assert PControl(0.0).linear().order == 0


@each(
    ("numerator", "denominator", "keywords", "text"),
    [
        ([1.0, 0.0], [1.0], {}, "numerator: must not have a higher degree"),
        ([np.nan], [1.0], {}, "numerator: must be finite coefficients"),
        ([1.0], [0.0], {}, "denominator: must be finite coefficients in falling powers, not all 0"),
        ([1.0], [1.0, 1.0], {"domain": "w"}, "domain: must be 's'"),
        ([1.0], [1.0], {"reads": "x3"}, "inputs: must be among"),
    ],
)
def test_odd_transfer_functions_are_named(numerator, denominator, keywords, text):
    with pytest.raises(ValueError, match=text):
        LinearController.from_tf(numerator, denominator, **keywords)


def test_reset_forgets():
    controller = dynamic()
    first = RIG_DRIVE.simulate_closed_loop(T, XR, Called(controller))
    again = RIG_DRIVE.simulate_closed_loop(T, XR, Called(controller))
    assert np.array_equal(first.u, again.u)


def test_batch_is_what_single_runs_are():
    drives = [RIG_DRIVE, RIG_DRIVE.replace({"m2": 4e-4}), RIG_DRIVE.replace({"input_delay.tau": 0.0034})]
    out = run_batch(drives, XR, dynamic(), true_states=False)
    for drive, run in zip(drives, out, strict=True):
        single = drive.simulate_closed_loop(T, XR, dynamic())
        assert np.array_equal(run[1], single.x2)
        assert np.array_equal(run[4], single.u)


def test_held_back_command_is_an_input_delay():
    delayed = RIG_DRIVE.replace({"input_delay.tau": 0.005})
    a = run_batch([RIG_DRIVE], XR, proportional(0.05), late=5)[0]
    b = run_batch([delayed], XR, proportional(0.05))[0]
    assert np.max(np.abs(a[2] - b[2])) < 1e-9


def test_factor_is_a_larger_gain():
    drive = Drive(FRICTIONLESS)
    a = run_batch([drive], XR, proportional(0.05), gains=2.0)[0]
    b = run_batch([drive], XR, proportional(0.1))[0]
    assert np.max(np.abs(a[2] - b[2])) < 1e-9


def test_disturbance_is_balanced_by_a_proportional_loop():
    long = np.zeros(8000)
    out = run_batch([Drive(FRICTIONLESS)], long, proportional(0.05), disturbance=0.5)[0]
    assert out[2, -1] == pytest.approx(0.5 / 0.05, rel=1e-4)  # u = -d at rest


@each(
    ("changes", "text"),
    [
        ({"A": np.zeros((2, 3))}, "A: must be finite and of shape"),
        ({"C": np.full((2, 2), np.nan)}, "C: must be finite"),
        ({"L": np.zeros(3)}, "L: must be finite and of shape"),
        ({"limit": 0.0}, "limit: must be positive"),
        ({"shaper": ((-1, 1.0),)}, "shaper: must be pairs"),
    ],
)
def test_wrong_controllers_are_refused(changes, text):
    with pytest.raises(ValueError, match=text):
        dynamic().replace(**changes)


def test_drawn_drives_have_the_identified_spread():
    names = ("m1", "k")
    matrix = np.array([[1e-10, 2e-8], [2e-8, 1.6e-5]])
    drive = Drive(RIG, covariance=Covariance(names, matrix))
    drawn = drive.draw(np.random.default_rng(3), 4000)
    values = np.array([[d[n] for n in names] for d in drawn])
    assert values.mean(axis=0) == pytest.approx([RIG["m1"], RIG["k"]], rel=5e-3)
    assert np.cov(values.T) == pytest.approx(matrix, rel=0.1)
    assert drawn[0]["m2"] == RIG["m2"]
    again = drive.draw(np.random.default_rng(3), 2)
    assert [d["k"] for d in again] == [d["k"] for d in drive.draw(np.random.default_rng(3), 2)]


def test_few_degrees_of_freedom_widen_draws_as_students_t_does():
    spread = Covariance(("k",), np.array([[(0.02 * RIG["k"]) ** 2]]), 6.0)
    drawn = np.array([d["k"] for d in Drive(RIG, covariance=spread).draw(np.random.default_rng(0), 20000)])
    low, high = np.quantile(drawn, [0.025, 0.975])
    assert (high - low) / 2 == pytest.approx(student.ppf(0.975, 6) * 0.02 * RIG["k"], rel=0.05)


def test_draws_have_the_friction_of_another_run():
    drive = Drive(
        RIG, covariance=Covariance(("m1",), np.array([[1e-12]])), run_to_run=Covariance(("d2",), np.array([[0.04]]))
    )
    logs = np.log([d["d2"] / RIG["d2"] for d in drive.draw(np.random.default_rng(0), 4000)])
    assert np.std(logs) == pytest.approx(0.2, rel=0.05)
    assert all(d.run_to_run is None for d in drive.draw(np.random.default_rng(0), 2))


def test_a_negative_parameter_is_drawn_to_both_sides():
    key = "hardening_spring.k3"
    drive = Drive({**RIG, key: -1e-5}, covariance=Covariance((key,), np.array([[1e-12]])))
    drawn = np.array([d[key] for d in drive.draw(np.random.default_rng(0), 500)])
    assert drawn.mean() == pytest.approx(-1e-5, rel=0.02)
    assert drawn.std() == pytest.approx(1e-6, rel=0.15)


def test_a_drive_without_covariance_cannot_be_drawn():
    with pytest.raises(ValueError, match=r"covariance: drawing needs .* --method ml"):
        Drive(RIG).draw(np.random.default_rng(0), 1)
