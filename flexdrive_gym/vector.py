"""The batched environment: many drives, one compiled call a step, bit-equal to the single environment."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from flexdrive_gym.environment import action_space, announce_compilation, observation_space
from flexdrive_gym.fleet import KEYS, Fleet, Outputs
from flexdrive_gym.recording import BoolArray, FloatArray
from flexdrive_gym.task import Task

Observations = npt.NDArray[np.float32]
Info = dict[str, Any]
_MODES = {
    "next_step": AutoresetMode.NEXT_STEP,
    "same_step": AutoresetMode.SAME_STEP,
    "disabled": AutoresetMode.DISABLED,
}


class FlexDriveVectorEnv(gymnasium.vector.VectorEnv[Observations, npt.NDArray[np.float32], Any]):
    """Many flexible drives at once.

    Parameters
    ----------
    num_envs
        How many.
    autoreset_mode
        ``next_step`` (Gymnasium's default), ``same_step`` (the last observation is in ``info["final_obs"]``) or
        ``disabled``; a member of :class:`gymnasium.vector.AutoresetMode` will do too.
    physical_info
        Whether every step's ``info`` carries the physical units of all drives; at the end of an episode
        ``info["final_info"]`` carries them in any case (``same_step``).
    threads
        See :class:`~flexdrive_gym.fleet.Fleet`.
    max_episode_steps
        Time limit in control periods instead of ``duration``.
    **arguments
        Of :class:`~flexdrive_gym.task.Task`.
    """

    metadata: dict[str, Any] = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012

    def __init__(
        self,
        num_envs: int = 1,
        *,
        autoreset_mode: str | AutoresetMode = "next_step",
        physical_info: bool = False,
        threads: int = 1,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
        **arguments: Any,
    ) -> None:
        if not isinstance(num_envs, int | np.integer) or num_envs < 1:
            raise ValueError(f"num_envs: must be a whole number of at least 1; got {num_envs!r}.")
        if render_mode is not None:
            raise ValueError(
                f"render_mode: the batched environment draws nothing; got {render_mode!r}. Use gymnasium.make."
            )
        mode = autoreset_mode if isinstance(autoreset_mode, AutoresetMode) else _MODES.get(autoreset_mode)
        if mode is None:
            raise ValueError(f"autoreset_mode: must be among {', '.join(_MODES)}; got {autoreset_mode!r}.")
        announce_compilation()
        if max_episode_steps is not None:
            arguments["duration"] = max_episode_steps * arguments.get("control_period", 5e-3)
        self.task = Task(**arguments)
        self.num_envs = int(num_envs)
        self.metadata = {**type(self).metadata, "autoreset_mode": mode}
        if not isinstance(threads, int) or threads < 1:
            raise ValueError(f"threads: must be a whole number of at least 1; got {threads!r}.")
        told = physical_info or mode is AutoresetMode.SAME_STEP
        self.fleet = Fleet(self.task, self.num_envs, threads, tells=told)
        self.physical_info = physical_info
        self.single_action_space, self.single_observation_space = action_space(), observation_space(self.fleet)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self._mode = mode
        # numbers of the drives whose next step is a reset
        self._due: npt.NDArray[np.int64] | None = None
        self._shape = (self.num_envs, 1)
        self._actions = self.fleet.actions.reshape(self._shape)
        self._seeded = False

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, Info]:
        """Start episodes.

        Parameters
        ----------
        seed
            One number s seeds drive j with s + j, as Gymnasium does; or one per drive.
        options
            ``{"reset_mask": ndarray of bool, shape (num_envs,)}`` resets only those drives;
            ``{"state": (x1, v1, x2, v2)}`` starts elsewhere than at rest.
        """
        options = options or {}
        mask = self._mask(options.get("reset_mask"))
        self._seed(seed, mask)
        self.fleet.renew()
        self.fleet.reset(np.flatnonzero(mask), options.get("state", (0.0, 0.0, 0.0, 0.0)))
        if self._due is not None:
            self._due = self._due[~mask[self._due]]
        return self.fleet.outputs.observation, self._info(mask)

    def step(self, actions: npt.NDArray[np.float32]) -> tuple[Observations, FloatArray, BoolArray, BoolArray, Info]:
        """Hold a command per drive for one control period; drives whose episode ended are reset as the mode says.

        Parameters
        ----------
        actions : ndarray, shape (num_envs, 1)
            Commands over the voltage limit; clipped to [-1, 1].
        """
        if getattr(actions, "shape", None) != self._shape:
            actions = np.reshape(actions, self._shape)
        self._actions[...] = actions
        fleet, due = self.fleet, self._due
        streams = None if due is None else fleet.seeds[due]
        out = fleet.step()
        if fleet.ended or streams is not None or self.physical_info:
            return self._after(out, due, streams)
        return out.observation, out.reward, out.terminated, out.truncated, {}

    def _after(
        self, out: Outputs, due: npt.NDArray[np.int64] | None, streams: Any
    ) -> tuple[Observations, FloatArray, BoolArray, BoolArray, Info]:
        """Do what a step needs that ends, resets or tells something."""
        fleet = self.fleet
        info: Info = {}
        reward, terminated, truncated = out.reward, out.terminated, out.truncated
        if self._mode is AutoresetMode.NEXT_STEP:
            if due is not None:
                # the step of a drive that is due only resets it: observation of the new episode, no reward, and a
                # random stream that knows nothing of the step just made
                fleet.seeds[due] = streams
                fleet.reset(due)
            ended = np.flatnonzero(terminated | truncated)
            self._due = ended if ended.size else None
        elif fleet.ended and self._mode is AutoresetMode.SAME_STEP:
            reward, terminated, truncated = reward.copy(), terminated.copy(), truncated.copy()
            info = self._end_same_step()
        if self.physical_info:
            info |= self._info(None)
        return out.observation, reward, terminated, truncated, info

    def _end_same_step(self) -> Info:
        fleet, out = self.fleet, self.fleet.outputs
        done = out.terminated | out.truncated
        final = np.empty(self.num_envs, dtype=object)
        for j in np.flatnonzero(done):
            final[j] = out.observation[j].copy()
        last: Info = dict(fleet.state())
        last |= {f"_{key}": done.copy() for key in KEYS}
        fleet.reset(np.flatnonzero(done))
        return {"final_obs": final, "_final_obs": done, "final_info": last, "_final_info": done.copy()}

    def _info(self, mask: BoolArray | None) -> Info:
        present = np.ones(self.num_envs, dtype=np.bool_) if mask is None else mask
        return self.fleet.state() | {f"_{key}": present.copy() for key in KEYS}

    def _mask(self, mask: Any) -> BoolArray:
        if mask is None:
            return np.ones(self.num_envs, dtype=np.bool_)
        if (
            not isinstance(mask, np.ndarray)
            or mask.shape != (self.num_envs,)
            or mask.dtype != np.bool_
            or not mask.any()
        ):
            raise ValueError(
                f"reset_mask: must be a boolean array of shape ({self.num_envs},) with at least one True; got {mask!r}."
            )
        return mask

    def _seed(self, seed: int | Sequence[int | None] | None, mask: BoolArray) -> None:
        if seed is None:
            if self._seeded:
                return
            fresh = np.random.default_rng().integers(2**62)
            self.fleet.seed(fresh + np.arange(self.num_envs), mask)
        elif isinstance(seed, int | np.integer):
            self._np_random, self._np_random_seed = gymnasium.utils.seeding.np_random(int(seed))
            self.fleet.seed(int(seed) + np.arange(self.num_envs), mask)
        else:
            given = np.array([s is not None for s in seed])
            if given.shape != (self.num_envs,):
                raise ValueError(f"seed: must be one number or {self.num_envs}; got {len(given)}.")
            self.fleet.seed([0 if s is None else s for s in seed], mask & given)
        self._seeded = True
