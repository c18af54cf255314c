"""The two ways between controllers and environments: a controller that acts in one, and a policy that runs on the rig.

The protocol of controllers speaks of positions and volts at control periods, an environment's policy of scaled observations and
actions. A linear controller runs at its own sample time, so its environment needs ``control_period=1e-3``.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from flexdrive_gym import Controller, Drive, Excitation, Observation, Recording
from flexdrive_gym.drive.controller import FAR, command_of
from flexdrive_gym.environment import FlexDriveEnv
from flexdrive_gym.recording import FloatArray
from flexdrive_gym.task import Task

Policy = Callable[[npt.NDArray[np.float32]], Any]


def observe(info: dict[str, Any], t: float) -> Observation:
    """Return what a controller knows at one instant from an environment's ``info``: the readings, not the true states."""
    return Observation(t, info["xr"], info["read_x1"], info["read_x2"], info["read_v1"], info["read_v2"])


def run_in_environment(env: FlexDriveEnv, controller: Controller, *, seed: int | None = None) -> Recording:
    """Run an episode with a controller instead of a policy.

    Parameters
    ----------
    env
        A flexible drive; its control period must be the controller's sample time where it has one.
    controller
        Anything with the protocol.
    seed
        Of the episode.

    Returns
    -------
    Recording
        Readings, command and reference at control periods, to the end of the episode.

    Raises
    ------
    ValueError
        If the periods differ.
    """
    base: Any = env.unwrapped
    period = base.task.control_period
    own = getattr(controller, "sample_time", period)
    if abs(own - period) > 1e-6 * period:
        raise ValueError(
            f"controller: made for {own:g} s; the environment acts every {period:g} s. Pass control_period={own:g}."
        )
    _seen, info = env.reset(seed=seed)
    reset = getattr(controller, "reset", None)  # a plain function has no past to forget
    if reset is not None:
        reset()
    rows, done, clock = [], False, 0
    while not done:
        observation = observe(info, clock * period)
        u = float(np.clip(command_of(controller, observation), -base.task.voltage, base.task.voltage))
        rows.append((observation.t, u, observation.x1, observation.x2, observation.v1, observation.v2, observation.xr))
        _seen, _reward, terminated, truncated, info = env.step(np.array([u / base.task.voltage], dtype=np.float32))
        done, clock = terminated or truncated, clock + 1
    t, u_all, x1, x2, v1, v2, xr = np.array(rows).T.copy()
    two = base.task.rig.carts == 2
    return Recording(
        name="environment", t=t, u=u_all, x1=x1, x2=x2 if two else None, v1=v1, v2=v2 if two else None, xr=xr,
        excitation=Excitation("closed_loop", amplitude=float(np.max(np.abs(xr - xr[0])))), source="simulated",
    )  # fmt: skip


@dataclass
class PolicyController:
    """A policy of the environment as a controller on the rig: a black box for comparisons and margins.

    Parameters
    ----------
    policy
        Observation of the environment to action, ndarray of shape (1,) or a number. It travels to other processes, so it must
        pickle where these are used. Where it has ``act_many``, many drives are run with it at once: the last ``history``
        observations of each (1 where it does not say), newest first, shape (n, history * entries), to actions, shape (n, 1).
    task
        The arguments of the environment for which the policy was made: sensing, scaling, preview, control period.
    sample_time
        How often the controller is called [s]; a whole fraction of the task's control period, over which the action is held.
    reference : ndarray, shape (n,), or None
        What the preview is read from, at the controller's instants [mm]; ``None``: the task's reference.

    Notes
    -----
    Comparisons and trials of margins tell it their reference by :meth:`following`. Velocities are made from positions by the
    task's own filter, as in the environment.
    """

    policy: Policy
    task: Task
    sample_time: float = 1e-3
    reference: FloatArray | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        ratio = self.task.control_period / self.sample_time
        if abs(ratio - round(ratio)) > 1e-6 or round(ratio) < 1:
            raise ValueError(
                f"sample_time: must divide the control period of {self.task.control_period:g} s; got {self.sample_time:g} s."
            )
        self.every = round(ratio)
        self.reset()

    def following(self, reference: npt.ArrayLike) -> PolicyController:
        """Return the controller for a run along another reference, which its preview is then read from."""
        # a policy that remembers must not share its past with runs side by side
        return replace(self, policy=copy(self.policy), reference=np.asarray(reference, dtype=np.float64))

    def reset(self) -> None:
        """Forget the past."""
        self._count, self._u = 0, 0.0
        self._alone = PolicyBatch(self, 1)

    def __call__(self, observation: Observation, /) -> float:
        """Return the command [V]; ask the policy once per control period."""
        if self._count % self.every == 0:
            o = observation
            self._u = float(self._alone(o.xr, np.array([[o.x1, o.x2, o.v1, o.v2]]))[0])
        self._count += 1
        return self._u


