"""A policy of Stable-Baselines3 as a controller of the rig, for ``compare``, margins and simulations."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from baselines.evaluation.adapters import PolicyController
from baselines.rl.vec_env import FlexDriveVecEnv
from flexdrive_gym.task import Task


class Sb3Policy:
    """The deterministic actions of a trained model; it remembers nothing.

    Parameters
    ----------
    model
        Of Stable-Baselines3 (PPO, SAC, …), or its ``policy``.
    history
        Observations that the model was trained to see together, newest first.
    """

    def __init__(self, model: Any, history: int = 1) -> None:
        # without the environment, which neither copies nor travels
        self._policy = getattr(model, "policy", model)
        self.history = history
        self.reset()

    def reset(self) -> None:
        """Forget the past."""
        self._past: npt.NDArray[np.float32] | None = None

    def __call__(self, observation: npt.ArrayLike) -> npt.NDArray[np.float32]:
        """Return the action, shape (1,), to the present observation; earlier ones are remembered."""
        now = np.asarray(observation, dtype=np.float32)
        past = np.tile(now, self.history) if self._past is None else np.concatenate([now, self._past[: -len(now)]])
        self._past = past
        action: npt.NDArray[np.float32] = self.act_many(past[None, :])[0]
        return action

    def act_many(self, observations: npt.ArrayLike) -> npt.NDArray[np.float32]:
        """Return actions, shape (n, 1), to n rows of the last observations, newest first."""
        actions, _state = self._policy.predict(np.asarray(observations, dtype=np.float32), deterministic=True)
        return np.asarray(actions, dtype=np.float32).reshape(-1, 1)

    def __deepcopy__(self, memo: dict[int, Any]) -> Sb3Policy:
        # the weights are only read
        return Sb3Policy(self._policy, self.history)

    def __repr__(self) -> str:
        return f"Sb3Policy({type(self._policy).__name__}, history={self.history})"


def controller_of(model: Any, env: Any, *, sample_time: float = 1e-3) -> PolicyController:
    """Return a model of Stable-Baselines3 as a controller of the rig.

    Parameters
    ----------
    model
        Trained, or its ``policy``. A recurrent policy is not supported.
    env
        Where it was trained: a :class:`FlexDriveVecEnv`, or an environment made by ``gymnasium.make`` or ``make_vec``; it says
        what the policy sees and how often it acts. A :class:`~flexdrive_gym.task.Task` will do too.
    sample_time
        How often the controller will be called [s].

    Raises
    ------
    ValueError
        If the model's observations are not those of the environment.
    """
    history = 1
    if isinstance(env, FlexDriveVecEnv):
        task: Task = env.batch.task
        history = env.history
    else:
        task = env if isinstance(env, Task) else env.unwrapped.task
    policy = Sb3Policy(model, history)
    wanted, given = policy._policy.observation_space.shape, (history * len(task.names()),)  # noqa: SLF001
    if wanted != given:
        raise ValueError(
            f"env: must be the one of the training; the model sees observations of shape {wanted}, this one gives {given}."
        )
    return PolicyController(policy, task, sample_time)
