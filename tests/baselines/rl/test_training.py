"""A training is the same every time, interrupted or not; what it writes is whole and safe to read."""

import json
import re
import subprocess
import sys
import time
from signal import SIGINT, SIGKILL, default_int_handler, signal

import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="needs the extra rl")

import torch
from typer.testing import CliRunner

from baselines.cli import app
from baselines.cli.train import compared, sentence
from baselines.rl.agents import Agent, load_agent
from baselines.rl.checkpoints import read_checkpoint
from baselines.rl.curriculum import around, evaluation_reference, training_reference
from baselines.rl.features import features
from baselines.rl.learner import layers, learner
from baselines.rl.training import Plan, task_arguments, train, training_drives
from baselines.rl.vec_env import FlexDriveVecEnv
from flexdrive_gym import DEFAULT_DRIVE, Covariance, Drive
from flexdrive_gym.task import Task
from tests.each import each

# five rollouts of eight drives
SMALL = Plan(steps=5 * 32 * 8, envs=8, history=2)


def weights(agent):
    return [array for layer in agent.layers for array in layer]


def same(one, two):
    return all(np.array_equal(a, b) for a, b in zip(weights(one), weights(two), strict=True))


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A training that nobody interrupted."""
    folder = tmp_path_factory.mktemp("whole")
    return folder, train(DEFAULT_DRIVE, SMALL, folder)


def test_the_folder_holds_agent_card_and_curve(whole):
    folder, trained = whole
    assert {p.name for p in folder.iterdir()} - {"tensorboard"} == {"agent.npz", "agent.toml", "curve.csv"}
    agent = load_agent(folder / "agent.npz")
    assert same(agent, trained.agent)
    assert agent.card["steps"] == SMALL.steps
    text = (folder / "agent.toml").read_text(encoding="utf-8")
    assert "flexdrive train --feedback x2 --seed 0 --steps 1280 --envs 8 --history 2 --threads 1" in text
    best = min(error for _steps, _seconds, error in trained.curve)
    assert agent.card["score"]["rms_mm_unseen_references"] == pytest.approx(best, abs=1e-4)


def test_the_same_plan_gives_the_same_agent_and_another_seed_another(whole, tmp_path):
    again = train(DEFAULT_DRIVE, SMALL, tmp_path / "again")
    assert same(again.agent, whole[1].agent)
    other = train(DEFAULT_DRIVE, Plan(steps=SMALL.steps, envs=8, history=2, seed=1), tmp_path / "other")
    assert not same(other.agent, whole[1].agent)


def test_an_interrupted_training_goes_on_as_if_nothing_had_happened(whole, tmp_path):
    calls, after = [], 3

    def interrupt(steps, _error):
        calls.append(steps)
        if len(calls) > after:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(DEFAULT_DRIVE, SMALL, tmp_path, tell=interrupt)
    assert {p.name for p in tmp_path.iterdir()} - {"tensorboard"} == {"checkpoint.pt"}
    assert read_checkpoint(tmp_path / "checkpoint.pt")["steps"] == after * 32 * 8
    resumed = train(DEFAULT_DRIVE, SMALL, tmp_path, resume=True)
    assert same(resumed.agent, whole[1].agent)
    assert [(s, e) for s, _t, e in resumed.curve] == [(s, e) for s, _t, e in whole[1].curve]


@pytest.mark.slow
def test_a_kill_loses_no_more_than_what_came_after_the_last_checkpoint(tmp_path):
    arguments = ["--envs", "8", "--steps", "2000000", "--checkpoint-every", "2000"]
    command = [sys.executable, "-m", "baselines.cli", "train", "-o", "out", *arguments]
    checkpoint = tmp_path / "out" / "checkpoint.pt"
    run = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE)
    deadline = time.monotonic() + 120.0
    while not checkpoint.exists() and run.poll() is None and time.monotonic() < deadline:
        time.sleep(0.1)
    run.send_signal(SIGKILL)
    run.communicate()
    assert read_checkpoint(checkpoint)["steps"] >= 2000
    # and Ctrl-C leaves a later one
    # what runs in the background of a shell ignores Ctrl-C, and so would its children
    handler = signal(SIGINT, default_int_handler)
    run = subprocess.Popen([*command[:6], "--resume"], cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    signal(SIGINT, handler)
    before, deadline = checkpoint.stat().st_mtime_ns, time.monotonic() + 120.0
    while checkpoint.stat().st_mtime_ns == before and run.poll() is None and time.monotonic() < deadline:
        time.sleep(0.1)
    run.send_signal(SIGINT)
    said = run.communicate()[1]
    assert run.returncode == 1, said
    assert "go on with --resume" in said
    assert read_checkpoint(checkpoint)["steps"] > 2000
    assert {p.name for p in (tmp_path / "out").iterdir()} - {"tensorboard"} == {"checkpoint.pt"}


def test_only_its_own_training_is_resumed(tmp_path):
    with pytest.raises(ValueError, match=r"resume: needs a checkpoint; got none"):
        train(DEFAULT_DRIVE, SMALL, tmp_path, resume=True)

    def interrupt(steps, _error):
        if steps:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(DEFAULT_DRIVE, SMALL, tmp_path, tell=interrupt)
    with pytest.raises(ValueError, match="holds a training under way"):
        train(DEFAULT_DRIVE, SMALL, tmp_path)
    with pytest.raises(ValueError, match="it had seed 0, now 4"):
        train(DEFAULT_DRIVE, Plan(steps=SMALL.steps, envs=8, history=2, seed=4), tmp_path, resume=True)
    with pytest.raises(ValueError, match="steps must be at least those done, 256; got 128"):
        train(DEFAULT_DRIVE, Plan(steps=128, envs=8, history=2), tmp_path, resume=True)
    with pytest.raises(ValueError, match="not the one of the checkpoint"):
        train(DEFAULT_DRIVE.replace(k=0.09), SMALL, tmp_path, resume=True)


def flexdrive(*arguments, cwd):
    command = [sys.executable, "-m", "baselines.cli", "train", *map(str, arguments)]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_the_command_takes_its_options_from_the_checkpoint(tmp_path):
    drive = DEFAULT_DRIVE.replace(k=0.09)
    small = Plan(feedback="x1", steps=3 * 32 * 8, envs=8, history=2, seed=5)

    def interrupt(steps, _error):
        if steps:
            raise KeyboardInterrupt

    whole = train(drive, small, tmp_path / "whole")
    with pytest.raises(KeyboardInterrupt):
        train(drive, small, tmp_path / "out", tell=interrupt)
    refused = flexdrive("--resume", "-o", "out", "--seed", 4, cwd=tmp_path)
    assert refused.returncode == 1
    assert "it had --seed 5, and got --seed 4" in refused.stderr
    resumed = flexdrive("--resume", "-o", "out", cwd=tmp_path)
    assert resumed.returncode == 0, resumed.stderr
    assert same(load_agent(tmp_path / "out" / "agent.npz"), whole.agent)
    # a finished agent is not overwritten without asking
    again = flexdrive("-o", "out", "--steps", 256, "--envs", 8, cwd=tmp_path)
    assert again.returncode == 1
    assert "holds a finished result, agent.npz" in again.stderr
    assert same(load_agent(tmp_path / "out" / "agent.npz"), whole.agent)


def test_a_resumed_training_may_take_more_steps(tmp_path):
    def interrupt(steps, _error):
        if steps:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(DEFAULT_DRIVE, Plan(steps=512, envs=8, history=2), tmp_path, tell=interrupt)
    more = Plan(steps=1024, envs=8, history=2)
    assert train(DEFAULT_DRIVE, more, tmp_path, resume=True).agent.card["steps"] == 1024


class Trap:
    """Pickles to a call."""

    def __reduce__(self):
        return print, ("run",)


@pytest.mark.parametrize("content", [{"schema": 1, "plan": Trap()}, {"schema": 2}, None])
def test_odd_checkpoints_are_refused_and_nothing_is_run(tmp_path, capsys, content):
    path = tmp_path / "checkpoint.pt"
    if content is None:
        path.write_bytes(b"no checkpoint")
    else:
        torch.save(content, path)
    with pytest.raises(ValueError, match="checkpoint: "):
        read_checkpoint(path)
    assert capsys.readouterr().out == ""


@each(
    ("changes", "text"),
    [({"feedback": "x3"}, "feedback: must be x1 or x2"), ({"steps": 0}, "steps: must be a whole number of at least 1")],
)
def test_plans_are_checked(changes, text):
    with pytest.raises(ValueError, match=re.escape(text)):
        Plan(**changes)


def test_a_rigid_drive_cannot_be_trained_on(tmp_path):
    with pytest.raises(ValueError, match="needs two carts"):
        train(Drive({"m1": 1e-3}), SMALL, tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_the_exported_agent_is_the_network_that_was_trained():
    env = training_drives(DEFAULT_DRIVE, SMALL)
    env.seed(0)
    model = learner(env, 2, seed=0, gain=0.1)
    agent = Agent("a", layers(model), "tanh", task_arguments(DEFAULT_DRIVE, "x2"), 2)
    seen = env.reset()
    for _ in range(50):
        env.step_async(agent.act_many(seen))
        seen = env.step_wait()[0]
    assert np.max(np.abs(seen[:, 2])) > 1.0
    assert agent.act_many(seen) == pytest.approx(model.predict(seen, deterministic=True)[0], abs=1e-5)


@pytest.mark.slow
def test_a_policy_begins_as_p_control():
    env = training_drives(DEFAULT_DRIVE, SMALL)
    model = learner(env, 2, seed=0, gain=0.1)
    seen = np.zeros((1, 16), np.float32)
    for error in (-10.0, 0.0, 10.0):
        seen[:, [2, 10]] = error
        action = model.predict(seen, deterministic=True)[0]
        assert 8.0 * action[0, 0] == pytest.approx(0.1 * error, abs=0.15)


def test_features_do_not_know_the_place_on_the_rail():
    for sensing in ("collocated", "non_collocated", "full_state"):
        task = Task(sensing)
        place = [i for i, (_n, unit, _b) in enumerate(task.names()) if unit == "mm"]
        shift = np.zeros(len(task.names()))
        shift[place] = 100.0
        shift[[i for i, (n, _u, _b) in enumerate(task.names()) if n.startswith("xr - ")]] = 0.0
        assert features(task, 3) @ np.tile(shift, 3) == pytest.approx(0.0, abs=1e-9)


def test_history_is_stacked_newest_first_and_begins_anew_with_an_episode():
    plain = FlexDriveVecEnv(2, sensing="non_collocated", duration=0.05)
    stacked = FlexDriveVecEnv(2, sensing="non_collocated", duration=0.05, history=3)
    plain.seed(3)
    stacked.seed(3)
    seen = [plain.reset()]
    assert np.array_equal(stacked.reset(), np.tile(seen[0], 3))
    actions = np.full((2, 1), 0.3, np.float32)
    for i in range(1, 11):
        out, more = plain.step_async(actions) or plain.step_wait(), stacked.step_async(actions) or stacked.step_wait()
        seen.append(out[0])
        if i < 10:
            assert np.array_equal(more[0][:, :8], seen[i])
            assert np.array_equal(more[0][:, 8:16], seen[i - 1])
    assert more[2].all()
    assert np.array_equal(more[0], np.tile(seen[10], 3))
    last = more[3][0]["terminal_observation"]
    assert np.array_equal(last[:8], out[3][0]["terminal_observation"])
    assert np.array_equal(last[8:16], seen[9][0])


def test_references_of_training_are_feasible_and_differ_from_those_of_evaluation():
    t = np.arange(800) * 5e-3
    learnt = [training_reference(t, np.random.default_rng(i)) for i in range(40)]
    kept = [evaluation_reference(t, np.random.default_rng(i)) for i in range(40)]
    assert max(np.max(np.abs(r)) for r in learnt) < 100.0
    assert all(np.isfinite(r).all() for r in learnt)
    assert not any(np.array_equal(a, b) for a in learnt for b in kept)
    assert np.array_equal(learnt[3], training_reference(t, np.random.default_rng(3)))


def test_drives_around_an_identified_one_are_three_times_as_wide_as_its_covariance():
    covariance = Covariance(("m1", "d1"), np.diag([1e-5, 0.01]) ** 2)
    drive = DEFAULT_DRIVE.replace({}, covariance=covariance)
    task = Task("non_collocated", **around(drive))
    assert np.diag(task.randomisation.factor) == pytest.approx([3e-5, 0.03])


def test_a_retrained_agent_is_compared(whole):
    agent = whole[1].agent
    equal = compared(agent, agent)
    assert equal["equal"]
    assert sentence(equal) == "agent is reproduced bit by bit."
    (W, b), *more = agent.layers
    other = Agent(agent.name, [(W, b + 0.25), *more], agent.activation, agent.task, agent.history, agent.card)
    assert compared(agent, other)["largest_weight_difference"] == pytest.approx(0.25)
    assert "weights differ by up to 0.25" in sentence(compared(agent, other))


def test_the_command_refuses_what_it_cannot_do(tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "baselines.cli", "train", "--reproduce", "x9-9", "-o", "out"],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 1
    assert "name: must be among" in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_the_command_prints_what_it_found(tmp_path):
    arguments = ["train", "-o", str(tmp_path / "out"), "--steps", "256", "--envs", "8", "--json"]
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 0, done.output
    found = json.loads(done.stdout)
    assert found["card"]["plan"]["envs"] == 8
    assert found["card"]["score"]["rms_mm_handout"] > 1.0
    assert {p.name for p in tmp_path.iterdir()} == {"out"}
