"""What an environment refuses, with an error that names the argument, the rule and the value."""

import gymnasium
import numpy as np
import pytest

from tests.each import each

NON_COLLOCATED = "FlexDrive-NonCollocated-v0"


@each(
    ("arguments", "text"),
    [
        ({"drive": 3}, "drive: must be a Drive or the path"),
        ({"drivee": 3}, "drivee: the environment has no such argument.*Did you mean 'drive'"),
        ({"randomise": 3}, "randomise: must be a mapping from names to values; got 3"),
        ({"randomise": {"m1": 3}}, "m1 must be \\(low, high\\)"),
        ({"preview": 3}, "preview: must be a list of times ahead"),
        ({"randomise": ("m1",)}, "randomise: must be a mapping from names to values"),
        ({"randomise": True}, "randomise: must be a mapping from names to values; got True"),
        ({"randomise": {"m1": np.array(6e-4)}}, "m1 must be \\(low, high\\)"),
        ({"preview": "0.1"}, "preview: must be a list of times ahead"),
        ({"preview": None}, "preview: must be a list of times ahead \\[s\\], \\(\\) for none; got None"),
        ({"preview": np.array(0.1)}, "preview: must be a list of times ahead"),
        ({"preview": {0.1: 1.0}}, "preview: must be a list of times ahead"),
        ({"preview": ([0.1],)}, "preview: must be times ahead"),
        ({"reward": ["effort"]}, "reward: must be a mapping from names to values"),
        ({"reward": {"effort": [1.0]}}, "the weight of effort must be a number"),
        ({"reward": 3}, "reward: must be a mapping from names to values; got 3"),
        ({"effects": [1]}, "effects: must be a mapping"),
        ({"reference": "sine:amplitud=10"}, "reference: 'sine' has no keyword 'amplitud'"),
        ({"reference": "sine:amplitude"}, "reference: must be name:keyword=number"),
        ({"control_period": -1.0}, "control_period: must be a positive number; got -1"),
        ({"control_period": 5e-3, "physics_step": 3e-3}, "physics_step: the control period must be a whole number"),
        ({"reference": "handoutt"}, "reference"),
        ({"reference": np.array([1e4] * 10)}, "reference: must stay within the travel"),
        ({"preview": (-1.0,)}, "preview: must be times ahead"),
        ({"reward": {"traking": 1.0}}, "Did you mean 'tracking'"),
        ({"reward": {"tracking": -1.0}}, "must be a number of at least 0"),
        ({"randomise": "identified"}, "needs a drive with a covariance"),
        ({"randomise": {"m1": (2.0, 1.0)}}, "m1 must be \\(low, high\\)"),
        ({"randomise": {"mass": (2.0, 1.0)}}, "randomise: parameter: no parameter"),
        ({"effects": {"stribek.cart_1.vs": 1.0}}, "effects: parameter: no parameter"),
        ({"sensor_delay": 0.007}, "sensor_delay: must be a whole number of control periods"),
        ({"noise": -1.0}, "noise: must be a number of at least 0"),
        ({"duration": float("nan")}, "duration: must be a positive number"),
    ],
)
def test_wrong_arguments_are_named(arguments, text):
    with pytest.raises((ValueError, TypeError), match=text):
        gymnasium.make(NON_COLLOCATED, **arguments)


@each("bad", [[np.nan], np.array([np.inf]), float("nan"), [0.1, 0.2], ["u"], None])
def test_an_action_that_is_no_number_is_refused_and_moves_nothing(bad):
    env, twin = gymnasium.make(NON_COLLOCATED), gymnasium.make(NON_COLLOCATED)
    env.reset(seed=0)
    twin.reset(seed=0)
    with pytest.raises(ValueError, match="action: must be"):
        env.step(bad)
    assert np.array_equal(env.step([0.5])[0], twin.step(0.5)[0])


@each(
    ("options", "text"),
    [
        ({"x3": 1.0}, "options: must be among state, x1, v1, x2, v2; got 'x3'"),
        ({"x1": "far"}, "options: x1 must be one finite number"),
        ({"x1": 300.0, "x2": 300.0}, "options: x1 must be within the travel"),
        ({"x1": 200.0}, "options: x1 - x2 must be within the spring's stroke"),
        ({"state": (0.0, 1.0)}, "options: state must be four finite numbers"),
        ({"state": (0.0, 0.0, 0.0, 0.0), "x1": 1.0}, "not both"),
        (3, "options: must be a mapping"),
    ],
)
def test_wrong_starts_are_named(options, text):
    with pytest.raises((ValueError, TypeError), match=text):
        gymnasium.make(NON_COLLOCATED).unwrapped.reset(options=options)
