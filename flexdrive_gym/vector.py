"""The batched environment: many drives, one compiled call a step, bit-equal to the single environment."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from flexdrive_gym.environment import action_space, announce_compilation, frame_of, observation_space
from flexdrive_gym.fleet import KEYS, Fleet, Outputs
from flexdrive_gym.recording import BoolArray, FloatArray
from flexdrive_gym.start import start_state
from flexdrive_gym.task import Task, check_arguments

if TYPE_CHECKING:
    from gymnasium.envs.registration import EnvSpec

    from flexdrive_gym.rendering import Renderer

Observations = npt.NDArray[np.float32]
Info = dict[str, Any]
OWN = ("num_envs", "autoreset_mode", "physical_info", "threads", "max_episode_steps", "render_mode")
MOST_DRAWN = 64
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
        Whether every step's ``info`` carries the physical units of all drives and the reward's terms, which takes time. Without
        it they are in the ``info`` of a reset and, with ``same_step``, in ``info["final_info"]`` where an episode ends; a
        step's ``info`` is empty otherwise.
    threads
        See :class:`~flexdrive_gym.fleet.Fleet`.
    max_episode_steps
        Time limit in control periods instead of ``duration``.
    render_mode
        ``rgb_array`` or ``None``; at most 64 drives are drawn.
    **arguments
        Of :class:`~flexdrive_gym.task.Task`.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012
        "render_modes": ["rgb_array"],
        "render_fps": 200,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }
    _spec: EnvSpec | None = None

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
        check_arguments(arguments, OWN)
        if not isinstance(num_envs, int | np.integer) or num_envs < 1:
            raise ValueError(f"num_envs: must be a whole number of at least 1; got {num_envs!r}.")
        if render_mode not in (None, "rgb_array"):
            raise ValueError(
                f"render_mode: must be None or 'rgb_array' for a batch; got {render_mode!r}. Use gymnasium.make for one drive."
            )
        if render_mode is not None and num_envs > MOST_DRAWN:
            raise ValueError(
                f"num_envs: at most {MOST_DRAWN} drives are drawn; got {num_envs}. Draw fewer, or leave render_mode out."
            )
        mode = autoreset_mode if isinstance(autoreset_mode, AutoresetMode) else _MODES.get(autoreset_mode)
        if mode is None:
            raise ValueError(f"autoreset_mode: must be among {', '.join(_MODES)}; got {autoreset_mode!r}.")
        announce_compilation()
        if max_episode_steps is not None:
            if not isinstance(max_episode_steps, int | np.integer) or max_episode_steps < 1:
                raise ValueError(f"max_episode_steps: must be a whole number of at least 1; got {max_episode_steps!r}.")
            arguments["duration"] = max_episode_steps * arguments.get("control_period", 5e-3)
        self.task = Task(**arguments)
        self.num_envs = int(num_envs)
        self.render_mode = render_mode
        fps = round(1.0 / self.task.control_period)
        self.metadata = {**type(self).metadata, "autoreset_mode": mode, "render_fps": fps}
        if not isinstance(threads, int) or threads < 1:
            raise ValueError(f"threads: must be a whole number of at least 1; got {threads!r}.")
        told = physical_info or mode is AutoresetMode.SAME_STEP or render_mode is not None
        self.fleet = Fleet(self.task, self.num_envs, threads, tells=told)
        self.physical_info = physical_info
        self._tells_all = physical_info or render_mode is not None
        self._tells_begin = render_mode is not None or bool(self.task.randomisation.names)
        self.single_action_space, self.single_observation_space = action_space(), observation_space(self.fleet)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self._mode = mode
        # numbers of the drives that must be reset before they step; with next_step their next step is that
        self._due: npt.NDArray[np.int64] | None = np.arange(self.num_envs)
        self._begun = False
        self._renderers: list[Renderer] = []
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
            any of ``x1``, ``x2`` [mm], ``v1``, ``v2`` [mm/s], the others being 0, or ``{"state": (x1, v1, x2, v2)}``, start
            those that are reset elsewhere than at rest at 0.

        Returns
        -------
        observations : ndarray, shape (num_envs, entries)
        info : dict
            Physical units of all drives, ndarray, shape (num_envs,) each, with ``_x1`` and so on to say which were reset; with
            ``randomise`` also ``parameters``, the drawn ones by name.

        Raises
        ------
        ValueError
            For an unknown option, or a start beyond a limit at which an episode ends.
        """
        start = start_state(self.task, options, ("reset_mask",))
        mask = self._mask((options or {}).get("reset_mask"))
        self._seed(seed, mask)
        self.fleet.renew()
        self.fleet.reset(np.flatnonzero(mask), start)
        if self._due is not None:
            left = self._due[~mask[self._due]]
            self._due = left if left.size else None
        self._begun = True
        if self.render_mode is not None:
            self._record(mask)
        return self.fleet.outputs.observation, self._info(mask) | self._drawn(mask)

    def step(self, actions: npt.NDArray[np.float32]) -> tuple[Observations, FloatArray, BoolArray, BoolArray, Info]:
        """Hold a command per drive for one control period; drives whose episode ended are reset as the mode says.

        Parameters
        ----------
        actions : ndarray, shape (num_envs, 1)
            Commands over the voltage limit; clipped to [-1, 1].

        Raises
        ------
        ValueError
            For an action that is no finite number, and a shape that does not fit; no drive has moved then.
        gymnasium.error.ResetNeeded
            Before the first reset, and with ``disabled`` where an episode has ended.
        """
        if getattr(actions, "shape", None) != self._shape:
            actions = np.reshape(actions, self._shape)
        self._actions[...] = actions
        fleet, due = self.fleet, self._due
        streams = None
        if due is not None:
            self._check_order(due)
            streams = fleet.seeds[due]
        out = fleet.step()
        if fleet.ended or streams is not None or self._tells_all:
            return self._after(out, due, streams)
        return out.observation, out.reward, out.terminated, out.truncated, {}

    def _after(
        self, out: Outputs, due: npt.NDArray[np.int64] | None, streams: Any
    ) -> tuple[Observations, FloatArray, BoolArray, BoolArray, Info]:
        """Do what a step needs that ends, resets or tells something."""
        fleet = self.fleet
        info: Info = {}
        reward, terminated, truncated = out.reward, out.terminated, out.truncated
        begun: npt.NDArray[np.int64] | None = None
        if self._mode is AutoresetMode.NEXT_STEP:
            if due is not None:
                # the step of a drive that is due only resets it: observation of the new episode, no reward, and a
                # random stream that knows nothing of the step just made
                fleet.seeds[due] = streams
                fleet.reset(due)
                begun = due
            ended = np.flatnonzero(terminated | truncated)
            self._due = ended if ended.size else None
        elif fleet.ended and self._mode is AutoresetMode.DISABLED:
            self._due = np.flatnonzero(terminated | truncated)
        elif fleet.ended and self._mode is AutoresetMode.SAME_STEP:
            reward, terminated, truncated = reward.copy(), terminated.copy(), truncated.copy()
            begun = np.flatnonzero(terminated | truncated)
            info = self._end_same_step()
        if self.physical_info:
            info |= self._info(None)
        if self._tells_begin:
            new = np.zeros(self.num_envs, dtype=np.bool_)
            new[begun if begun is not None else []] = True
            info |= self._drawn(new)
            if self.render_mode is not None:
                self._record(new)
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

    def _check_order(self, due: npt.NDArray[np.int64]) -> None:
        """Refuse a step that no reset allows."""
        if not self._begun:
            raise gymnasium.error.ResetNeeded(
                "step: the environment must be reset before the first step. Call reset() first."
            )
        if self._mode is not AutoresetMode.NEXT_STEP:
            raise gymnasium.error.ResetNeeded(
                f"step: drive {due[0]} must be reset after the end of its episode"
                + (f", and {due.size - 1} more" if due.size > 1 else "")
                + ". Call reset(options={'reset_mask': terminated | truncated}), or use another autoreset_mode."
            )

    def _drawn(self, mask: BoolArray) -> Info:
        """Return the drawn parameters of drives whose episode begins."""
        if not self.task.randomisation.names or not mask.any():
            return {}
        drawn: Info = dict(self.fleet.drawn())
        return {"parameters": drawn | {f"_{k}": mask.copy() for k in drawn}, "_parameters": mask.copy()}

    def restore(self, kept: dict[str, npt.NDArray[Any]]) -> None:
        """Go on where a batch of the same arguments was when its ``fleet.keep()`` was called, in the middle of episodes."""
        self.fleet.restore(kept)
        self._due, self._begun = None, True

    @property
    def spec(self) -> EnvSpec | None:
        """What Gymnasium made the batch from, with the time limit that it has."""
        return self._spec

    @spec.setter
    def spec(self, made: EnvSpec | None) -> None:
        self._spec = None if made is None else replace(made, max_episode_steps=self.task.horizon)

    def render(self) -> tuple[Any, ...] | None:
        """Return a picture of every drive, ndarray of uint8, shape (height, width, 3) each; ``None`` without a render mode."""
        if self.render_mode is None:
            return None
        if not self._renderers:
            raise gymnasium.error.ResetNeeded("render: there is nothing to show before the first reset. Call reset().")
        return tuple(renderer.render() for renderer in self._renderers)

    def _record(self, begun: BoolArray) -> None:
        """Add the present states to the pictures; those of episodes that just began start anew."""
        from flexdrive_gym.rendering import Renderer  # noqa: PLC0415

        if not self._renderers:
            self._renderers = [Renderer("rgb_array") for _ in range(self.num_envs)]
        now = self.fleet.state()
        for j, renderer in enumerate(self._renderers):
            if begun[j]:
                renderer.reset()
            title = f"{self.task.rig.name}, drive {j}"
            renderer.add(frame_of(self.task, int(self.fleet.clock[j]), {k: float(v[j]) for k, v in now.items()}, title))

    def close_extras(self, **_arguments: Any) -> None:
        """Forget the pictures."""
        for renderer in self._renderers:
            renderer.close()
        self._renderers = []

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
