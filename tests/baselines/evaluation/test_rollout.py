"""A controller does the same however it is run: compiled, for many drives at once, or called sample by sample."""

import numpy as np
import pytest

from baselines.controllers import design
from baselines.evaluation.adapters import PolicyController
from baselines.evaluation.rollout import run_many
from flexdrive_gym import DEFAULT_DRIVE, LinearController
from flexdrive_gym.references import handout_trajectory
from flexdrive_gym.task import Task
from tests.called import Called
from tests.each import each

T = np.arange(1200) * 1e-3
XR = handout_trajectory(T)
DRIVES = [
    DEFAULT_DRIVE,
    DEFAULT_DRIVE.replace({"k": 0.12}),
    DEFAULT_DRIVE.replace({"input_delay.tau": 0.0034}),
    DEFAULT_DRIVE.replace({"stribeck.cart_1.extra": 0.15}),
]
TASK = Task("non_collocated", normalise=True)


class Network:
    """A policy with weights, a past, and both ways of asking."""

    history = 2

    def __init__(self, seed=0):
        rng = np.random.default_rng(seed)
        self.first, self.last = rng.normal(0.0, 0.5, (16, 16)), rng.normal(0.0, 0.5, (1, 16))
        self.reset()

    def reset(self):
        self.past = None

    def act_many(self, observations):
        seen = np.asarray(observations, dtype=np.float64)
        return np.tanh(np.tanh(20.0 * seen @ self.first.T) @ self.last.T)

    def __call__(self, observation):
        self.past = np.tile(observation, 2) if self.past is None else np.concatenate([observation, self.past[:8]])
        return self.act_many(self.past[None])[0]


class OneByOne:
    """The same policy without the way for many."""

    def __init__(self, policy):
        self.reset, self.policy = policy.reset, policy

    def __call__(self, observation):
        return self.policy(observation)


def test_a_policy_does_on_many_drives_what_it_does_on_each():
    together = run_many(PolicyController(Network(), TASK), DRIVES, XR)
    asked_alone = PolicyController(OneByOne(Network()), TASK, reference=XR)
    for drive, run in zip(DRIVES, together, strict=True):
        alone = drive.simulate_closed_loop(T, XR, asked_alone)
        shown = [alone.x1, alone.x2] if drive is DRIVES[0] else []
        for x, true in zip(shown, run[[0, 2]], strict=bool(shown)):
            assert np.max(np.abs(x - true)) < 0.005  # what an encoder counts is the state to one count
        assert np.max(np.abs(alone.u - run[4])) < 1e-9
    assert np.ptp(together[:, 2]) > 1.0  # something moved


def test_scaled_and_late_commands_are_the_same_in_a_batch_and_one_by_one():
    agent = PolicyController(Network(1), TASK)
    together = run_many(agent, DRIVES, XR, gains=[1.0, 0.5, 2.0, 1.0], late=[0, 7, 0, 31])
    one_by_one = run_many(Called(agent.following(XR)), DRIVES, XR, gains=[1.0, 0.5, 2.0, 1.0], late=[0, 7, 0, 31])
    assert np.max(np.abs(together - one_by_one)) < 1e-9


@each("name", ["p_x2", "lab4"])
def test_a_linear_controller_does_the_same_when_it_is_called(name):
    controller = design(name, DEFAULT_DRIVE).controller
    compiled = run_many(controller, DRIVES, XR, gains=0.8, late=3)
    called = run_many(Called(controller), DRIVES, XR, gains=0.8, late=3)
    assert np.max(np.abs(compiled - called)) < 1e-6


def test_a_slower_controller_holds_its_command_on_the_rig():
    controller = design("lab4", DEFAULT_DRIVE, sample_time=5e-3).controller

    class Held:
        def reset(self):
            controller.reset()
            self.calls = 0

        def __call__(self, observation):
            if self.calls % 5 == 0:
                self.u = controller(observation)
            self.calls += 1
            return self.u

    compiled, called = run_many(controller, DRIVES, XR), run_many(Held(), DRIVES, XR)
    assert np.max(np.abs(compiled - called)) < 1e-6
    steps = compiled[0, 4].reshape(-1, 5)
    assert np.all(steps == steps[:, :1])
    rig = DEFAULT_DRIVE.simulate_closed_loop(T, XR, controller)
    assert np.max(np.abs(rig.u - compiled[0, 4])) < 1e-9


def test_periods_that_do_not_fit_are_refused():
    slow = LinearController(*(np.zeros(s) for s in ((0, 0), (0, 3), (2, 0), (2, 3))), sample_time=2.5e-3)
    with pytest.raises(ValueError, match=r"must be a whole number of the rig's samples; got 0\.001 s"):
        run_many(slow, DRIVES, XR)
    with pytest.raises(ValueError, match=r"called every 0\.005 s; the rig runs at 0\.001 s"):
        run_many(PolicyController(Network(), TASK, sample_time=5e-3), DRIVES, XR)
