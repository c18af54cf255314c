"""Eqs. (1), (2), (4) corrected, (6), (7) of the handout."""

import control
import numpy as np
import pytest

from flexdrive_gym import Drive, LinearDrive
from tests.each import each

M1, M2, B1, B2, K, C = 7.6e-4, 3.4e-4, 0.0096, 0.0032, 0.095, 3e-4
DRIVE = LinearDrive(M1, M2, B1, B2, K, C)


def test_denominator_is_equation_2():
    a1 = (M1 * B2 + M2 * B1 + (M1 + M2) * C) / (M1 * M2)
    a2 = (B1 * B2 + (B1 + B2) * C + (M1 + M2) * K) / (M1 * M2)
    a3 = (B1 + B2) * K / (M1 * M2)
    assert np.allclose(DRIVE.denominator, [1.0, a1, a2, a3, 0.0], rtol=1e-12)


@each(
    ("output", "source", "expected"),
    [
        ("x1", "u", [M2, B2 + C, K]),
        ("x2", "u", [C, K]),
        ("x1", "d1", [-M2, -B2 - C, -K]),
        ("x2", "d1", [-C, -K]),
        ("x1", "d2", [-C, -K]),
        ("x2", "d2", [-M1, -B1 - C, -K]),
    ],
)
def test_numerators_are_equation_1(output, source, expected):
    assert np.allclose(DRIVE.numerator(output, source), np.array(expected) / (M1 * M2), rtol=1e-12)


def test_denominator_factors_as_equation_4_corrected():
    p, zeta, wn = DRIVE.p, DRIVE.zeta, DRIVE.omega_n
    corrected = [1.0, 2 * zeta * wn + p, wn**2 + 2 * zeta * wn * p, p * wn**2, 0.0]
    assert np.allclose(DRIVE.denominator, corrected, rtol=1e-10)
    printed = wn**2 + 2 * zeta * wn  # the handout's misprint, without p
    assert abs(DRIVE.denominator[2] / printed - 1.0) > 0.05


def test_python_control_objects_have_the_same_response():
    w = np.logspace(-1, 3, 50)
    ss = DRIVE.state_space()
    for i, (output, velocity) in enumerate([("x1", False), ("x2", False), ("x1", True), ("x2", True)]):
        for j, source in enumerate(("u", "d1", "d2")):
            direct = DRIVE.frequency_response(w, output, source, velocity=velocity)
            tf = DRIVE.transfer_function(output, source, velocity=velocity)
            assert np.allclose(tf(1j * w), direct, rtol=1e-9)
            assert np.allclose(ss(1j * w)[i, j], direct, rtol=1e-6)


def test_natural_frequency_and_damping_are_those_of_damp():
    wn, zeta, poles = control.damp(DRIVE.transfer_function("x2", velocity=True), doprint=False)
    pair = np.abs(poles.imag) > 0
    assert DRIVE.omega_n == pytest.approx(wn[pair][0], rel=1e-9)
    assert DRIVE.zeta == pytest.approx(zeta[pair][0], rel=1e-9)
    assert DRIVE.p == pytest.approx(-poles[~pair].real.min(), rel=1e-9)
    assert DRIVE.omega_d == pytest.approx(abs(poles[pair][0].imag), rel=1e-9)


def test_collocated_drive_has_zeros_near_the_poles_and_non_collocated_has_none():
    assert len(DRIVE.zeros("x1")) == 2
    assert len(LinearDrive(M1, M2, B1, B2, K).zeros("x2")) == 0


def test_final_value_is_equation_3():
    # (u0 - dT)/bT
    step = control.tf(DRIVE.transfer_function("x2", velocity=True)).dcgain()
    assert step == pytest.approx(1.0 / (B1 + B2), rel=1e-9)


@each("scale", [0.3, 1.0, 3.0])
def test_routh_agrees_with_the_gain_margin(scale):
    drive = LinearDrive(M1, M2 * scale, B1, B2 / scale, K, C)
    margin = control.margin(drive.transfer_function("x2"))[0]
    assert drive.routh_critical_gain("x2") == pytest.approx(margin, rel=1e-6)


def test_closed_loop_is_on_the_imaginary_axis_at_the_critical_gain():
    gain = DRIVE.routh_critical_gain("x2")
    closed = np.polyadd(DRIVE.denominator, gain * DRIVE.numerator("x2"))
    assert np.max(np.roots(closed).real) == pytest.approx(0.0, abs=1e-8)


def test_collocated_control_has_no_limit():
    assert DRIVE.routh_critical_gain("x1") == np.inf


def test_rigid_drive_is_lab_2():
    drive = Drive({"m1": 1.1e-3, "b1": 0.0127, "d1": 0.6}).linear
    assert drive.p == pytest.approx(0.0127 / 1.1e-3)
    assert np.allclose(drive.transfer_function("x1").num[0][0], [1 / 1.1e-3])
    assert drive.state_space().A.shape == (2, 2)
    with pytest.raises(ValueError, match="one cart"):
        drive.numerator("x2")


def test_infinite_stiffness_approaches_the_rigid_drive():
    stiff = LinearDrive(M1, M2, B1, B2, 1e4)
    rigid = LinearDrive(M1 + M2, np.inf, B1 + B2, 0.0, 0.0)
    w = np.logspace(-1, 2, 20)
    assert np.allclose(stiff.frequency_response(w, "x2"), rigid.frequency_response(w, "x1"), rtol=1e-3)
