"""From parameters to recordings: open loop and closed loop around the compiled step."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import inf, isfinite
from typing import Any, Literal, Protocol

import numpy as np
import numpy.typing as npt

from flexdrive_gym.drive import kernels, loop, parameters
from flexdrive_gym.drive.linear_controller import LinearController
from flexdrive_gym.drive.sample import WORK_SPACE
from flexdrive_gym.recording import Excitation, FloatArray, Recording

Values = Mapping[str, float]


@dataclass(frozen=True)
class Observation:
    """What a controller on the rig knows at one sample: time [s], reference, encoders [mm], velocities [mm/s]."""

    t: float
    xr: float
    x1: float
    x2: float
    v1: float
    v2: float


class Controller(Protocol):
    """Anything that turns an observation into a command [V]."""

    def reset(self) -> None:
        """Forget the past; called once before a run."""

    def __call__(self, observation: Observation, /) -> float:
        """Return the command [V]."""


# readings beyond are of a run that left all bounds [mm, mm/s]
FAR = 1e9


def command_of(controller: Callable[[Observation], Any], observation: Observation) -> float:
    """Ask a controller for its command [V].

    Raises
    ------
    TypeError, ValueError
        If the answer is no number, or nan or infinite although what the controller saw was a drive's. A run that left all
        bounds is a result, and passes.
    """
    given = controller(observation)
    try:
        u = float(given)
    except (TypeError, ValueError) as error:
        raise TypeError(
            f"controller: must return one number, the command [V]; got {given!r}. Return a float."
        ) from error
    seen = observation
    if not isfinite(u) and abs(seen.xr) + abs(seen.x1) + abs(seen.x2) + abs(seen.v1) + abs(seen.v2) < FAR:
        raise ValueError(
            f"controller: must return a finite command [V]; got {u} at t = {seen.t:g} s from finite readings. Look for a "
            "division by zero, or a state that grew without bounds."
        )
    return u


@dataclass(frozen=True)
class PControl:
    """The handout's P-control: u = Kp·(xr - x), from x2 (non-collocated) or x1 (collocated)."""

    gain: float
    feedback: Literal["x1", "x2"] = "x2"

    def __post_init__(self) -> None:
        if not isfinite(self.gain):
            raise ValueError(f"gain: must be a finite number [V/mm]; got {self.gain}.")
        if self.feedback not in ("x1", "x2"):
            raise ValueError(f"feedback: must be 'x1' or 'x2'; got {self.feedback!r}.")

    def reset(self) -> None:
        """Do nothing: there is no state."""

    def __call__(self, observation: Observation, /) -> float:
        """Return Kp·(xr - x) [V]."""
        x = observation.x1 if self.feedback == "x1" else observation.x2
        return self.gain * (observation.xr - x)

    def linear(self, sample_time: float = 1e-3) -> LinearController:
        """Return the same law as a linear controller."""
        return LinearController.from_tf(
            self.gain, 1.0, reads=self.feedback, domain="z", sample_time=sample_time, name=f"p_{self.feedback}"
        )


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
        out = np.empty((1, 5, len(t)))
        none, whole = np.zeros(len(t)), np.zeros(1, dtype=np.int64)
        work = np.zeros(2 * controller.order + 1)
        loop.run_linear(
            controller.shape_held(xr, every), controller.law(), controller.order, every, np.ones(1), whole, none, 0,
            sample_time, steps, state, memory, work, np.zeros(1), z, p[None, :], out,
        )  # fmt: skip
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
