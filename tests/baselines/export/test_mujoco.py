"""Drives in MuJoCo against our own step."""

import xml.etree.ElementTree as ET

import pytest

from baselines.export import export_mujoco, verify_mujoco
from flexdrive_gym import DEFAULT_DRIVE, Drive
from flexdrive_gym.units import Units
from tests.drive.drives import RIG
from tests.each import each

LIMITED = {**RIG, "saturation.limit": 8.0}
HELD = {
    "C": {"C": 1e-3},
    "springs": {"hardening_spring.k3": 4e-5, "asymmetric_spring.k2": 5e-4, "coil_bind.kb": 0.05, "coil_bind.d0": 5.0},
    "play": {"coupling_backlash.g": 0.3},
    "drag": {"quadratic_drag.cart_1.c": 3e-6, "ground_spring.kg": 1e-3, "ground_spring.kg_2": 1e-3},
    "tilt": {"tilt.F": 0.03, "input_offset.u0": 0.02},
    "late": {"input_delay.tau": 0.0023, "amplifier_lag.tau": 0.006},
    "appendage": {"extra_mode.mass_1": 1e-4, "extra_mode.mass_2": 3e-5},
    "track": {"base_recoil.compliance": 5e-3},
}


@each("values", [{}, *HELD.values()], ids=["base", *HELD])
def test_what_mujoco_holds_moves_as_ours(values):
    pytest.importorskip("mujoco", reason="mujoco is not installed: pip install 'flexdrive[mujoco]'")
    drive = Drive({**LIMITED, **values})
    exported = export_mujoco(drive, "rig")
    assert exported.left_out == ()
    for d in verify_mujoco(drive, exported):
        if d.case == "at rest":
            # the creep that its friction leaves: less than a hundredth of an encoder count
            assert d.largest < (1e-4 if d.signal.startswith("x") else 0.02)
        elif d.signal.startswith("x"):
            assert d.relative < 5e-3, d


@each("units", [Units("rad", "N m", 123.0, 7.0), Units("mm", "V", 1.0, 1.0, 2.0)])
def test_other_units_are_the_same_rig(units):
    pytest.importorskip("mujoco", reason="mujoco is not installed: pip install 'flexdrive[mujoco]'")
    drive = Drive({**LIMITED, "hardening_spring.k3": 4e-5}, units=units)
    found = verify_mujoco(drive, export_mujoco(drive, "rig"))
    assert max(d.relative for d in found if d.signal.startswith("x") and d.case != "at rest") < 5e-3


def test_what_it_cannot_hold_is_named_with_a_reason_here_and_in_the_file():
    drive = DEFAULT_DRIVE.replace({"stribeck.cart_1.extra": 0.1, "dead_zone.uz": 0.05, "hardening_spring.k3": 4e-5})
    exported = export_mujoco(drive, "rig")
    names = [line.partition(":")[0] for line in exported.left_out]
    assert names == [
        "dead_zone at actuator",
        "stribeck at cart_1",
        "encoder_quantisation at encoder_1",
        "encoder_quantisation at encoder_2",
    ]
    assert all(line in exported.text for line in exported.left_out)
    assert any(line.startswith("hardening_spring at spring") for line in exported.held)


def test_a_spring_of_two_stiffnesses_is_no_polynomial():
    exported = export_mujoco(DEFAULT_DRIVE.replace({"asymmetric_spring.k2": 5e-4, "asymmetric_spring.c": 0.4}), "rig")
    assert "asymmetric_spring at spring: its springs are polynomials" in exported.left_out
    assert not any(line.startswith("asymmetric_spring") for line in exported.held)


def test_details_of_contacts_are_no_elements():
    fine = {
        "coil_bind.kb": 0.05,
        "coil_bind.d0": 5.0,
        "coil_bind.n": 0.5,
        "coupling_backlash.g": 0.3,
        "coupling_backlash.loss": 2e-4,
    }
    exported = export_mujoco(DEFAULT_DRIVE.replace(fine), "rig")
    assert "coil_bind at spring: its springs are polynomials" in exported.left_out
    assert "the loss of the contacts of the play is left out" in exported.text
    assert any(line.startswith("coupling_backlash") for line in exported.held)


def test_the_model_in_figures():
    root = ET.fromstring(export_mujoco(Drive(LIMITED), "rig").text)
    joints = {j.get("name"): j.attrib for j in root.iter("joint") if j.get("name")}
    # 7.6e-4 V s²/mm are 0.76 V s²/m, 0.095 V/mm are 95 V/m
    assert float(joints["x1"]["frictionloss"]) == RIG["d1"]
    assert float(joints["x1"]["damping"].split()[0]) == pytest.approx(1e3 * RIG["b1"])
    assert [float(i.get("mass")) for i in root.iter("inertial")] == pytest.approx([1e3 * RIG["m1"], 1e3 * RIG["m2"]])
    assert float(next(root.iter("fixed")).get("stiffness").split()[0]) == pytest.approx(1e3 * RIG["k"])


def test_one_cart():
    pytest.importorskip("mujoco", reason="mujoco is not installed: pip install 'flexdrive[mujoco]'")
    drive = Drive({"m1": 1.1e-3, "b1": 0.0128, "d1": 0.6})
    found = verify_mujoco(drive, export_mujoco(drive, "cart"))
    assert {d.signal for d in found} == {"x1", "v1"}
    assert max(d.relative for d in found if d.signal == "x1" and d.case != "at rest") < 5e-3
