"""The compiled closed loop of a linear controller, batched over drives, gains and delays.

A loop over samples around :func:`~flexdrive_gym.drive.sample.advance` and :func:`~flexdrive_gym.drive.sample.measure`, as
in :mod:`~flexdrive_gym.drive.kernels`; it holds no equation of the drive. The controller is that of
:class:`~flexdrive_gym.drive.linear_controller.LinearController`.
"""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.compilation import inlined, kernel, pointer, shifted
from flexdrive_gym.drive.effects import N_PARAMETERS
from flexdrive_gym.drive.forces import limited
from flexdrive_gym.drive.piece import tabulate
from flexdrive_gym.drive.sample import MEMORY, advance, clear, measure, power_up
from flexdrive_gym.drive.step import step

# entries of the law before the matrices: command limit [V], friction level [V], velocity of full compensation [mm/s]
CONSTANTS = 3
_LIMIT, _FRICTION, _THRESHOLD = 0, 1, 2
INPUTS, OUTPUTS = 3, 2


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


@kernel
def run_linear(
    xr: Any,
    law: Any,
    states: int,
    every: int,
    gains: Any,
    late: Any,
    disturbance: Any,
    true_states: int,
    sample_time: float,
    substeps: int,
    start: Any,
    memory: Any,
    scratch: Any,
    queue: Any,
    z: Any,
    p: Any,
    out: Any,
) -> None:
    """Run one linear controller on many drives, from one start.

    Parameters
    ----------
    xr : ndarray, shape (n,)
        Reference as the controller sees it, shaped already [mm].
    law : ndarray, shape (LAW,)
        Constants, A, B, C, D and L of the controller, row by row.
    states
        Of the controller.
    every
        Samples of the rig per sample of the controller, over which its command is held.
    gains : ndarray, shape (jobs,)
        Factor on the command between controller and drive: 1, or what a gain margin is tried with.
    late : ndarray of int, shape (jobs,)
        Whole samples by which the command is held back: 0, or what a delay margin is tried with.
    disturbance : ndarray, shape (n,)
        Added to the command behind the controller [V].
    true_states
        1 to write the carts' true states, 0 to write what the encoders report.
    scratch : ndarray, shape (2·states + 1,)
    queue : ndarray, shape (largest late + 1,)
    p : ndarray, shape (jobs, n_parameters)
    out : ndarray, shape (jobs, 5, n)
        Written: x1, v1, x2, v2 (true), or x1, x2, v1, v2 (readings); then u as it reaches the drive [V].
    """
    n = xr.shape[0]
    m, w, c, x, fifo, parameters = (
        pointer(memory),
        pointer(z),
        pointer(law),
        pointer(scratch),
        pointer(queue),
        pointer(p),
    )
    table = shifted(m, MEMORY)
    for j in range(gains.shape[0]):
        q = shifted(parameters, j * N_PARAMETERS)
        tabulate(sample_time / substeps, table, q)
        x1, v1, x2, v2 = start[0], start[1], start[2], start[3]
        clear(v1, v2, m, w, q)
        r1, r2, s1, s2 = power_up(x1, v1, x2, v2, sample_time, m, w, q)
        gain, held = gains[j], late[j]
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
            if true_states == 1:
                out[j, 0, i], out[j, 1, i], out[j, 2, i], out[j, 3, i] = x1, v1, x2, v2
            else:
                out[j, 0, i], out[j, 1, i], out[j, 2, i], out[j, 3, i] = r1, r2, s1, s2
            out[j, 4, i] = command
            if i + 1 < n:
                t = i * sample_time
                x1, v1, x2, v2 = advance(step, x1, v1, x2, v2, command, t, sample_time, substeps, table, m, w, q)
                r1, r2, s1, s2 = measure(x1, v1, x2, v2, t + sample_time, sample_time, m, w, q)
