"""The batched environment is the single one, many times, to the last bit."""

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode

from flexdrive_gym import Drive
from flexdrive_gym.drive.layout import GROUP, LANES
from flexdrive_gym.fleet import KEYS, LEAST_PER_THREAD
from tests.drive.drives import RIG
from tests.each import each

ID = "FlexDrive-NonCollocated-v0"
RANDOM = {
    "randomise": {"m1": (6e-4, 9e-4), "k": (0.07, 0.12), "d2": (0.05, 0.3)},
    "noise": 0.02,
    "reference": "random_moves",
}
VARIANTS = {
    "plain": {},
    "randomised": RANDOM,
    "delayed": {"effects": {"input_delay.tau": 0.0033}, "noise": 0.02},
    "1 ms": {"control_period": 1e-3},
    "several leaps": {"control_period": 0.02, "randomise": {"m2": (2e-4, 5e-4), "C": (0.0, 0.001)}},
    "mostly at rest": {"voltage_limit": 0.7},
    "late sensors": {"sensor_delay": 0.015, "noise": 0.02},
    "late and loose encoders": {
        "effects": {
            "encoder_play.encoder_1.g": 0.2,
            "encoder_play.encoder_2.g": 0.1,
            "encoder_delay.encoder_2.tau": 0.0071,
            "rectified_sensor.encoder_1.share": 1.0,
        },
        "noise": 0.02,
    },
    "bristles, a lag, a loose motor and an appendage": {
        "effects": {
            "presliding.cart_2.fd": 0.1,
            "presliding.cart_2.xs": 0.1,
            "spring_hysteresis.level": 0.05,
            "amplifier_lag.tau": 0.003,
            "motor_gear_backlash.mass": 1e-4,
            "extra_mode.mass_2": 5e-5,
            "base_recoil.compliance": 0.01,
            "stribeck.cart_1.extra": 0.1,
            "input_delay.tau": 0.0012,
        },
    },
    "randomised effects": {
        "randomise": {
            "stribeck.cart_1.extra": (0.0, 0.2),
            "presliding.cart_1.fd": (0.0, 0.2),
            "encoder_play.encoder_2.g": (0.0, 0.3),
            "amplifier_lag.tau": (0.001, 0.005),
            "m1": (6e-4, 9e-4),
        },
        "noise": 0.02,
    },
    "frictionless": {"drive": Drive({**RIG, "d1": 0.0, "d2": 0.0})},
}


def batched(n, **arguments):
    return gymnasium.make_vec(ID, num_envs=n, vectorization_mode="vector_entry_point", **arguments)


def singles(n, actions, seed, **arguments):
    """The same actions through n single environments with a reset at every end, as next-step autoreset makes it."""
    traces = []
    for j in range(n):
        env = gymnasium.make(ID, **arguments)
        trace, done = [env.reset(seed=seed + j)[0]], False
        for action in actions[:, j]:
            if done:
                observation, done = env.reset()[0], False
                trace.append(np.append(observation, [0.0, False, False]))
                continue
            observation, reward, terminated, truncated, _info = env.step(action)
            trace.append(np.append(observation.astype(np.float64), [reward, terminated, truncated]))
            done = terminated or truncated
        traces.append(np.array(trace[1:]))
    return np.array(traces)


@each("name", VARIANTS)
@each("n", [1, 3, 140])
def test_bit_equal_to_the_single_environment(name, n):
    steps = {1: 2000, 3: 700, 140: 40}[n]
    arguments = {"duration": 0.4, "travel_limit": 70.0, **VARIANTS[name]}
    actions = np.random.default_rng(5).uniform(-1, 1, (steps, n, 1)).astype(np.float32)
    env = batched(n, **arguments)
    env.reset(seed=11)
    found = []
    for action in actions:
        observation, reward, terminated, truncated, _info = env.step(action)
        found.append(np.column_stack([observation.astype(np.float64), reward, terminated, truncated]))
    assert np.array_equal(np.swapaxes(np.array(found), 0, 1), singles(n, actions, 11, **arguments))


