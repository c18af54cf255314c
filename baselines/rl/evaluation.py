"""How good an agent is: on references and drives that training never meets, and on the laboratory's trajectory."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from baselines.evaluation.metrics import Measures, measure_recording
from baselines.rl.agents import Agent
from baselines.rl.curriculum import around, evaluation_reference
from baselines.rl.vec_env import FlexDriveVecEnv
from flexdrive_gym import Drive
from flexdrive_gym.references import handout_trajectory

Act = Callable[[npt.NDArray[np.float32]], npt.NDArray[np.float32]]

DRIVES = 128
SEED = 1_000_000
DURATION_S = 4.0
# a drive that ran away counts, but not for all others
LARGEST_MM = 100.0


class Evaluation:
    """Drives around one, and references, that are held out from training.

    Parameters
    ----------
    rig
        The drive.
    history, **task
        What the agents see.
    """

    def __init__(self, rig: Drive, history: int, **task: Any) -> None:
        around_it = around(rig)
        self._env = FlexDriveVecEnv(
            DRIVES,
            history=history,
            normalise=False,
            reference=evaluation_reference,
            duration=DURATION_S,
            **around_it,
            **task,
        )

    def __call__(self, act: Act) -> float:
        """Return the rms error over all drives and instants [mm]; the same policy always gets the same.

        Parameters
        ----------
        act
            From observations, shape (n, history * entries), to actions, shape (n, 1): an agent's ``act_many``.
        """
        env = self._env
        env.seed(SEED)
        seen, squares = env.reset(), []
        for _ in range(env.batch.task.horizon - 1):
            env.step_async(act(np.asarray(seen)))
            seen = env.step_wait()[0]
            error = np.clip(env.batch.fleet.state()["e"], -LARGEST_MM, LARGEST_MM)
            squares.append(np.mean(error**2))
        return float(np.sqrt(np.mean(squares)))


def on_the_handout(agent: Agent, rig: Drive) -> Measures:
    """Return the agent's measures on the handout's trajectory, on the rig at 1 kHz, as comparisons run it."""
    t = np.arange(round(DURATION_S * 1e3) + 1) * 1e-3
    run = rig.simulate_closed_loop(t, handout_trajectory(t), agent.controller(rig))
    return measure_recording(rig, run, limit=rig.voltage_limit)