class PolicyBatch:
    """A policy that commands many rigs, asked once per control period for all of them.

    Parameters
    ----------
    controller
        Its policy, task and reference; its past is forgotten, and it must not act elsewhere meanwhile.
    rigs
        How many.
    """

    def __init__(self, controller: PolicyController, rigs: int) -> None:
        task = self._task = controller.task
        self._policy = controller.policy
        self._step = 1 if controller.reference is None else controller.every
        self._table: FloatArray = task.references[0] if controller.reference is None else controller.reference
        self._bounds = np.array([bound for _name, _unit, bound in task.names()])
        keys = [f"velocity_processing.encoder_{i}.cutoff" for i in (1, 2)]
        self._keep = np.array([_decay(task.rig, key, task.control_period) for key in keys])
        self._period = 0
        self._u = np.zeros(rigs)
        self._previous: FloatArray | None = None
        self._past: list[npt.NDArray[np.float32]] | None = None
        self._speed = np.zeros((rigs, 2))
        reset = getattr(self._policy, "reset", None)
        if reset is not None:
            reset()

    def __call__(self, xr: float, readings: FloatArray) -> FloatArray:
        """Return the commands for the next control period.

        Parameters
        ----------
        xr
            Reference now [mm].
        readings : ndarray, shape (rigs, 4)
            x1, x2 [mm], v1, v2 [mm/s] as the encoders report them; velocities count at the start only.

        Returns
        -------
        ndarray, shape (rigs,)
            [V]; 0 where a run left all bounds, so that the policy saw no numbers either.

        Raises
        ------
        ValueError
            If the policy answers finite readings with what is no finite number.
        """
        seen = self._entries(xr, readings)
        self._period += 1
        many = getattr(self._policy, "act_many", None)
        if many is None:
            actions = np.array([float(np.ravel(self._policy(row))[0]) for row in seen])
        else:
            # before the run everything was as it is now
            past = [seen] * getattr(self._policy, "history", 1) if self._past is None else [seen, *self._past[:-1]]
            self._past = past
            actions = np.asarray(many(np.hstack(past)), dtype=np.float64)[:, 0]
        fine = np.isfinite(actions)
        if not fine.all():
            odd = np.flatnonzero(~fine & (np.abs(readings).max(axis=1) < FAR))
            if odd.size:
                t = (self._period - 1) * self._task.control_period
                raise ValueError(
                    f"policy: must return a finite action; got {actions[odd[0]]} at t = {t:g} s from finite readings. Look for "
                    "the nan in its weights or in what it makes of the observation."
                )
            actions = np.where(fine, actions, 0.0)
        self._u = self._task.voltage * np.clip(actions, -1.0, 1.0)
        return self._u

    def _entries(self, xr: float, readings: FloatArray) -> npt.NDArray[np.float32]:
        """Return what the environment of the task would show, ndarray, shape (rigs, entries)."""
        now = readings[:, :2].copy()
        if self._previous is None:
            self._speed = readings[:, 2:].copy()
        else:
            raw = (now - self._previous) / self._task.control_period
            self._speed = self._keep * self._speed + (1.0 - self._keep) * raw
        self._previous = now
        carts = {"collocated": (0,), "non_collocated": (1,), "full_state": (0, 1)}[self._task.sensing]
        last = len(self._table) - 1
        preview = [
            float(self._table[min((self._period + int(a)) * self._step, last)]) for a in self._task.preview_periods
        ]
        columns = [c for i in carts for c in (now[:, i], self._speed[:, i])]
        columns += [xr - now[:, carts[-1]], np.full(len(now), xr), self._u]
        columns += [np.full(len(now), value) for value in preview]
        values = np.column_stack(columns)
        limited = np.clip(values, -self._bounds, self._bounds)
        return np.asarray(limited / self._bounds if self._task.normalise else limited, dtype=np.float32)


def _decay(rig: Drive, key: str, period: float) -> float:
    cutoff = rig[key]
    return float(np.exp(-2.0 * np.pi * cutoff * period)) if cutoff > 0.0 else 0.0
