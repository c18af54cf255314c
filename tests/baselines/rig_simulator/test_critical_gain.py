"""The rig's true critical gain: the package's where nothing is concealed, and moved by what is."""

import numpy as np
import pytest

from baselines.loop_analysis import stability_limit
from baselines.rig_simulator.critical_gain import critical_gain, one_move
from baselines.rig_simulator.truth import draw_truth
from flexdrive_gym import Drive
from flexdrive_gym.references import point_to_point


def test_the_reference_is_the_handouts_first_move():
    t = np.arange(2000) * 1e-3
    assert one_move(t) == pytest.approx(point_to_point(t), abs=1e-9)


def test_without_effects_it_is_the_packages_simulated_limit():
    truth = draw_truth(2, "null")
    predicted = stability_limit.critical_gain(Drive(dict(truth.drive)), "x2")
    assert critical_gain(truth) == pytest.approx(predicted, rel=0.01)


def test_with_a_concealed_delay_it_is_the_packages_with_that_delay():
    truth = draw_truth(2, "effect", effect=("input_delay", "actuator"), size=2.0)
    drive = Drive({**truth.drive, "input_delay.tau": truth.effects[0].parameters["wait"]})
    assert critical_gain(truth) == pytest.approx(stability_limit.critical_gain(drive, "x2"), rel=0.01)
