"""From parameters to recordings: open loop and closed loop around the compiled step."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf

import numpy as np
import numpy.typing as npt

from flexdrive_gym.drive import kernels, loop, parameters
from flexdrive_gym.drive.controller import Controller, Observation, command_of
from flexdrive_gym.drive.linear_controller import LinearController
from flexdrive_gym.drive.p_control import PControl
from flexdrive_gym.drive.sample import WORK_SPACE
from flexdrive_gym.recording import Excitation, FloatArray, Recording

Values = Mapping[str, float]


def uniform(t: npt.ArrayLike, values: npt.ArrayLike, name: str) -> tuple[FloatArray, FloatArray]:
    """Check sample instants and one signal; return both as float arrays.

    Raises
    ------
    ValueError
        If ``t`` does not rise uniformly, shapes differ, or a value is not finite.
    """
    times = np.ascontiguousarray(t, dtype=np.float64)
    signal = np.ascontiguousarray(values, dtype=np.float64)
    if times.ndim != 1 or len(times) < 2:
        raise ValueError(f"t: must be a vector of at least 2 instants; got shape {times.shape}.")
    steps = np.diff(times)
    if not np.all(np.isfinite(times)) or steps.min() <= 0.0 or np.ptp(steps) > 1e-3 * steps.mean():
        raise ValueError(
            f"t: must rise in equal steps; got steps from {steps.min():g} to {steps.max():g} s. Resample first."
        )
    if signal.shape != times.shape:
        raise ValueError(f"{name}: must have the shape of t, {times.shape}; got {signal.shape}.")
    if not np.all(np.isfinite(signal)):
        bad = int(np.flatnonzero(~np.isfinite(signal))[0])
        raise ValueError(f"{name}: must be finite; got {signal[bad]} at t = {times[bad]:g} s. Mask or fill it.")
    return times, signal


def _start(start: npt.ArrayLike) -> FloatArray:
    state = np.array(start, dtype=np.float64)
    if state.shape != (4,) or not np.all(np.isfinite(state)):
        raise ValueError(f"start: must be four finite numbers x1, v1, x2, v2; got {start!r}.")
    return state


def _steps(values: Values, sample_time: float, physics_step: float) -> int:
    if not physics_step > 0.0:
        raise ValueError(f"physics_step: must be positive [s]; got {physics_step:g}.")
    parameters.check_delays(values, sample_time)
    return parameters.substeps(values, sample_time, physics_step)


def _recording(
    values: Values, t: FloatArray, u: FloatArray, readings: FloatArray, travel_limit: float, name: str
) -> Recording:
    two = "m2" in values
    outside = np.abs(readings[: 1 + two]).max(axis=0) > travel_limit
    n = int(np.argmax(outside)) + 1 if outside.any() else len(t)
    notes = (f"ended at {t[n - 1]:.3f} s: a cart left the travel of ±{travel_limit:g} mm",) if outside.any() else ()
    cutoff = values.get("velocity_processing.encoder_1.cutoff", 0.0)
    return Recording(
        name=name,
        t=t[:n],
        u=u[:n],
        x1=readings[0, :n],
        x2=readings[1, :n] if two else None,
        v1=readings[2, :n],
        v2=readings[3, :n] if two else None,
        quantum=(
            values.get("encoder_quantisation.encoder_1.quantum", 0.0),
            values.get("encoder_quantisation.encoder_2.quantum", 0.0),
        ),
        velocity_cutoff=cutoff,
        notes=notes,
        source="simulated",
    )


def open_loop(
    values: Values,
    t: FloatArray,
    u: FloatArray,
    start: npt.ArrayLike,
    physics_step: float,
    travel_limit: float,
    name: str,
) -> Recording:
    """Run the compiled open loop; see :meth:`flexdrive_gym.Drive.simulate`."""
    sample_time = float(np.mean(np.diff(t)))
    steps = _steps(values, sample_time, physics_step)
    readings = np.empty((4, len(t)))
    kernels.run_open_loop(
        u,
        sample_time,
        steps,
        _start(start),
        np.zeros(WORK_SPACE),
        parameters.workspace(values),
        parameters.vector(values),
        readings,
        None,
    )
    return _recording(values, t, u, readings, travel_limit, name)


def closed_loop(
    values: Values,
    t: FloatArray,
    xr: FloatArray,
    controller: Controller,
    start: npt.ArrayLike,
    physics_step: float,
    travel_limit: float,
    name: str,
) -> Recording:
    """Run the closed loop; see :meth:`flexdrive_gym.Drive.simulate_closed_loop`."""
    sample_time = float(np.mean(np.diff(t)))
    steps = _steps(values, sample_time, physics_step)
    p, z, memory = parameters.vector(values), parameters.workspace(values), np.zeros(WORK_SPACE)
    state = _start(start)
    readings, u = np.empty((4, len(t))), np.empty(len(t))
    excitation = Excitation("closed_loop", amplitude=float(np.max(np.abs(xr - xr[0]))))
    if isinstance(controller, PControl):
        number = {"x1": 1, "x2": 2}[controller.feedback]
        kernels.run_p_control(xr, controller.gain, number, sample_time, steps, state, memory, z, p, readings, u)
        excitation = Excitation("closed_loop", excitation.amplitude, 0.0, controller.feedback, controller.gain)
    elif isinstance(controller, LinearController) and (every := controller.every(sample_time)) is not None:
        trials = loop.Trials(np.ones(1), np.zeros(1, dtype=np.int64), np.zeros(len(t)))
        rigs = loop.Rigs(p[None, :], z, state, sample_time, steps)
        out = loop.run_linear(controller.shape_held(xr, every), controller.law(every), trials, rigs, true_states=False)
        readings, u = np.ascontiguousarray(out[0, :4]), out[0, 4].copy()
    else:
        limit = values.get("saturation.limit", inf)
        reading = np.empty(4)
        reset = getattr(controller, "reset", None)  # a plain function has no past to forget
        if reset is not None:
            reset()
        kernels.begin(state, sample_time, steps, memory, z, p, reading)
        for i in range(len(t)):
            readings[:, i] = reading
            command = command_of(controller, Observation(float(t[i]), float(xr[i]), *map(float, reading)))
            u[i] = min(max(command, -limit), limit)
            if i + 1 < len(t):
                kernels.run_sample(state, u[i], i * sample_time, sample_time, steps, memory, z, p, reading)
    run = _recording(values, t, u, readings, travel_limit, name)
    return Recording(**{**run.__dict__, "xr": xr[: run.n], "excitation": excitation})


def spring_force(values: Values, deflection: npt.ArrayLike) -> FloatArray:
    """See :meth:`Drive.spring_force`."""
    delta = np.ascontiguousarray(deflection, dtype=np.float64)
    force = np.empty(delta.size)
    kernels.spring_curve(
        delta.ravel(), np.zeros(WORK_SPACE), parameters.workspace(values), parameters.vector(values), force
    )
    return force.reshape(delta.shape)
