"""Entry points of the compiled step: open loop, P-control, one sample, sweeps.

Each is a loop over samples around :func:`~flexdrive_gym.drive.sample.advance` and
:func:`~flexdrive_gym.drive.sample.measure`; none holds an equation. ``z`` is ``None`` or the workspace of
:mod:`~flexdrive_gym.drive.step`; ``memory`` is a float array of length ``WORK_SPACE``.
"""

from __future__ import annotations

from math import inf
from typing import Any

import numpy as np

from flexdrive_gym.drive.compilation import kernel, pointer, shifted
from flexdrive_gym.drive.effects import N_PARAMETERS, WORKSPACE
from flexdrive_gym.drive.forces import W2, limited, spring_force
from flexdrive_gym.drive.piece import tabulate
from flexdrive_gym.drive.sample import MEMORY, WORK_SPACE, advance, anchor, clear, measure, power_up, push
from flexdrive_gym.drive.step import step

NOTHING = np.empty((4, 0))


@kernel
def run_recording(
    u: Any,
    sample_time: float,
    substeps: int,
    start: Any,
    memory: Any,
    z: Any,
    p: Any,
    readings: Any,
    states: Any,
    track: Any,
    pushes: Any,
) -> None:
    """See :func:`run_open_loop`; what is left out there has no columns here."""
    x1, v1, x2, v2 = start[0], start[1], start[2], start[3]
    q, m, w = pointer(p), pointer(memory), pointer(z)
    table = shifted(m, MEMORY)
    tabulate(sample_time / substeps, table, q)
    clear(v1, v2, m, w, q)
    tracked, pushed, told = track.shape[1] > 0, pushes.shape[1] > 0, states.shape[1] > 0
    if tracked:
        anchor(track[0, 0], track[1, 0], x1, x2, w)
    r1, r2, s1, s2 = power_up(x1, v1, x2, v2, sample_time, m, w, q)
    n = u.shape[0]
    for i in range(n):
        readings[0, i], readings[1, i], readings[2, i], readings[3, i] = r1, r2, s1, s2
        if told:
            states[0, i], states[1, i], states[2, i], states[3, i] = x1, v1, x2, v2
        if i + 1 < n:
            t = i * sample_time
            if pushed:
                push(pushes[0, i], pushes[1, i], w)
            x1, v1, x2, v2 = advance(step, x1, v1, x2, v2, u[i], t, sample_time, substeps, table, m, w, q)
            if tracked:
                anchor(track[0, i + 1], track[1, i + 1], x1, x2, w)
            r1, r2, s1, s2 = measure(x1, v1, x2, v2, t + sample_time, sample_time, m, w, q)


def run_open_loop(
    u: Any,
    sample_time: float,
    substeps: int,
    start: Any,
    memory: Any,
    z: Any,
    p: Any,
    readings: Any,
    states: Any = None,
    track: Any = None,
    pushes: Any = None,
) -> None:
    """Drive with a recorded command.

    Parameters
    ----------
    u : ndarray, shape (n,)
        Command [V], held over each sample.
    start : ndarray, shape (4,)
        x1, v1, x2, v2 at the first sample.
    readings : ndarray, shape (4, n)
        Written: x1, x2, v1, v2 as the encoders report them.
    states : ndarray, shape (4, n), or None
        Written: the true x1, v1, x2, v2.
    track : ndarray, shape (2, n), or None
        Where the carts of the rig were [mm]. In a long replay simulated positions drift away from them, so effects that depend
        on the position along the track are anchored: at every sample their x is moved to the track, and follows the
        simulation within the sample. The spring and everything else stay simulated. A value that is not a number leaves
        the anchor where it was. Without effects beyond the base it changes nothing.
    pushes : ndarray, shape (2, n), or None
        Additional forces on cart 1 and cart 2 [V], held over each sample; they need the workspace ``z``.
    """
    # an array of no samples instead of None: one compiled kernel for all cases
    states, track = NOTHING if states is None else states, NOTHING if track is None else track
    pushes = NOTHING if pushes is None else pushes
    for name, rows in (("track", track), ("pushes", pushes)):
        # the kernel would read past the end
        if rows.shape[1] not in (0, len(u)):
            raise ValueError(f"{name}: must have one column per sample, {len(u)}; got {rows.shape[1]}.")
    run_recording(u, sample_time, substeps, start, memory, z, p, readings, states, track, pushes)


@kernel
def run_p_control(
    xr: Any,
    gain: float,
    feedback: int,
    sample_time: float,
    substeps: int,
    start: Any,
    memory: Any,
    z: Any,
    p: Any,
    readings: Any,
    u: Any,
) -> None:
    """Close the loop u = Kp·(xr - x) around the encoder of cart 1 or 2 (``feedback``), with the command limit.

    ``readings`` (4, n) and ``u`` (n,) are written.
    """
    x1, v1, x2, v2 = start[0], start[1], start[2], start[3]
    q, m, w = pointer(p), pointer(memory), pointer(z)
    table = shifted(m, MEMORY)
    tabulate(sample_time / substeps, table, q)
    clear(v1, v2, m, w, q)
    r1, r2, s1, s2 = power_up(x1, v1, x2, v2, sample_time, m, w, q)
    n = xr.shape[0]
    for i in range(n):
        readings[0, i], readings[1, i], readings[2, i], readings[3, i] = r1, r2, s1, s2
        u[i] = limited(gain * (xr[i] - (r1 if feedback == 1 else r2)), q)
        if i + 1 < n:
            t = i * sample_time
            x1, v1, x2, v2 = advance(step, x1, v1, x2, v2, u[i], t, sample_time, substeps, table, m, w, q)
            r1, r2, s1, s2 = measure(x1, v1, x2, v2, t + sample_time, sample_time, m, w, q)


