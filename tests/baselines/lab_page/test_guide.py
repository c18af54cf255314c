"""The handout's session, step by step."""

import pytest

pytest.importorskip("nicegui", reason="the lab's page needs NiceGUI: pip install 'flexdrive[lab]'")

from baselines.lab_page.panels.guide import steps_of
from flexdrive_gym.units import LAB, Units


def test_steps_are_told_in_the_units_of_the_rig():
    assert "Kp = 0.05 V/mm" in steps_of(LAB)["2.1"]
    assert "±1.5 V and ±2 V at 0.5 Hz" in steps_of(LAB)["2.5"]
    # 100 of the engine's mm in a radian, a tenth of its volts in a newton metre
    steps = steps_of(Units("rad", "N m", per_length=100.0, per_command=0.1))
    assert "Kp = 50 N m/rad" in steps["2.1"]
    assert "±25 N m from 0.5 Hz to 20 Hz" in steps["2.6"]
