"""Gymnasium's own wrappers and vector environments run over every environment."""

import gymnasium
import numpy as np
import pytest
from gymnasium import wrappers
from gymnasium.wrappers import vector as vector_wrappers

import flexdrive_gym  # noqa: F401  (registers the environments)
from tests.each import each

IDS = [f"FlexDrive-{name}-v0" for name in ("Collocated", "NonCollocated", "FullState")]
SHORT = {"duration": 0.05}


def episode(env, action=0.3):
    """Run one episode; return how many steps it took, and the last info."""
    env.reset(seed=0)
    for k in range(100):
        *_rest, terminated, truncated, info = env.step(np.array([action], np.float32))
        if terminated or truncated:
            return k + 1, info
    raise AssertionError("the episode does not end")


@pytest.mark.parametrize("name", IDS)
def test_record_video(name, tmp_path):
    pytest.importorskip("moviepy", reason="needs MoviePy, of the extra render")
    pytest.importorskip("pygame", reason="needs the extra render")
    env = gymnasium.make(name, render_mode="rgb_array", duration=0.02)
    env = wrappers.RecordVideo(env, str(tmp_path / "video"), episode_trigger=lambda _i: True, disable_logger=True)
    episode(env)
    env.close()
    assert [p.stat().st_size > 1000 for p in (tmp_path / "video").glob("*.mp4")] == [True]


def test_record_video_of_a_batch(tmp_path):
    pytest.importorskip("moviepy", reason="needs MoviePy, of the extra render")
    pytest.importorskip("pygame", reason="needs the extra render")
    env = gymnasium.make_vec(IDS[1], num_envs=2, render_mode="rgb_array", duration=0.02)
    env = vector_wrappers.RecordVideo(env, str(tmp_path / "video"), video_length=3, disable_logger=True)
    env.reset(seed=0)
    for _ in range(4):
        env.step(np.zeros((2, 1), np.float32))
    env.close()
    assert len(list((tmp_path / "video").glob("*.mp4"))) == 1


@each("name", IDS)
def test_record_episode_statistics(name):
    steps, info = episode(wrappers.RecordEpisodeStatistics(gymnasium.make(name, **SHORT)))
    assert info["episode"]["l"] == steps == 10
    assert info["episode"]["r"] < 0.0
    batch = vector_wrappers.RecordEpisodeStatistics(gymnasium.make_vec(name, num_envs=2, **SHORT))
    batch.reset(seed=0)
    for _ in range(10):
        info = batch.step(np.zeros((2, 1), np.float32))[4]
    assert info["episode"]["l"].tolist() == [10, 10]


@each("name", IDS)
def test_frame_stack(name):
    env = wrappers.FrameStackObservation(gymnasium.make(name, **SHORT), 3)
    assert env.observation_space.contains(env.reset(seed=0)[0])
    assert episode(env)[0] == 10


@each("name", IDS)
def test_normalised_observations(name):
    env = wrappers.NormalizeObservation(gymnasium.make(name, **SHORT))
    assert episode(env)[0] == 10
    assert np.isfinite(env.obs_rms.mean).all()


def test_all_of_them_together(tmp_path):
    # the order in which a training script stacks them
    pytest.importorskip("moviepy", reason="needs MoviePy, of the extra render")
    pytest.importorskip("pygame", reason="needs the extra render")
    env = gymnasium.make(IDS[1], render_mode="rgb_array", randomise={"d1": (0.2, 0.5)}, duration=0.02)
    env = wrappers.RecordVideo(env, str(tmp_path / "video"), episode_trigger=lambda _i: True, disable_logger=True)
    env = wrappers.FrameStackObservation(wrappers.NormalizeObservation(wrappers.RecordEpisodeStatistics(env)), 2)
    steps, info = episode(env)
    assert (steps, info["episode"]["l"]) == (4, 4)
    assert env.observation_space.shape == (2, *gymnasium.make(IDS[1]).observation_space.shape)
    env.close()
    assert len(list((tmp_path / "video").glob("*.mp4"))) == 1


def test_wrapped_batches():
    batch = gymnasium.make_vec(IDS[2], num_envs=3, **SHORT)
    env = vector_wrappers.NormalizeObservation(vector_wrappers.RecordEpisodeStatistics(batch))
    env.reset(seed=0)
    for _ in range(11):
        observation, *_rest = env.step(np.full((3, 1), 0.3, np.float32))
    assert observation.shape == env.observation_space.shape
    assert np.isfinite(observation).all()
    assert np.isfinite(env.obs_rms.mean).all()


@pytest.mark.parametrize("shared_memory", [True, False])
def test_processes_of_their_own(shared_memory):
    # a process per drive costs a second each, and the three differ in what is seen alone
    env = gymnasium.vector.AsyncVectorEnv([lambda: gymnasium.make(IDS[1], **SHORT)] * 2, shared_memory=shared_memory)
    batch = gymnasium.make_vec(IDS[1], num_envs=2, **SHORT)
    try:
        assert np.array_equal(env.reset(seed=3)[0], batch.reset(seed=3)[0])
        action = np.full((2, 1), 0.4, np.float32)
        for _ in range(12):
            a, b = env.step(action), batch.step(action)
            assert np.array_equal(a[0], b[0])
    finally:
        env.close()
