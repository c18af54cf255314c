"""Stable-Baselines3 takes the batch as its own, and learns from time limits as it should."""

import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="needs the extra rl")

from stable_baselines3 import PPO

from baselines.rl.vec_env import FlexDriveVecEnv
from flexdrive_gym.vector import FlexDriveVectorEnv


def test_episode_ends_carry_what_sb3_reads():
    env = FlexDriveVecEnv(3, sensing="non_collocated", duration=0.05)
    plain = FlexDriveVectorEnv(3, sensing="non_collocated", duration=0.05, autoreset_mode="disabled", normalise=True)
    env.seed(4)
    env.reset()
    plain.reset(seed=4)
    total = np.zeros(3)
    for _ in range(10):
        actions = np.full((3, 1), 0.2, np.float32)
        observation, reward, done, infos = env.step(actions)
        last = plain.step(actions)
        total += last[1]
    assert done.all()
    for j, info in enumerate(infos):
        assert info["TimeLimit.truncated"] is True
        assert np.array_equal(info["terminal_observation"], last[0][j])
        assert info["episode"]["l"] == 10
        assert info["episode"]["r"] == pytest.approx(total[j])
    assert reward.dtype == np.float32
    assert observation.shape == (3, 8)


def test_leaving_the_travel_is_not_a_time_limit():
    env = FlexDriveVecEnv(1, sensing="non_collocated", travel_limit=55.0)
    env.reset()
    for _ in range(300):
        _o, _r, done, infos = env.step(np.ones((1, 1), np.float32))
        if done[0]:
            break
    assert infos[0]["TimeLimit.truncated"] is False


def test_ppo_trains_on_it():
    env = FlexDriveVecEnv(8, sensing="collocated")
    model = PPO("MlpPolicy", env, n_steps=16, batch_size=64, n_epochs=1, seed=0)
    model.learn(256)
    assert model.num_timesteps == 256
    action, _state = model.predict(env.reset(), deterministic=True)
    assert action.shape == (8, 1)


def test_attributes_and_methods_reach_the_batch():
    env = FlexDriveVecEnv(2, sensing="collocated")
    assert env.get_attr("num_envs", [0]) == [2]
    assert env.env_is_wrapped(object) == [False, False]
    with pytest.raises(AttributeError, match="share their task"):
        env.set_attr("task", None)
