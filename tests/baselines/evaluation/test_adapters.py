"""Controllers in environments and policies on the rig are the same loop."""

import gymnasium
import numpy as np
import pytest

from baselines.controllers import design
from baselines.controllers.p_control import proportional
from baselines.evaluation.adapters import PolicyController, run_in_environment
from baselines.evaluation.rollout import run_many
from baselines.loop_analysis.empirical_margins import empirical_margins
from baselines.loop_analysis.margins import margins
from flexdrive_gym import DEFAULT_DRIVE
from flexdrive_gym.references import handout_trajectory
from tests.each import each

T = np.arange(2000) * 1e-3


def make(**arguments):
    return gymnasium.make("FlexDrive-NonCollocated-v0", drive=DEFAULT_DRIVE, duration=2.0, **arguments)


@each("name", ["p_x2", "lab4_friction", "cascade"])
def test_in_the_environment_a_controller_does_what_it_does_on_the_rig(name):
    controller = design(name, DEFAULT_DRIVE).controller
    inside = run_in_environment(make(control_period=1e-3, velocity_cutoff=0.0), controller, seed=0)
    rig = DEFAULT_DRIVE.simulate_closed_loop(T, handout_trajectory(T), controller)
    # an action is single precision
    assert np.max(np.abs(inside.x2 - rig.x2)) < 0.02
    assert np.max(np.abs(inside.u - rig.u)) < 0.5


@each("normalise", [False, True])
def test_on_the_rig_a_policy_sees_what_it_sees_in_its_environment(normalise):
    env = make(normalise=normalise)
    weights = np.array([0.1, -0.02, 0.9, 0.1, 0.1, 0.05, 0.0, 0.0], dtype=np.float32) * (20.0 if normalise else 0.05)

    def policy(observation):
        return np.clip(weights @ observation, -1.0, 1.0, dtype=np.float32).reshape(1)

    observation, info = env.reset(seed=0)
    inside = []
    for _ in range(400):
        inside.append(info["read_x2"])
        observation, _reward, _over, _end, info = env.step(policy(observation))
    controller = PolicyController(policy, env.unwrapped.task)
    rig = DEFAULT_DRIVE.simulate_closed_loop(T, handout_trajectory(T), controller)
    assert np.max(np.abs(np.array(inside) - rig.x2[::5])) < 0.02


def test_a_policy_that_answers_no_number_is_refused():
    env = make()
    controller = PolicyController(lambda _seen: np.array([np.nan]), env.unwrapped.task)
    with pytest.raises(ValueError, match="policy: must return a finite action; got nan at t = 0 s"):
        DEFAULT_DRIVE.simulate_closed_loop(T, handout_trajectory(T), controller)
    with pytest.raises(ValueError, match="policy: must return a finite action"):
        run_many(controller, [DEFAULT_DRIVE], handout_trajectory(T))
    for road in (
        lambda: run_in_environment(env, lambda _seen: float("nan")),
        lambda: run_many(lambda _seen: float("nan"), [DEFAULT_DRIVE], handout_trajectory(T)),
    ):
        with pytest.raises(ValueError, match="controller: must return a finite command"):
            road()


def test_periods_must_fit():
    controller = design("p_x2", DEFAULT_DRIVE).controller
    with pytest.raises(ValueError, match=r"Pass control_period=0\.001"):
        run_in_environment(make(), controller)
    with pytest.raises(ValueError, match="must divide the control period"):
        PolicyController(lambda _o: 0.0, make().unwrapped.task, sample_time=3e-3)


def test_a_policy_is_told_the_reference_that_it_previews():
    env = make()
    controller = PolicyController(lambda o: o[-1], env.unwrapped.task)  # acts on the reference 0.1 s ahead alone
    t = np.arange(400) * 1e-3
    xr = np.where(t >= 0.2, 1.0, 0.0)
    run = DEFAULT_DRIVE.simulate_closed_loop(t, xr, controller.following(xr))
    assert np.flatnonzero(run.u)[0] == 100


def test_a_policy_has_margins_by_trial():
    """A policy that is P-control has P-control's margin, less what its slower period costs."""
    task = make(preview=()).unwrapped.task
    gain = 0.12

    def policy(observation):
        return gain * observation[2] / task.voltage

    found = empirical_margins(DEFAULT_DRIVE, PolicyController(policy, task), duration=6.0, quantities=("gain",))
    # held for 5 ms instead of 1 ms: as if the drive were 2 ms later
    late = DEFAULT_DRIVE.replace({"input_delay.tau": 0.002})
    assert found.gain_margin == pytest.approx(margins(late, proportional(gain)).gain_margin, rel=0.02)
