"""The compiled step against an independent integration, analytic solutions, and what dry friction demands."""

import numpy as np
import pytest

from flexdrive_gym import Drive
from tests.drive.drives import FRICTIONLESS, RIG, true_states
from tests.drive.reference import TwoMasses
from tests.each import each

T = np.arange(4001) * 1e-3
EXCITATIONS = {
    "square 1.5 V": 1.5 * np.where(T % 2.0 < 1.0, 1.0, -1.0),
    "sine 2.5 V 3 Hz": 2.5 * np.sin(2 * np.pi * 3 * T),
    "stick-slip 0.6 V": 0.6 * np.where(T % 2.0 < 1.0, 1.0, -1.0),
    "stick-slip sine 0.9 V 1 Hz": 0.9 * np.sin(2 * np.pi * T),
    "sine 2.5 V 20 Hz": 2.5 * np.sin(2 * np.pi * 20 * T),
}


@each("name", EXCITATIONS)
def test_agrees_with_event_driven_integration_at_one_millisecond(name):
    u = EXCITATIONS[name]
    expected = TwoMasses(**RIG).run(T, u)
    found = true_states(Drive(RIG), u)
    peak = np.abs(expected[[1, 3]]).max()
    assert np.abs(found - expected)[[1, 3]].max() <= 1e-6 * peak  # the requirement is 1e-3


def test_error_falls_with_the_fourth_power_of_the_step():
    u = EXCITATIONS["square 1.5 V"][::10]
    fine = TwoMasses(**RIG).run(T[::10], u)
    errors = [np.abs(true_states(Drive(RIG), u, 1e-2, substeps=n) - fine)[[1, 3]].max() for n in (1, 2, 4)]
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert np.all(orders > 3.5)


def test_free_oscillation_has_the_analytic_frequency_and_decay():
    # released from a stretched spring without friction, δ obeys δ'' + (b/μ) δ' + (k/μ) δ = 0 when b1/m1 = b2/m2
    m1, m2, k, rate = 8e-4, 4e-4, 0.09, 3.0
    drive = Drive({"m1": m1, "m2": m2, "b1": rate * m1, "b2": rate * m2, "k": k})
    x1, _v1, x2, _v2 = true_states(drive, np.zeros(3001), start=(10.0, 0.0, 0.0, 0.0))
    t = np.arange(3001) * 1e-3
    mu = m1 * m2 / (m1 + m2)
    wd = np.sqrt(k / mu - (rate / 2) ** 2)
    delta = 10.0 * np.exp(-rate * t / 2) * (np.cos(wd * t) + rate / (2 * wd) * np.sin(wd * t))
    assert np.abs((x1 - x2) - delta).max() < 1e-5


def test_undamped_drive_keeps_its_energy():
    drive = Drive({"m1": 8e-4, "m2": 4e-4, "k": 0.09})
    x1, v1, x2, v2 = true_states(drive, np.zeros(10001), start=(10.0, 0.0, 0.0, 0.0))
    energy = 0.5 * (8e-4 * v1**2 + 4e-4 * v2**2 + 0.09 * (x1 - x2) ** 2)
    assert np.ptp(energy) / energy[0] < 1e-4


def test_friction_never_adds_energy():
    x1, v1, x2, v2 = true_states(Drive(RIG), np.zeros(2001), start=(30.0, 150.0, 0.0, -80.0))
    energy = 0.5 * (RIG["m1"] * v1**2 + RIG["m2"] * v2**2 + RIG["k"] * (x1 - x2) ** 2)
    assert np.all(np.diff(energy) <= 1e-12)
    assert v1[-1] == 0.0
    assert v2[-1] == 0.0


def test_rigid_slide_to_rest_takes_the_analytic_time_and_distance():
    m, b, d, v0 = 1.1e-3, 0.0127, 0.6, 150.0
    drive = Drive({"m1": m, "b1": b, "d1": d})
    x, v, _x2, _v2 = true_states(drive, np.zeros(501), start=(0.0, v0, 0.0, 0.0))
    tau = m / b
    stop = tau * np.log1p(b * v0 / d)
    distance = tau * v0 - d / b * stop
    assert np.all(v[np.arange(501) * 1e-3 > stop] == 0.0)
    assert x[-1] == pytest.approx(distance, rel=1e-9)


@each("cart", [1, 2])
def test_stick_threshold_is_exact(cart):
    # cart 1 is pushed by u; cart 2 by a spring stretched to d2 while d1 holds cart 1
    if cart == 1:
        below, above = np.full(3, RIG["d1"] * (1 - 1e-9)), np.full(3, RIG["d1"] * (1 + 1e-9))
        assert np.all(true_states(Drive(RIG), below)[1] == 0.0)
        assert np.all(true_states(Drive(RIG), above)[1, 1:] > 0.0)
        return
    reach = RIG["d2"] / RIG["k"]
    for factor, moves in ((1 - 1e-9, False), (1 + 1e-9, True)):
        v2 = true_states(Drive(RIG), np.zeros(3), start=(factor * reach, 0.0, 0.0, 0.0))[3]
        assert np.any(v2 > 0.0) == moves


def test_a_sticking_cart_does_not_creep():
    # ten seconds under a force just below breakaway: not a picometre
    x1 = true_states(Drive(RIG), np.full(10001, 0.999 * RIG["d1"]))[0]
    assert np.all(x1 == 0.0)


def test_mirror_symmetry():
    u = EXCITATIONS["stick-slip sine 0.9 V 1 Hz"]
    assert np.array_equal(true_states(Drive(RIG), u), -true_states(Drive(RIG), -u))


def test_frictionless_drive_is_its_linear_model():
    from scipy.signal import cont2discrete, dlsim

    drive = Drive({**FRICTIONLESS, "C": 2e-4})
    ss = drive.linear.state_space()
    u = EXCITATIONS["sine 2.5 V 3 Hz"]
    A, B, C, D, dt = cont2discrete((ss.A, ss.B[:, :1], ss.C, ss.D[:, :1]), 1e-3)
    expected = dlsim((A, B, C, D, dt), u)[1].T[[0, 2, 1, 3]]
    assert np.allclose(true_states(drive, u), expected, rtol=1e-7, atol=1e-6)


def test_variant_with_every_effect_agrees_when_they_are_null():
    u = EXCITATIONS["stick-slip sine 0.9 V 1 Hz"]
    # one integrates by table, the other piece by piece: equal up to round-off
    assert np.allclose(true_states(Drive(RIG), u), true_states(Drive(RIG), u, full=True), rtol=0.0, atol=1e-9)


@each("tau", [1e-3, 2.5e-3, 0.4e-3])
def test_input_delay_shifts_the_response_exactly(tau):
    drive = Drive({**RIG, "input_delay.tau": tau})
    fine = 1e-4  # a grid on which every delay here is whole
    t = np.arange(0, 2.0, fine)
    u = 2.0 * np.where(t % 1.0 < 0.5, 1.0, -1.0)
    shifted = np.concatenate([np.zeros(round(tau / fine)), u])[: len(u)]
    expected = true_states(Drive(RIG), shifted, fine)[:, ::10]
    found = true_states(drive, u[::10])
    assert np.abs(found - expected).max() < 1e-6


def test_long_steps_stay_accurate():
    u = EXCITATIONS["square 1.5 V"][::5]
    expected = TwoMasses(**RIG).run(T[::5], u)
    found = true_states(Drive(RIG), u, 5e-3)
    assert np.abs(found - expected)[[1, 3]].max() <= 1e-4 * np.abs(expected[[1, 3]]).max()
