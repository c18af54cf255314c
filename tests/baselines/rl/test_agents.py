"""Policy files are numbers and text; an agent acts on the rig as in its environment."""

import io
import json
import pickle
import re
from copy import copy
from itertools import pairwise

import numpy as np
import pytest

from baselines.rl.agents import Agent, agent_names, find_agent, load_agent, save_agent
from flexdrive_gym import DEFAULT_DRIVE, Drive
from flexdrive_gym.environment import FlexDriveEnv
from flexdrive_gym.references import handout_trajectory
from tests.each import each

TASK = {"sensing": "non_collocated", "control_period": 5e-3, "voltage_limit": 8.0, "preview": [0.02, 0.05, 0.1]}


def some_agent(history=1, seed=0):
    rng = np.random.default_rng(seed)
    sizes = (8 * history, 16, 1)
    layers = [(rng.normal(size=(n, m)) / m**0.5 * 0.02, rng.normal(size=n) * 0.1) for m, n in pairwise(sizes)]
    return Agent("mine", layers, "tanh", TASK, history, {"seed": 3})


def p_control(gain):
    """An agent that is P-control from x2: u/8 = gain/8 (xr - x2)."""
    weights = np.zeros((1, 8))
    weights[0, 2] = gain / 8.0
    return Agent("p", [(weights, [0.0])], "tanh", TASK)


def test_a_file_gives_back_the_agent(tmp_path):
    agent = some_agent(history=2)
    back = load_agent(save_agent(agent, tmp_path / "a.npz"))
    assert (back.name, back.task, back.card, back.history) == (agent.name, agent.task, agent.card, agent.history)
    seen = np.random.default_rng(1).normal(size=(5, 16)) * 50.0
    assert np.array_equal(back.act_many(seen), agent.act_many(seen))
    assert back.act_many(seen).shape == (5, 1)
    assert list(tmp_path.iterdir()) == [tmp_path / "a.npz"]


def test_a_network_without_hidden_layers_is_p_control_held_for_its_period():
    agent = p_control(0.1)
    t = np.arange(2000) * 1e-3
    run = DEFAULT_DRIVE.simulate_closed_loop(t, handout_trajectory(t), agent.controller())
    held = run.u[::5]
    assert np.array_equal(run.u, np.repeat(held, 5))
    assert np.max(np.abs(held - 0.1 * (run.xr - run.x2)[::5])) < 1e-5


def test_on_the_rig_an_agent_does_what_it_does_in_its_environment():
    agent = some_agent(history=3)
    env = FlexDriveEnv(duration=2.0, **TASK)
    observation, info = env.reset(seed=0)
    inside = []
    for _ in range(400):
        inside.append(info["read_x2"])
        observation, _reward, _over, _end, info = env.step(agent(observation))
    t = np.arange(2000) * 1e-3
    run = DEFAULT_DRIVE.simulate_closed_loop(t, handout_trajectory(t), agent.controller())
    assert np.max(np.abs(np.array(inside) - run.x2[::5])) < 0.02


def test_history_is_newest_first_and_forgotten():
    agent = some_agent(history=3)
    rows = np.random.default_rng(2).normal(size=(3, 8)) * 50.0
    said = [agent(row) for row in rows]
    assert np.array_equal(said[0], agent.act_many(np.tile(rows[0], 3)[None])[0])
    assert np.array_equal(said[2], agent.act_many(rows[::-1].reshape(1, -1))[0])
    agent.reset()
    assert np.array_equal(agent(rows[0]), said[0])


def test_runs_side_by_side_do_not_share_a_past():
    agent = some_agent(history=2)
    rows = np.random.default_rng(2).normal(size=(2, 8)) * 50.0
    agent(rows[0])
    other = copy(agent)
    other(rows[1])
    assert np.array_equal(agent(rows[1]), copy(some_agent(history=2)).act_many(rows[::-1].reshape(1, -1))[0])
    controller = agent.controller()
    assert controller.following([0.0]).policy is not controller.policy


