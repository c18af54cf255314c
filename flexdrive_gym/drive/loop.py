"""The compiled closed loop of a linear controller, batched over drives, gains and delays.

A loop over samples around :func:`~flexdrive_gym.drive.sample.advance` and :func:`~flexdrive_gym.drive.sample.measure`, as
in :mod:`~flexdrive_gym.drive.kernels`; it holds no equation of the drive. The controller is that of
:class:`~flexdrive_gym.drive.linear_controller.LinearController`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from flexdrive_gym.drive.compilation import inlined, kernel, pointer, shifted
from flexdrive_gym.drive.effects import N_PARAMETERS
from flexdrive_gym.drive.forces import limited
from flexdrive_gym.drive.piece import tabulate
from flexdrive_gym.drive.sample import MEMORY, WORK_SPACE, advance, clear, measure, power_up
from flexdrive_gym.drive.step import step
from flexdrive_gym.recording import FloatArray

# entries of the law before the matrices: command limit [V], friction level [V], velocity of full compensation [mm/s]
CONSTANTS = 3
_LIMIT, _FRICTION, _THRESHOLD = 0, 1, 2
INPUTS, OUTPUTS = 3, 2


class Law(NamedTuple):
    """A controller as the compiled loop reads it.

    Attributes
    ----------
    entries : ndarray
        Constants, A, B, C, D and L, row by row.
    states
        How many it has.
    every
        Samples of the rig per sample of the controller, over which its command is held.
    """

    entries: FloatArray
    states: int
    every: int


class Trials(NamedTuple):
    """What differs from the plain loop, per job.

    Attributes
    ----------
    gains : ndarray, shape (jobs,)
        Factor on the command between controller and drive: 1, or what a gain margin is tried with.
    late : ndarray of int, shape (jobs,)
        Whole samples by which the command is held back: 0, or what a delay margin is tried with.
    disturbance : ndarray, shape (n,)
        Added to the command behind the controller [V].
    """

    gains: FloatArray
    late: npt.NDArray[np.int64]
    disturbance: FloatArray


class Rigs(NamedTuple):
    """The drives of the jobs, and how they are sampled.

    Attributes
    ----------
    p : ndarray, shape (jobs, n_parameters)
    z : ndarray, shape (WORKSPACE,), or None
        Workspace where the drives have effects beyond the base.
    start : ndarray, shape (4,)
        x1, v1, x2, v2 [mm, mm/s].
    sample_time
        [s]
    substeps
        Of the integration per sample.
    """

    p: FloatArray
    z: FloatArray | None
    start: FloatArray
    sample_time: float
    substeps: int


@inlined
def _output(row: int, states: int, law: Any, x: Any, xr: float, r1: float, r2: float) -> float:
    """Return one output of the controller: row of C·x + D·(xr, x1, x2)."""
    c = CONSTANTS + states * (states + INPUTS) + row * states
    d = CONSTANTS + states * (states + INPUTS + OUTPUTS) + row * INPUTS
    total = law[d] * xr + law[d + 1] * r1 + law[d + 2] * r2
    for i in range(states):
        total += law[c + i] * x[i]
    return total


@inlined
def _update(states: int, law: Any, x: Any, xr: float, r1: float, r2: float, excess: float) -> None:
    """Advance the controller's state: A·x + B·(xr, x1, x2) + L·excess; ``x`` has room for the new state behind the old."""
    b = CONSTANTS + states * states
    windup = CONSTANTS + states * (states + INPUTS + OUTPUTS) + OUTPUTS * INPUTS
    for i in range(states):
        k = b + i * INPUTS
        total = law[k] * xr + law[k + 1] * r1 + law[k + 2] * r2 + law[windup + i] * excess
        row = CONSTANTS + i * states
        for j in range(states):
            total += law[row + j] * x[j]
        x[states + i] = total
    for i in range(states):
        x[i] = x[states + i]


def run_linear(xr: FloatArray, law: Law, trials: Trials, rigs: Rigs, *, true_states: bool) -> FloatArray:
    """Run one linear controller on many drives, from one start.

    Parameters
    ----------
    xr : ndarray, shape (n,)
        Reference as the controller sees it, shaped already [mm].
    law, trials, rigs
        The controller, what is tried with it, and the drives.
    true_states
        Whether the carts' true states are returned, or what the encoders report.

    Returns
    -------
    ndarray, shape (jobs, 5, n)
        x1, v1, x2, v2 (true), or x1, x2, v1, v2 (readings); then u as it reaches the drive [V].
    """
    out = np.empty((len(trials.gains), 5, len(xr)))
    work = Work(np.zeros(WORK_SPACE), np.zeros(2 * law.states + 1), np.zeros(int(trials.late.max(initial=0)) + 1))
    _run(xr, law, trials, rigs, work, true_states, out)
    return out


class Work(NamedTuple):
    """Memory of the step, of the controller's state, and of the commands that are held back."""

    memory: FloatArray
    state: FloatArray
    queue: FloatArray


@kernel
def _run(xr: Any, law: Law, trials: Trials, rigs: Rigs, work: Work, true_states: bool, out: Any) -> None:
    n, states, every, sample_time, substeps = xr.shape[0], law.states, law.every, rigs.sample_time, rigs.substeps
    m, w, c, x = pointer(work.memory), pointer(rigs.z), pointer(law.entries), pointer(work.state)
    fifo, parameters, disturbance, start = pointer(work.queue), pointer(rigs.p), trials.disturbance, rigs.start
    table = shifted(m, MEMORY)
    for j in range(trials.gains.shape[0]):
        q = shifted(parameters, j * N_PARAMETERS)
        tabulate(sample_time / substeps, table, q)
        x1, v1, x2, v2 = start[0], start[1], start[2], start[3]
        clear(v1, v2, m, w, q)
        r1, r2, s1, s2 = power_up(x1, v1, x2, v2, sample_time, m, w, q)
        gain, held = trials.gains[j], trials.late[j]
        for i in range(2 * states):
            x[i] = 0.0
        for i in range(held + 1):
            fifo[i] = 0.0
        allowed = 0.0
        for i in range(n):
            if i % every == 0:
                u = _output(0, states, c, x, xr[i], r1, r2)
                if c[_FRICTION] != 0.0:
                    ratio = _output(1, states, c, x, xr[i], r1, r2) / c[_THRESHOLD]
                    u += c[_FRICTION] * min(max(ratio, -1.0), 1.0)
                allowed = min(max(u, -c[_LIMIT]), c[_LIMIT])
                _update(states, c, x, xr[i], r1, r2, allowed - u)
            fifo[i % (held + 1)] = allowed
            command = limited(gain * fifo[(i + 1) % (held + 1)] + disturbance[i], q)
            if true_states:
                out[j, 0, i], out[j, 1, i], out[j, 2, i], out[j, 3, i] = x1, v1, x2, v2
            else:
                out[j, 0, i], out[j, 1, i], out[j, 2, i], out[j, 3, i] = r1, r2, s1, s2
            out[j, 4, i] = command
            if i + 1 < n:
                t = i * sample_time
                x1, v1, x2, v2 = advance(step, x1, v1, x2, v2, command, t, sample_time, substeps, table, m, w, q)
                r1, r2, s1, s2 = measure(x1, v1, x2, v2, t + sample_time, sample_time, m, w, q)
