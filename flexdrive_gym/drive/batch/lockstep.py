"""A batch of drives, for controllers that are asked from outside the compiled loop.

Whoever commands reads all encoders at once, decides for all, and lets every drive go on for a few samples: so a learnt policy
is evaluated once for a whole batch. The physics is the compiled step's; nothing is integrated here.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf

import numpy as np
import numpy.typing as npt

from flexdrive_gym.drive import kernels, parameters
from flexdrive_gym.drive.drive import Drive
from flexdrive_gym.drive.effects import WORKSPACE
from flexdrive_gym.drive.sample import WORK_SPACE
from flexdrive_gym.recording import FloatArray


class Lockstep:
    """A batch of drives that run in step.

    Parameters
    ----------
    drives
        One per row of every array here.
    sample_time
        Of the rigs [s].
    start : array_like, shape (4,)
        x1 [mm], v1 [mm/s], x2 [mm], v2 [mm/s] of all.
    physics_step
        Longest step of the integration [s].

    Attributes
    ----------
    readings : ndarray, shape (drives, 4)
        What the encoders report now: x1, x2 [mm], v1, v2 [mm/s].
    """

    def __init__(
        self,
        drives: Sequence[Drive],
        sample_time: float,
        start: npt.ArrayLike = (0.0, 0.0, 0.0, 0.0),
        physics_step: float = 1e-3,
    ) -> None:
        self.sample_time = sample_time
        self.readings = np.zeros((len(drives), 4))
        self._limits = np.array([[d.values.get("saturation.limit", inf)] for d in drives])
        self._samples = 0
        plans: dict[tuple[int, bool], list[int]] = {}
        for j, drive in enumerate(drives):
            parameters.check_delays(drive.values, sample_time)
            steps = parameters.substeps(drive.values, sample_time, physics_step)
            plans.setdefault((steps, parameters.workspace(drive.values) is None), []).append(j)
        self._parts = [
            _Part(rows, steps, base, np.array([drives[j].vector() for j in rows]))
            for (steps, base), rows in plans.items()
        ]
        begin = np.array(start, dtype=np.float64)
        for part in self._parts:
            part.begin(begin, sample_time)
            self.readings[part.rows] = part.readings

    def advance(self, u: FloatArray) -> FloatArray:
        """Let every drive go on under its commands; each is cut at the drive's own limit.

        Parameters
        ----------
        u : ndarray, shape (drives, n)
            Commands [V], one per sample.

        Returns
        -------
        ndarray, shape (drives, 5, n)
            True x1, v1, x2, v2 at the beginning of each sample, and the command as it was cut.
        """
        commands = np.clip(u, -self._limits, self._limits)
        out = np.empty((len(u), 5, u.shape[1]))
        out[:, 4] = commands
        for part in self._parts:
            out[part.rows, :4] = part.advance(commands[part.rows], self._samples, self.sample_time)
            self.readings[part.rows] = part.readings
        self._samples += u.shape[1]
        return out


class _Part:
    """Those drives that take the same number of steps and the same variant of the kernel."""

    def __init__(self, rows: list[int], steps: int, base: bool, p: FloatArray) -> None:
        n = len(rows)
        self.rows, self.steps, self.p = np.array(rows), steps, p
        self.memory = np.zeros((n, WORK_SPACE))
        self.z = None if base else np.zeros((n, WORKSPACE))
        self.states, self.readings = np.zeros((n, 4)), np.zeros((n, 4))

    def begin(self, start: FloatArray, sample_time: float) -> None:
        self.states[:] = start
        for j in range(len(self.rows)):
            z = None if self.z is None else self.z[j]
            kernels.begin(self.states[j], sample_time, self.steps, self.memory[j], z, self.p[j], self.readings[j])

    def advance(self, u: FloatArray, first: int, sample_time: float) -> FloatArray:
        out = np.empty((len(u), 4, u.shape[1]))
        kernels.run_lockstep(
            self.states, u, first, sample_time, self.steps, self.memory, self.z, self.p, self.readings, out
        )
        return out