def test_an_agent_travels_to_other_processes():
    agent = some_agent(history=2)
    agent.reset()
    seen = np.full((1, 16), 3.0)
    assert np.array_equal(pickle.loads(pickle.dumps(agent)).act_many(seen), agent.act_many(seen))
    pickle.loads(pickle.dumps(agent.controller()))


def test_a_rigid_drive_has_no_second_encoder():
    with pytest.raises(ValueError, match="needs two carts"):
        some_agent().controller(Drive({"m1": 1e-3}))


def rewritten(path, about=None, drop=(), **arrays):
    """Write an agent's file with changes."""
    with np.load(save_agent(some_agent(), path)) as archive:
        parts = {k: archive[k] for k in archive.files if k not in drop}
    if about is not None:
        parts["about"] = np.array(json.dumps(json.loads(str(parts["about"])) | about))
    np.savez(path, **(parts | arrays))
    return path


@each(
    ("changes", "text"),
    [
        ({"drop": ("b1",)}, "b1: must be an array of real numbers; got nothing"),
        ({"drop": ("W0",)}, "W0, b0, … without gaps"),
        ({"drop": ("about",)}, "about: a policy file must hold one text"),
        ({"W0": np.zeros((16, 9))}, "W0: must have shape (n, 8)"),
        ({"W1": np.full((1, 16), np.nan)}, "W1: weights must be finite"),
        ({"W1": np.array([["a"]])}, "W1: must be an array of real numbers"),
        ({"W0": np.array([object()], dtype=object)}, "must hold plain arrays"),
        ({"about": {"schema": 2}}, "schema: must be 1 … 1; got 2"),
        ({"about": {"activation": "exec"}}, "activation: must be among tanh, relu; got 'exec'"),
        ({"about": {"history": 0}}, "history: must be a whole number from 1"),
        ({"about": {"task": {"sensing": "nothing"}}}, "sensing: must be among"),
        ({"about": {"task": {"sensing": "collocated", "no": 1}}}, "task: must be arguments of Task"),
        ({"about": {"task": {"sensing": "collocated", "drive": "/etc/passwd"}}}, "must not hold drive"),
        ({"about": {"card": 3}}, "card: must be dict"),
    ],
)
def test_odd_files_are_refused(tmp_path, changes, text):
    with pytest.raises(ValueError, match=re.escape(text)):
        load_agent(rewritten(tmp_path / "odd.npz", **changes))


@each("content", [b"", b"PK\x03\x04 no archive", b"\x80\x04N.", None])
def test_what_is_no_archive_is_refused_and_no_pickle_is_run(tmp_path, content):
    path = tmp_path / "odd.npz"
    whole = save_agent(some_agent(), path).read_bytes()
    path.write_bytes(whole[:-40] if content is None else content)
    with pytest.raises(ValueError, match="path: "):
        load_agent(path)


def test_a_file_that_unpacks_to_a_flood_is_refused(tmp_path):
    stream = io.BytesIO()
    np.savez_compressed(stream, W0=np.zeros(5_000_000))
    (tmp_path / "flood.npz").write_bytes(stream.getvalue())
    with pytest.raises(ValueError, match="it would take 40 MB"):
        load_agent(tmp_path / "flood.npz")


def test_an_agent_is_printed_in_a_line():
    agent = find_agent("x2-0")
    assert len(repr(agent)) < 200
    assert "x2-0" in repr(agent)
    assert len(repr(agent.controller())) < 1500


def test_unknown_names_get_a_hint():
    with pytest.raises(ValueError, match="name: must be among"):
        find_agent("x2_0")


@each("name", agent_names())
def test_ready_trained_agents_load(name):
    agent = find_agent(name)
    assert agent.name == name
    assert agent.controller().task.sensing == {"x1": "collocated", "x2": "non_collocated"}[name[:2]]