@each("arguments", [RANDOM, {"effects": {"input_delay.tau": 0.0033}}])
def test_a_drive_does_not_notice_its_neighbours(arguments):
    # drives with an event are moved together, of a group of strips at a time: here one group and a bit
    first = GROUP * LANES - 5
    many, few = batched(first + 20, duration=0.1, **arguments), batched(20, duration=0.1, **arguments)
    assert np.array_equal(many.reset(seed=3)[0][first:], few.reset(seed=3 + first)[0])
    actions = np.random.default_rng(4).uniform(-1, 1, (45, first + 20, 1)).astype(np.float32)
    for action in actions:
        for a, b in zip(many.step(action)[:4], few.step(action[first:])[:4], strict=True):
            assert np.array_equal(a[first:], b)


@pytest.mark.slow
def test_bit_equal_over_ten_thousand_steps_with_resets_and_randomisation():
    arguments = {"duration": 0.7, "travel_limit": 90.0, **RANDOM}
    actions = np.random.default_rng(6).uniform(-1, 1, (10_000, 4, 1)).astype(np.float32)
    env = batched(4, **arguments)
    env.reset(seed=2)
    found = []
    for action in actions:
        observation, reward, terminated, truncated, _info = env.step(action)
        found.append(np.column_stack([observation.astype(np.float64), reward, terminated, truncated]))
    assert np.array_equal(np.swapaxes(np.array(found), 0, 1), singles(4, actions, 2, **arguments))


def test_same_step_reset_keeps_the_last_observation():
    env = batched(3, autoreset_mode="same_step", duration=0.05)
    reference = batched(3, autoreset_mode="disabled", duration=0.05)
    assert env.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    env.reset(seed=0)
    reference.reset(seed=0)
    action = np.full((3, 1), 0.3, np.float32)
    for _ in range(10):
        observation, reward, _t, truncated, info = env.step(action)
        last, last_reward, *_rest = reference.step(action)
    assert truncated.all()
    assert np.array_equal(np.stack(info["final_obs"]), last)
    assert np.array_equal(reward, last_reward)
    assert info["final_info"]["x1"][0] > 0.0
    assert np.all(observation[:, 0] == 0.0)  # already the next episode's


@each("name", ["Collocated", "NonCollocated", "FullState"])
@each("preview", [(), (0.1,), (0.02, 0.05, 0.1)])
@each("normalise", [False, True])
def test_every_drive_sees_its_own_place_of_the_reference(name, preview, normalise):
    env = gymnasium.make_vec(
        f"FlexDrive-{name}-v0", num_envs=150, vectorization_mode="vector_entry_point", autoreset_mode="disabled",
        reference="sine", preview=preview, normalise=normalise, duration=1.0,
    )  # fmt: skip
    env.reset(seed=0)
    places = np.zeros(150, dtype=int)
    for k in range(20):
        observation = env.step(np.zeros((150, 1), np.float32))[0]
        places += 1
        mask = np.arange(150) % 7 == k % 7
        if k < 19:
            env.reset(options={"reset_mask": mask})
            places[mask] = 0
    reference, bounds = env.task.references[0], np.array([bound for _name, _unit, bound in env.task.names()])
    ahead = [round(a / env.task.control_period) for a in preview]
    entries = [-2 - len(ahead), *range(-len(ahead), 0)]
    expected = np.array([reference[places + a] for a in (0, *ahead)]).T / (bounds[entries] if normalise else 1.0)
    assert len(set(places)) > 5
    assert observation[:, entries] == pytest.approx(expected, rel=1e-6, abs=1e-7)


def test_masked_reset_leaves_the_others_alone():
    env = batched(4, autoreset_mode="disabled")
    env.reset(seed=0)
    for _ in range(30):
        before = env.step(np.full((4, 1), 0.5, np.float32))[0]
    mask = np.array([True, False, False, True])
    after, info = env.reset(options={"reset_mask": mask})
    assert np.all(after[mask, 0] == 0.0)
    assert np.array_equal(after[~mask], before[~mask])
    assert np.array_equal(info["_x1"], mask)
    with pytest.raises(ValueError, match="reset_mask: must be a boolean array"):
        env.reset(options={"reset_mask": np.zeros(4, bool)})


