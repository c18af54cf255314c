"""The batched environment as a Stable-Baselines3 ``VecEnv``.

Stable-Baselines3 does not take Gymnasium's vector environments. This adapter hands it the batch itself: one compiled call a
step, no process or loop per environment. SB3 resets within the step and expects the last observation of an ended episode,
and whether it was cut by the time limit, in that environment's info; that is same-step autoreset.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvObs, VecEnvStepReturn

from flexdrive_gym.vector import FlexDriveVectorEnv


class FlexDriveVecEnv(VecEnv):
    """Many flexible drives for Stable-Baselines3.

    Parameters
    ----------
    num_envs
        How many.
    history
        Observations that are handed out together, newest first; at the beginning of an episode copies of its first. An encoder
        does not see the other cart, and the past tells of it.
    **arguments
        Of :class:`~flexdrive_gym.task.Task`, for example ``sensing="non_collocated"``; observations are normalised
        unless ``normalise=False`` is given.
    """

    def __init__(self, num_envs: int, *, history: int = 1, **arguments: Any) -> None:
        self.batch = FlexDriveVectorEnv(num_envs, autoreset_mode="same_step", **{"normalise": True, **arguments})
        self.history = history
        self._actions = np.zeros((num_envs, 1), dtype=np.float32)
        self._returns = np.zeros(num_envs)
        self._lengths = np.zeros(num_envs, dtype=np.int64)
        self._seed: int | None = None
        bound = self.batch.fleet.bound
        self._width = len(bound)
        self._seen = np.zeros((num_envs, history * self._width), dtype=np.float32)
        space = spaces.Box(-np.tile(bound, history), np.tile(bound, history), dtype=np.float32)
        super().__init__(num_envs, space, self.batch.single_action_space)

    def reset(self) -> VecEnvObs:
        """Start episodes; seeds given to :meth:`seed` are used once."""
        seed, self._seed = self._seed, None
        self._returns[:], self._lengths[:] = 0.0, 0
        self.reset_infos = [{} for _ in range(self.num_envs)]
        first = self.batch.reset(seed=seed)[0]
        self._seen = np.tile(first, self._seen.shape[1] // self._width)
        return self._seen

    def step_async(self, actions: np.ndarray) -> None:
        """Keep the actions for :meth:`step_wait`."""
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Advance all drives; ended ones begin anew."""
        observation, reward, terminated, truncated, info = self.batch.step(self._actions)
        done = terminated | truncated
        self._returns += reward
        self._lengths += 1
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        # a new array: whoever got the last one keeps it
        past = self._seen[:, : self._seen.shape[1] - self._width]
        self._seen = np.concatenate([observation, past], axis=1)
        for j in np.flatnonzero(done):
            last = np.concatenate([info["final_obs"][j], past[j]])
            self._seen[j] = np.tile(observation[j], len(last) // self._width)
            infos[j] = {
                "terminal_observation": last,
                "TimeLimit.truncated": bool(truncated[j]),
                "episode": {"r": float(self._returns[j]), "l": int(self._lengths[j])},
            }
        self._returns[done], self._lengths[done] = 0.0, 0
        return self._seen, reward.astype(np.float32), done, infos

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Seed drive j with seed + j at the next reset."""
        self._seed = seed
        return [None if seed is None else seed + j for j in range(self.num_envs)]

    def keep(self) -> dict[str, np.ndarray]:
        """Return copies of all that the future depends on, for :meth:`restore`."""
        own: dict[str, np.ndarray] = {"returns": self._returns, "lengths": self._lengths, "seen": self._seen}
        return self.batch.fleet.keep() | {name: array.copy() for name, array in own.items()}

    def restore(self, kept: dict[str, np.ndarray]) -> None:
        """Go on where drives of the same arguments were when :meth:`keep` was called."""
        self.batch.restore(kept)
        self._returns, self._lengths, self._seen = (kept[name].copy() for name in ("returns", "lengths", "seen"))

    def close(self) -> None:
        """Do nothing: there are no processes."""

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """Return an attribute of the batch, once per asked environment."""
        return [getattr(self.batch, attr_name, None)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:  # noqa: ARG002
        """Refuse: the drives of a batch share their task."""
        raise AttributeError(f"{attr_name}: the drives of a batch share their task; make another batch instead.")

    def env_method(self, method_name: str, *args: Any, indices: VecEnvIndices = None, **kwargs: Any) -> list[Any]:
        """Call a method of the batch and return its result, once per asked environment."""
        result = getattr(self.batch, method_name)(*args, **kwargs)
        return [result] * len(list(self._get_indices(indices)))

    def env_is_wrapped(self, wrapper_class: type[Any], indices: VecEnvIndices = None) -> list[bool]:  # noqa: ARG002
        """Return ``False`` for each: a batch is not wrapped one by one."""
        return [False] * len(list(self._get_indices(indices)))
