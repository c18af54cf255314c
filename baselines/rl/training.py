"""One training from beginning to end: learn, evaluate, keep the best, write checkpoints, go on after an interruption.

Everything follows from the drive and the :class:`Plan`. On one machine the same plan gives the same agent bit by bit, whether
or not the training was interrupted: a checkpoint holds the drives and the random generators too.
"""

from __future__ import annotations

import importlib.util
import json
import platform
import subprocess
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger, TensorBoardOutputFormat

from baselines.evaluation.metrics import Measures
from baselines.loop_analysis.stability_limit import with_rig
from baselines.rl.agents import Agent, save_agent
from baselines.rl.cards import write_card
from baselines.rl.checkpoints import read_checkpoint, restore, snapshot, write_checkpoint
from baselines.rl.curriculum import around, training_reference
from baselines.rl.evaluation import Evaluation, on_the_handout
from baselines.rl.learner import ACTIVATION, REWARD, ROLLOUT, explore, layers, learner
from baselines.rl.vec_env import FlexDriveVecEnv
from flexdrive_gym import Drive
from flexdrive_gym.drive.default import HANDOUT_LIMIT_V
from flexdrive_gym.drive.toml import dumps, loads
from flexdrive_gym.files import write_atomically
from flexdrive_gym.task import DEFAULT_VELOCITY_CUTOFF_HZ, SENSINGS
from flexdrive_gym.units import Units, in_rig_units

Feedback = Literal["x1", "x2"]
SENSED = {"x1": "collocated", "x2": "non_collocated"}
CHECKPOINT, AGENT, CARD, CURVE, LOG = "checkpoint.pt", "agent.npz", "agent.toml", "curve.csv", "tensorboard"
CONTROL_PERIOD_S = 5e-3
PREVIEW_S = (0.02, 0.05, 0.1)
EVALUATIONS = 20
CHECKPOINT_EVERY = 100_000
# P-control from x2 is unstable beyond the critical gain; half of it is the handout's gain margin of 2
SHARE_OF_CRITICAL = 0.5

Tell = Callable[[int, float], None]


@dataclass(frozen=True)
class Plan:
    """What a training is asked for.

    Attributes
    ----------
    feedback
        Encoder that the agent reads.
    seed
        Of weights, exploration, drives and references.
    steps
        Control periods of all drives together; rounded up to whole rollouts.
    envs
        Drives in the batch.
    history
        Observations the agent looks at, the present one included.
    threads
        Of torch. Another number may round differently, and then gives another agent.
    """

    feedback: Feedback = "x2"
    seed: int = 0
    steps: int = 500_000
    envs: int = 64
    history: int = 4
    threads: int = 1

    def __post_init__(self) -> None:
        if self.feedback not in SENSED:
            raise ValueError(f"feedback: must be x1 or x2; got {self.feedback!r}.")
        for name, least in (("seed", 0), ("steps", 1), ("envs", 1), ("history", 1), ("threads", 1)):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or value < least:
                raise ValueError(f"{name}: must be a whole number of at least {least}; got {value!r}.")


@dataclass(frozen=True)
class Trained:
    """What a training found: the best agent, and (steps, seconds, rms error on references held out) along the way.

    Errors are in the rig's units, as scores are.
    """

    agent: Agent
    curve: tuple[tuple[int, float, float], ...]


@dataclass(frozen=True)
class UnderWay:
    """What an interrupted training was asked for: drive, plan, name of the agent, and steps between checkpoints."""

    drive: Drive
    plan: Plan
    name: str
    checkpoint_every: int


def task_arguments(rig: Drive, feedback: Feedback) -> dict[str, Any]:
    """Return what an agent sees and does, complete, so that it does not depend on the drive it later runs on."""
    key = f"velocity_processing.encoder_{SENSINGS[SENSED[feedback]]}.cutoff"
    return {
        "sensing": SENSED[feedback],
        "control_period": CONTROL_PERIOD_S,
        "preview": list(PREVIEW_S),
        "voltage_limit": min(rig.voltage_limit, HANDOUT_LIMIT_V) if rig.units.lab else rig.voltage_limit,
        "velocity_cutoff": rig.values.get(key, DEFAULT_VELOCITY_CUTOFF_HZ),
    }


def training_drives(rig: Drive, plan: Plan) -> FlexDriveVecEnv:
    """Return the drives that an agent learns on."""
    return FlexDriveVecEnv(
        plan.envs, history=plan.history, normalise=False, reference=training_reference, reward=REWARD,
        **around(rig), **task_arguments(rig, plan.feedback),
    )  # fmt: skip


def starting_gain(rig: Drive) -> float:
    """Return the gain of the P-control as which a policy begins [V/mm]."""
    return SHARE_OF_CRITICAL * rig.linear.routh_critical_gain("x2")


