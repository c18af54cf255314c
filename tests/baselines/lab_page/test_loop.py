"""Charts of the loop, lamp and signature, against what the project computes elsewhere."""

import numpy as np
import pytest

from baselines.controllers.p_control import proportional
from baselines.lab_page.loop_curves import (
    AMPLITUDES_MM,
    amplitude_limit,
    nyquist_and_bode,
    poles,
    read,
    root_locus,
    smallest_growing,
    unit_p,
)
from baselines.lab_page.motion import rig_of
from baselines.lab_page.settings import Settings
from baselines.lab_page.signature import plainly_present, signature, switches
from baselines.lab_page.stability_lamp import lamp
from baselines.loop_analysis.loops import linear_part
from baselines.loop_analysis.margins import margins
from baselines.loop_analysis.stability_limit import critical_gain, with_rig
from flexdrive_gym import DEFAULT_DRIVE

RIG = with_rig(DEFAULT_DRIVE)


def test_margins_are_those_of_python_control():
    expected = margins(RIG, proportional(0.05))
    found = read(RIG, proportional(0.05))
    assert found.stable
    assert found.gain_margin == pytest.approx(expected.gain_margin, rel=2e-3)
    assert found.phase_margin_deg == pytest.approx(expected.phase_margin_deg, abs=0.1)
    assert found.crossover == pytest.approx(expected.crossover, rel=2e-3)


def test_poles_cross_the_axis_at_the_gain_margin():
    limit = read(RIG, unit_p("x2", 1e-3)).gain_margin
    linear = linear_part(RIG)
    assert np.max(poles(linear, proportional(0.99 * limit)).real) < 1e-6
    assert np.max(poles(linear, proportional(1.01 * limit)).real) > 1e-3


def test_charts_follow_the_gain():
    law = unit_p("x2", 1e-3)
    low, high = (nyquist_and_bode(RIG, law, kp)[1].series[0].y for kp in (0.05, 0.1))
    assert high[5] == pytest.approx(2.0 * low[5], rel=1e-4)
    assert root_locus(RIG, law, 0.05).series[1].x != root_locus(RIG, law, 0.1).series[1].x


def judged(gain, feedback="x2", drive=RIG):
    law = unit_p(feedback, 1e-3)
    found = nyquist_and_bode(drive, law, gain)[3]
    return lamp(drive, law, gain, found, smallest_growing(amplitude_limit(drive, law), gain), "V/mm")


def test_the_lamp_turns_at_the_drives_critical_gain():
    critical = critical_gain(RIG)
    assert critical is not None
    assert judged(0.99 * critical).level == "held"
    assert judged(1.01 * critical).level == "unstable"


def test_the_lamp_says_why():
    assert "The linear limit is 0.179 V/mm" in judged(0.05).sentence
    held = judged(0.25).sentence
    assert "0.61 V of Coulomb friction" in held
    assert "strike a cart" in held
    assert judged(2.0, "x1").level == "stable"


def test_the_limit_falls_with_amplitude_to_the_linear_one():
    factors = amplitude_limit(RIG, unit_p("x2", 1e-3))
    small, large = AMPLITUDES_MM < 20.0, factors[np.isfinite(factors)].min()
    assert np.all(np.diff(factors[small]) < 0.0)
    assert large == pytest.approx(read(RIG, unit_p("x2", 1e-3)).gain_margin, rel=0.15)


def test_a_drag_shows_as_a_force_against_velocity():
    charts = signature(DEFAULT_DRIVE, {"quadratic_drag.cart_1.c": 2e-5})
    v, g = (np.array(axis, dtype=float) for axis in (charts[0].series[0].x, charts[0].series[0].y))
    fast = np.abs(v) > 60.0
    expected = -2e-5 * v * np.abs(v)
    assert np.corrcoef(g[fast], expected[fast])[0, 1] > 0.9
    assert np.polyfit(expected[fast], g[fast], 1)[0] == pytest.approx(1.0, abs=0.25)


def test_every_switch_gives_a_drive_that_runs():
    for effect in switches():
        for where in effect.where:
            values = plainly_present(effect, where)
            assert rig_of(Settings(effects=values), RIG).values != RIG.values, effect.id