def test_what_a_step_returned_stays_as_it_was():
    # arrays are used again once nobody refers to them, be it through a view, and not before
    env = batched(3, autoreset_mode="disabled")
    kept, copies = [env.reset(seed=0)[0]], []
    copies.append(kept[0].copy())
    for k in range(12):
        observation, reward, *_rest = env.step(np.full((3, 1), 0.1 * k, np.float32))
        for array in (observation[1], reward[:2]) if k % 2 else (observation, reward):
            kept.append(array)
            copies.append(array.copy())
        del observation, reward, _rest
    env.reset(options={"reset_mask": np.array([True, False, False])})
    for array, copy in zip(kept, copies, strict=True):
        assert np.array_equal(array, copy)


def test_actions_of_another_shape_or_kind():
    env, twin = batched(4), batched(4)
    env.reset(seed=0)
    twin.reset(seed=0)
    a = env.step(np.full((4, 1), 0.5, np.float32))[0]
    assert np.array_equal(a, twin.step([0.5, 0.5, 0.5, 0.5])[0])
    with pytest.raises(ValueError, match="reshape"):
        env.step(np.zeros((3, 1), np.float32))


def test_an_ended_episode_is_not_stepped_on_unless_it_is_reset():
    env = batched(3, autoreset_mode="disabled", duration=0.05)
    zero = np.zeros((3, 1), np.float32)
    with pytest.raises(ResetNeeded, match="before the first step"):
        env.step(zero)
    env.reset(seed=0)
    for k in range(10):
        truncated = env.step(zero)[3]
        if k == 3:
            env.reset(options={"reset_mask": np.array([False, True, False])})
    assert truncated.tolist() == [True, False, True]
    with pytest.raises(ResetNeeded, match="drive 0 must be reset after the end of its episode, and 1 more"):
        env.step(zero)
    env.reset(options={"reset_mask": truncated})
    assert np.isfinite(env.step(zero)[0]).all()


@each("bad", [np.nan, np.inf])
@each("mode", ["next_step", "same_step"])
def test_an_action_that_is_no_number_is_refused_and_moves_nothing(bad, mode):
    env, twin = batched(140, autoreset_mode=mode), batched(140, autoreset_mode=mode)
    env.reset(seed=0)
    twin.reset(seed=0)
    action = np.full((140, 1), 0.4, np.float32)
    action[130] = bad
    with pytest.raises(ValueError, match="action: must be a finite number.*for drive 130"):
        env.step(action)
    action[130] = 0.4
    assert np.array_equal(env.step(action)[0], twin.step(action)[0])


def test_threads_refuse_together():
    env, twin = batched(2 * LEAST_PER_THREAD, threads=2), batched(2 * LEAST_PER_THREAD)
    env.reset(seed=0)
    twin.reset(seed=0)
    action = np.full((2 * LEAST_PER_THREAD, 1), 0.4, np.float32)
    action[-1], fine = np.nan, action.copy()
    with pytest.raises(ValueError, match="action: must be a finite number"):
        env.step(action)
    assert np.array_equal(env.step(fine)[0], twin.step(fine)[0])


def test_drives_start_where_they_are_told():
    env = batched(3)
    info = env.reset(seed=0, options={"x1": 10.0, "x2": 12.0, "v2": -3.0})[1]
    assert [set(info[k]) for k in ("x1", "x2", "v1", "v2")] == [{10.0}, {12.0}, {0.0}, {-3.0}]
    with pytest.raises(ValueError, match=r"got 'reset_maks'. Did you mean 'reset_mask'\?"):
        env.reset(options={"reset_maks": np.ones(3, bool)})