def train(
    drive: Drive,
    plan: Plan,
    folder: Path,
    *,
    name: str = "agent",
    checkpoint_every: int = CHECKPOINT_EVERY,
    resume: bool = False,
    tell: Tell = lambda _steps, _error: None,
) -> Trained:
    """Train an agent; ``folder`` then holds the policy file, its card and the learning curve.

    Parameters
    ----------
    drive
        Identified, with two carts; the handout's encoder counts and limit are added where it has none.
    plan
        What is asked for.
    folder
        For the results, and for the checkpoint while the training is under way.
    name
        Of the agent.
    checkpoint_every
        Steps between checkpoints.
    resume
        Go on from the folder's checkpoint. The plan may ask for more steps than it did; all else must be the same.
    tell
        Told the steps done and the last error on references held out, in the rig's units.

    Raises
    ------
    ValueError
        For a rigid drive, a folder with another training, or nothing to resume.
    KeyboardInterrupt
        On Ctrl-C, after a checkpoint was written.
    """
    if drive.carts == 1:
        raise ValueError(f"drive: needs two carts; got the rigid drive {drive.name!r}. Identify both carts.")
    rig = with_rig(drive)
    saved = _found(folder / CHECKPOINT, rig, plan, resume=resume)
    before = torch.get_num_threads()
    torch.set_num_threads(plan.threads)
    try:
        env = training_drives(rig, plan)
        env.seed(plan.seed)
        model = learner(env, plan.history, seed=plan.seed, gain=starting_gain(rig))
        model.set_logger(_logger(folder))
        course = _Course(rig, plan, folder, env, checkpoint_every, tell, name)
        if saved is not None:
            restore(model, env, saved)
            course.continue_from(saved)
        try:
            model.learn(plan.steps - model.num_timesteps, callback=course, reset_num_timesteps=False)
        except KeyboardInterrupt:
            course.write()
            raise
    finally:
        torch.set_num_threads(before)
    return course.finish()