@kernel
def spring_curve(deflections: Any, memory: Any, z: Any, p: Any, force: Any) -> None:
    """For every deflection [mm], write the force of a spring [V] that rests there and has no past."""
    q, m, w = pointer(p), pointer(memory), pointer(z)
    clear(0.0, 0.0, m, w, q)
    for i in range(deflections.shape[0]):
        force[i] = spring_force(deflections[i], 0.0, w, 0, q)


@kernel
def sweep_p_control(
    xr: Any,
    gains: Any,
    feedback: int,
    window: int,
    sample_time: float,
    substeps: int,
    memory: Any,
    z: Any,
    p: Any,
    swing: Any,
) -> None:
    """For every gain, the peak-to-peak swing of x2 (x1 if rigid) [mm] over the last ``window`` samples, from rest.

    ``swing`` (number of gains,) is written; inf where the motion leaves all bounds, as on a spring that softens until it
    pushes.
    """
    n = xr.shape[0]
    q, m, w = pointer(p), pointer(memory), pointer(z)
    table = shifted(m, MEMORY)
    tabulate(sample_time / substeps, table, q)
    for j in range(gains.shape[0]):
        gain = gains[j]
        x1, v1, x2, v2 = 0.0, 0.0, 0.0, 0.0
        clear(v1, v2, m, w, q)
        r1, r2, _s1, _s2 = power_up(x1, v1, x2, v2, sample_time, m, w, q)
        low, high = 1e300, -1e300
        for i in range(n):
            if i >= n - window:
                x = x2 if p[W2] > 0.0 else x1
                low, high = min(low, x), max(high, x)
            u = limited(gain * (xr[i] - (r1 if feedback == 1 else r2)), q)
            t = i * sample_time
            x1, v1, x2, v2 = advance(step, x1, v1, x2, v2, u, t, sample_time, substeps, table, m, w, q)
            r1, r2, _s1, _s2 = measure(x1, v1, x2, v2, t + sample_time, sample_time, m, w, q)
        # no comparison holds for nan, so a motion that became nan would have moved neither bound
        swing[j] = high - low if abs(x1) + abs(x2) < inf else inf


@kernel
def run_sample(
    state: Any, u: float, t: float, sample_time: float, substeps: int, memory: Any, z: Any, p: Any, reading: Any
) -> None:
    """Advance one control sample after :func:`begin`; ``state`` (4,) is changed in place, ``reading`` (4,) is written."""
    q, m, w = pointer(p), pointer(memory), pointer(z)
    x1, v1, x2, v2 = advance(
        step, state[0], state[1], state[2], state[3], u, t, sample_time, substeps, shifted(m, MEMORY), m, w, q
    )
    state[0], state[1], state[2], state[3] = x1, v1, x2, v2
    reading[0], reading[1], reading[2], reading[3] = measure(x1, v1, x2, v2, t + sample_time, sample_time, m, w, q)


@kernel
def begin(state: Any, sample_time: float, substeps: int, memory: Any, z: Any, p: Any, reading: Any) -> None:
    """Clear the memory of a drive in the given state, tabulate its step, and write its first readings."""
    q, m, w = pointer(p), pointer(memory), pointer(z)
    tabulate(sample_time / substeps, shifted(m, MEMORY), q)
    x1, v1, x2, v2 = state[0], state[1], state[2], state[3]
    clear(v1, v2, m, w, q)
    reading[0], reading[1], reading[2], reading[3] = power_up(x1, v1, x2, v2, sample_time, m, w, q)


@kernel
def run_lockstep(
    states: Any,
    u: Any,
    first: int,
    sample_time: float,
    substeps: int,
    memory: Any,
    z: Any,
    p: Any,
    readings: Any,
    out: Any,
) -> None:
    """Advance many drives by a few samples after :func:`begin`, each under commands of its own.

    Parameters
    ----------
    states : ndarray, shape (jobs, 4)
        Changed in place.
    u : ndarray, shape (jobs, n)
        Commands [V], one per sample.
    first
        Number of the first sample since the start.
    memory, z, p : ndarray, shapes (jobs, WORK_SPACE), (jobs, WORKSPACE) or None, (jobs, n_parameters)
    readings : ndarray, shape (jobs, 4)
        Written: the encoders after the last sample.
    out : ndarray, shape (jobs, 4, n)
        Written: the true states at the beginning of each sample.
    """
    all_memory, all_work, parameters = pointer(memory), pointer(z), pointer(p)
    for j in range(states.shape[0]):
        m = shifted(all_memory, j * WORK_SPACE)
        w = shifted(all_work, j * WORKSPACE)
        q = shifted(parameters, j * N_PARAMETERS)
        table = shifted(m, MEMORY)
        x1, v1, x2, v2 = states[j, 0], states[j, 1], states[j, 2], states[j, 3]
        r1, r2, s1, s2 = readings[j, 0], readings[j, 1], readings[j, 2], readings[j, 3]
        for i in range(u.shape[1]):
            out[j, 0, i], out[j, 1, i], out[j, 2, i], out[j, 3, i] = x1, v1, x2, v2
            t = (first + i) * sample_time
            x1, v1, x2, v2 = advance(step, x1, v1, x2, v2, u[j, i], t, sample_time, substeps, table, m, w, q)
            r1, r2, s1, s2 = measure(x1, v1, x2, v2, t + sample_time, sample_time, m, w, q)
        states[j, 0], states[j, 1], states[j, 2], states[j, 3] = x1, v1, x2, v2
        readings[j, 0], readings[j, 1], readings[j, 2], readings[j, 3] = r1, r2, s1, s2