@each("mode", ["next_step", "same_step"])
def test_drawn_parameters_are_told_when_an_episode_begins(mode):
    env = batched(3, autoreset_mode=mode, randomise={"m1": (6e-4, 9e-4), "d1": (0.2, 0.5)}, duration=0.01)
    first = env.reset(seed=0)[1]["parameters"]
    single = gymnasium.make(ID, randomise={"m1": (6e-4, 9e-4), "d1": (0.2, 0.5)}).unwrapped
    told = single.reset(seed=1)[1]["parameters"]
    assert told == {"m1": pytest.approx(single.drive["m1"]), "d1": single.drive["d1"]}
    assert {name: first[name][1] for name in told} == told
    assert "parameters" not in env.step(np.zeros((3, 1), np.float32))[4]
    zero = np.zeros((3, 1), np.float32)
    info = env.step(zero)[4] if mode == "same_step" else [env.step(zero)[4] for _ in range(2)][1]
    assert info["_parameters"].all()
    assert np.all(info["parameters"]["d1"] != first["d1"])


def test_a_batch_is_drawn_as_one_picture_per_drive():
    pytest.importorskip("pygame", reason="needs the extra render")
    env = batched(2, render_mode="rgb_array", duration=0.02)
    with pytest.raises(ResetNeeded, match="render"):
        env.render()
    env.reset(seed=0)
    first = env.render()
    for _ in range(3):
        env.step(np.array([[0.0], [1.0]], np.float32))
    last = env.render()
    assert [frame.shape for frame in last] == [(480, 960, 3)] * 2
    assert not np.array_equal(first[1], last[1])
    env.close()


def test_the_time_limit_is_in_the_spec():
    assert batched(2, duration=1.0).spec.max_episode_steps == 200


def test_seeds_one_per_environment():
    env = batched(3, **RANDOM)
    a = env.reset(seed=7)[0]
    b = env.reset(seed=[7, 8, 9])[0]
    assert np.array_equal(a, b)
    assert not np.array_equal(a[0], a[1])
    with pytest.raises(ValueError, match="seed: must be one number or 3"):
        env.reset(seed=[1, 2])


def test_physical_info_when_asked_for():
    env = batched(2, physical_info=True)
    env.reset(seed=0)
    info = env.step(np.full((2, 1), 0.5, np.float32))[4]
    assert set(KEYS) <= set(info)
    assert np.all(info["u"] == pytest.approx(4.0))


def test_spaces_and_batches_match():
    env = batched(5)
    observation, _info = env.reset(seed=0)
    assert env.observation_space.contains(observation)
    assert env.single_observation_space.shape == observation.shape[1:]
    assert env.action_space.shape == (5, 1)


@each("arguments", [{}, RANDOM])
def test_threads_change_nothing(arguments):
    n = 2 * LEAST_PER_THREAD + 100
    envs = [batched(n, threads=threads, duration=0.1, **arguments) for threads in (1, 2)]
    assert len(envs[1].fleet.outputs.blocks) > 1
    actions = np.random.default_rng(8).uniform(-1, 1, (25, n, 1)).astype(np.float32)
    first = [env.reset(seed=1)[0] for env in envs]
    assert np.array_equal(*first)
    for action in actions:
        a, b = (env.step(action) for env in envs)
        for x, y in zip(a[:4], b[:4], strict=True):
            assert np.array_equal(x, y)


def test_memory_per_environment_is_small():
    env = batched(1000, **RANDOM)
    used = sum(a.nbytes for name, a in env.fleet.arrays.items() if name not in {"lookup", "work"})
    assert used / 1000 <= 1024


@each(
    ("arguments", "text"),
    [
        ({"num_envs": 0}, "num_envs"),
        ({"num_envs": 2, "autoreset_mode": "later"}, "autoreset_mode: must be among"),
        ({"num_envs": 2, "threads": 0}, "threads: must be a whole number"),
        ({"num_envs": 2, "render_mode": "human"}, "render_mode: must be None or 'rgb_array' for a batch"),
        ({"num_envs": 65, "render_mode": "rgb_array"}, "num_envs: at most 64 drives are drawn"),
        ({"num_envs": 2, "max_episode_steps": 0}, "max_episode_steps: must be a whole number"),
        ({"num_envs": 2, "thread": 2}, "Did you mean 'threads'"),
    ],
)
def test_wrong_arguments_are_named(arguments, text):
    with pytest.raises((ValueError, TypeError), match=text):
        gymnasium.make_vec(ID, vectorization_mode="vector_entry_point", **arguments)