class _Course(BaseCallback):
    """What happens between rollouts."""

    def __init__(
        self, rig: Drive, plan: Plan, folder: Path, env: FlexDriveVecEnv, every: int, tell: Tell, name: str
    ) -> None:
        super().__init__()
        self.model: PPO
        self.rig, self.plan, self.folder, self.env, self.every, self.tell, self.name = (
            rig, plan, folder, env, every, tell, name,
        )  # fmt: skip
        self.task = task_arguments(rig, plan.feedback)
        self.evaluate = Evaluation(rig, plan.history, **self.task)
        rollout = ROLLOUT * plan.envs
        # whole rollouts, so that a resumed training evaluates at the same steps
        self.pace = max(1, -(-plan.steps // rollout) // EVALUATIONS) * rollout
        self.curve: list[tuple[int, float, float]] = []
        self.best: list[torch.Tensor] = []
        self.seconds, self.began = 0.0, time.perf_counter()
        self.kept: dict[str, Any] = {}
        self.written = 0

    def continue_from(self, saved: Mapping[str, Any]) -> None:
        self.best, self.seconds, self.written = list(saved["best"]), saved["seconds"], saved["steps"]
        self.curve = [(int(a), float(b), float(c)) for a, b, c in saved["curve"]]

    def _on_rollout_start(self) -> None:
        steps = self.model.num_timesteps
        if steps % self.pace == 0 and (not self.curve or self.curve[-1][0] < steps):
            self._look(steps)
        explore(self.model, steps / self.plan.steps)
        self._keep()
        if steps - self.written >= self.every:
            self.write()
        self.tell(steps, in_rig_units(self.curve[-1][2], self.rig.units, "mm"))

    def _on_step(self) -> bool:
        return True

    def write(self) -> None:
        """Write the last snapshot."""
        if self.kept:
            write_checkpoint(self.kept, self.folder / CHECKPOINT)
            self.written = self.kept["steps"]

    def finish(self) -> Trained:
        """Look a last time, write what was found and drop the checkpoint."""
        self._look(self.model.num_timesteps)
        agent = self._agent()
        best = min(error for _steps, _seconds, error in self.curve)
        measures = on_the_handout(agent, self.rig)
        agent.card = _card(self.rig, self.plan, self.model.num_timesteps, self._elapsed()) | {
            "score": _score(best, measures, self.rig.units)
        }
        save_agent(agent, self.folder / AGENT)
        write_card(agent, self.folder / CARD)
        units = self.rig.units
        head = f"steps,seconds,{score_key(units, 'rms_mm_unseen_references')}"
        lines = [
            head,
            *(f"{a},{b:.2f},{_rounded(c, 'mm', units):{'.4f' if units.lab else ''}}" for a, b, c in self.curve),
        ]
        write_atomically(self.folder / CURVE, "\n".join(lines) + "\n")
        (self.folder / CHECKPOINT).unlink(missing_ok=True)
        self.logger.close()
        return Trained(agent, tuple((a, b, in_rig_units(c, units, "mm")) for a, b, c in self.curve))

    def _look(self, steps: int) -> None:
        candidate = layers(self.model)
        error = self.evaluate(Agent(self.name, candidate, ACTIVATION, self.task, self.plan.history).act_many)
        if not self.curve or error < min(found for _steps, _seconds, found in self.curve):
            self.best = [torch.as_tensor(array) for layer in candidate for array in layer]
        self.curve.append((steps, self._elapsed(), error))
        units = self.rig.units
        self.logger.record(f"evaluation/{score_key(units, 'rms_mm')}", in_rig_units(error, units, "mm"))

    def _keep(self) -> None:
        self.kept = snapshot(
            self.model,
            self.env,
            {
                "plan": json.dumps(asdict(self.plan)),
                "drive": dumps(self.rig),
                "name": self.name,
                "every": self.every,
                "best": self.best,
                "curve": self.curve,
                "seconds": self._elapsed(),
            },
        )

    def _elapsed(self) -> float:
        return self.seconds + time.perf_counter() - self.began

    def _agent(self) -> Agent:
        arrays = [tensor.numpy() for tensor in self.best]
        pairs = list(zip(arrays[::2], arrays[1::2], strict=True))
        return Agent(self.name, pairs, ACTIVATION, self.task, self.plan.history)


def _found(path: Path, rig: Drive, plan: Plan, *, resume: bool) -> dict[str, Any] | None:
    """Return the checkpoint to go on from, or ``None`` for a new training."""
    if not resume:
        if path.exists():
            raise ValueError(
                f"output: holds a training under way, {path}. Go on with --resume, or choose another folder."
            )
        return None
    if not path.exists():
        raise ValueError(f"resume: needs a checkpoint; got none at {path}. Train without --resume.")
    saved = read_checkpoint(path)
    then, now = json.loads(saved["plan"]), asdict(plan)
    changed = [k for k in now if then.get(k) != now[k] and k != "steps"]
    if changed:
        differing = ", ".join(f"{k} {then.get(k)}, now {now[k]}" for k in changed)
        raise ValueError(
            f"resume: goes on with the options of the checkpoint; it had {differing}. Leave them out, or train in another folder."
        )
    if plan.steps < saved["steps"]:
        raise ValueError(
            f"resume: steps must be at least those done, {saved['steps']}; got {plan.steps}. Ask for more."
        )
    if dict(loads(saved["drive"]).values) != dict(loads(dumps(rig)).values):
        raise ValueError(
            "resume: the drive is not the one of the checkpoint. Leave it out, or train in another folder."
        )
    return saved


def under_way(folder: Path) -> UnderWay:
    """Return what the training in a folder was asked for, from its checkpoint.

    Raises
    ------
    ValueError
        If there is no checkpoint.
    """
    path = folder / CHECKPOINT
    if not path.exists():
        raise ValueError(f"resume: needs a checkpoint; got none at {path}. Train without --resume.")
    saved = read_checkpoint(path)
    plan = Plan(**json.loads(saved["plan"]))
    return UnderWay(loads(saved["drive"]), plan, saved.get("name", "agent"), saved.get("every", CHECKPOINT_EVERY))


def _logger(folder: Path) -> Logger:
    if importlib.util.find_spec("tensorboard") is None:
        return Logger(str(folder), [])
    return Logger(str(folder), [TensorBoardOutputFormat(str(folder / LOG))])


def _card(rig: Drive, plan: Plan, steps: int, seconds: float) -> dict[str, Any]:
    return {
        "plan": asdict(plan),
        "commit": commit(),
        "drive": rig.name,
        "drive_parameters": {k: float(v) for k, v in rig.in_rig_units().values.items()},
        **({} if rig.units.lab else {"units": asdict(rig.units)}),
        "steps": steps,
        "seconds": round(seconds, 1),
        "versions": {
            "python": platform.python_version(),
            "numpy": np.__version__,
            "torch": torch.__version__,
            **{package: version(package) for package in ("stable_baselines3", "flexdrive")},
        },
    }


def score_key(units: Units, key: str) -> str:
    """Return a key of a card's score: the lab's units are part of its name, another rig's stand in the card."""
    return key if units.lab else key.replace("_V_mm", "").replace("_mm", "")


def _score(best: float, measures: Measures, units: Units) -> dict[str, Any]:
    """Return what a card tells of an agent, in the rig's units."""
    found = {
        "rms_mm_unseen_references": _rounded(best, "mm", units),
        "rms_mm_handout": _rounded(measures.rms, "mm", units),
        "peak_mm_handout": _rounded(measures.peak, "mm", units),
        "vibration_V_mm_handout": _rounded(measures.vibration, "V mm", units, 5),
    }
    return {score_key(units, key): value for key, value in found.items()} | {"settles_handout": measures.success}


def _rounded(value: float, unit: str, units: Units, digits: int = 4) -> float:
    """Return an error of the engine in the rig's units, rounded to so many decimals of the lab's."""
    return round(value, digits) if units.lab else float(f"{value / units.one(unit):.{digits + 1}g}")


def commit() -> str:
    """Return the commit of the code, with ``+`` where files differ from it; empty outside a repository."""
    here = Path(__file__).parent
    try:
        told = subprocess.run(
            ["git", "describe", "--always", "--abbrev=12", "--exclude=*", "--dirty=+"],  # noqa: S607
            cwd=here, capture_output=True, text=True, check=False,
        )  # fmt: skip
    except OSError:
        return ""
    return told.stdout.strip() if told.returncode == 0 else ""
