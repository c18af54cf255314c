"""A policy of Stable-Baselines3 on the rig does what it does in its environment."""

import copy
import pickle

import gymnasium
import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="needs the extra rl")

from stable_baselines3 import PPO

from baselines.compare import compare
from baselines.rl.sb3 import controller_of
from baselines.rl.vec_env import FlexDriveVecEnv
from flexdrive_gym import DEFAULT_DRIVE
from flexdrive_gym.references import handout_trajectory


class Proportional:
    """Answers as a model's policy does: P-control from x2, of a normalised observation."""

    def __init__(self, env):
        self.observation_space = env.observation_space

    def predict(self, observation, *, deterministic):
        assert deterministic
        return np.clip(20.0 * observation[:, [2]], -1.0, 1.0), None


def untrained(env):
    return PPO("MlpPolicy", env, n_steps=16, batch_size=8, seed=0, device="cpu")


def test_it_does_what_it_does_in_its_environment():
    env = gymnasium.make("FlexDrive-NonCollocated-v0", normalise=True, duration=1.0)
    policy = Proportional(env)
    seen, info = env.reset(seed=0)
    x2 = []
    for _ in range(200):
        x2.append(info["read_x2"])
        seen, *_rest, info = env.step(policy.predict(seen[None, :], deterministic=True)[0][0])
    t = np.arange(1000) * 1e-3
    run = DEFAULT_DRIVE.simulate_closed_loop(t, handout_trajectory(t), controller_of(policy, env))
    assert np.ptp(x2) > 1.0
    assert run.x2[::5] == pytest.approx(x2, abs=0.05)


def test_it_competes_with_its_history_and_travels():
    env = FlexDriveVecEnv(2, sensing="non_collocated", history=3)
    controller = controller_of(untrained(env), env)
    found = compare(
        DEFAULT_DRIVE, {"mine": controller}, draws=0, effects=False, references=(), empirical=False,
        backend="sequential", duration=1.0,
    )  # fmt: skip
    assert np.isfinite(found.results[0].nominal.rms)
    row = np.zeros(8, np.float32)
    twins = [copy.deepcopy(controller.policy), pickle.loads(pickle.dumps(controller.policy))]
    assert all(np.array_equal(twin(row), controller.policy(row)) for twin in twins)
    assert len(repr(controller.policy)) < 100


def test_another_environment_is_refused():
    env = FlexDriveVecEnv(2, sensing="non_collocated")
    with pytest.raises(ValueError, match="env: must be the one of the training"):
        controller_of(untrained(env), FlexDriveVecEnv(2, sensing="full_state"))
