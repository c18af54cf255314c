"""From settings to one simulated run: the rig, its controller, and the motion that the page animates."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from math import inf
from typing import Any

import numpy as np

from baselines.controllers import FAMILIES, design
from baselines.controllers.p_control import proportional
from baselines.lab.experiments import TRAVEL_MM
from baselines.lab_page.settings import DURATION_S, Push, Settings
from baselines.loop_analysis.stability_limit import with_rig
from flexdrive_gym import Controller, Drive, LinearController, Observation, Recording
from flexdrive_gym.drive import kernels, parameters
from flexdrive_gym.drive.batch.closed_loop import run_batch
from flexdrive_gym.drive.sample import WORK_SPACE
from flexdrive_gym.recording import FloatArray
from flexdrive_gym.references import handout_trajectory, point_to_point, sine, square, step
from flexdrive_gym.units import Units

RIG_TIME_S = 1e-3
# the browser gets every fourth sample: 250 a second are more than a screen shows
_EVERY = 4
# of a sample of the rig: 8 s of motion then take a tenth of a second
_MOST_STEPS = 40

_REFERENCES: dict[str, Callable[[FloatArray], FloatArray]] = {
    "moves": handout_trajectory,
    "one_move": point_to_point,
    "step": step,
    "rest": np.zeros_like,
}


@dataclass(frozen=True, eq=False)
class Motion:
    """One simulated run.

    Attributes
    ----------
    t, x1, x2, xr, u : ndarray, shape (n,)
        Time [s], positions [mm], reference [mm], command [V]; ``x2`` is ``None`` for one cart, ``xr`` in open loop.
    stopped
        When a cart left the track and the run ended [s]; ``None`` where none did.
    units
        The rig's, in which the page shows it.
    name
        Of the drive.
    """

    t: FloatArray
    x1: FloatArray
    x2: FloatArray | None
    xr: FloatArray | None
    u: FloatArray
    stopped: float | None
    units: Units
    name: str

    def payload(self) -> dict[str, Any]:
        """Return the run for the browser: channels as base64 of little-endian float32, in the rig's units."""
        length, command, time = (self.units.one(unit) for unit in ("mm", "V", "s"))

        def packed(values: FloatArray | None, unit: float) -> str | None:
            if values is None:
                return None
            return b64encode((values[::_EVERY] / unit).astype("<f4").tobytes()).decode("ascii")

        return {
            "name": self.name,
            "step": RIG_TIME_S * _EVERY / time,
            "x1": packed(self.x1, length),
            "x2": packed(self.x2, length),
            "xr": packed(self.xr, length),
            "u": packed(self.u, command),
            "length": self.units.length,
            "command": self.units.command,
            "stopped": None if self.stopped is None else self.stopped / time,
        }


def rig_of(settings: Settings, drive: Drive) -> Drive:
    """Return the drive as the settings change it: limit, delay, encoder counts, effects.

    Raises
    ------
    ValueError
        For values that the drive refuses.
    """
    rig = with_rig(drive)
    changes = {k: v for k, v in settings.effects.items() if rig.carts == 2 or not _of_cart_2(k)}
    if settings.limit is not None:
        changes["saturation.limit"] = settings.limit
    if settings.delay is not None:
        changes["input_delay.tau"] = settings.delay
    if settings.count is not None:
        changes |= {f"encoder_quantisation.encoder_{i + 1}.quantum": settings.count for i in range(rig.carts)}
    changed = rig.replace(changes) if changes else rig
    steps = parameters.substeps(changed.values, RIG_TIME_S, RIG_TIME_S)
    if steps > _MOST_STEPS:
        which = ", ".join(settings.effects) or changed.name
        raise ValueError(
            f"effects: the page simulates at most {_MOST_STEPS} steps a millisecond, so that it follows a hand; got {steps} for "
            f"{which}. Choose values that make the effect slower."
        )
    return changed


def _of_cart_2(key: str) -> bool:
    return key in {"b2", "d2", "k", "C"} or any(part in key for part in ("cart_2", "encoder_2", "spring", "coil_bind"))


@lru_cache(maxsize=64)
def _designed(name: str, values: tuple[tuple[str, float], ...], sample_time: float, limit: float) -> LinearController:
    return design(name, Drive(dict(values)), sample_time=sample_time, limit=limit).controller


def is_quick(settings: Settings) -> bool:
    """Whether the controller is at hand; a design takes seconds the first time."""
    return settings.controller not in FAMILIES


def controller_of(settings: Settings, drive: Drive, own: Controller | None = None) -> Controller | None:
    """Return the controller of the settings; ``None`` in open loop.

    Parameters
    ----------
    drive
        For which a controller is designed; effects that are switched on are left out on purpose.
    own
        The visitor's controller file.

    Raises
    ------
    ValueError
        For an unknown name, or a drive the family cannot control.
    """
    limit = inf if settings.limit is None else settings.limit
    if settings.open_loop:
        return None
    if settings.controller == "p":
        feedback = settings.feedback if drive.carts == 2 else "x1"
        return proportional(settings.gain, feedback, settings.sample_time)
    if settings.controller.startswith("agent:"):
        from baselines.rl.agents import agent_names, find_agent  # noqa: PLC0415  (reads files)

        name = settings.controller.removeprefix("agent:")
        if name not in agent_names():
            raise ValueError(f"controller: no agent is called {name!r}; there are {', '.join(agent_names())}.")
        return find_agent(name).controller(drive, RIG_TIME_S)
    if settings.controller == "own":
        if own is None:
            raise ValueError("controller: no controller file has been read. Drop one first, or choose another.")
        return own
    plain = with_rig(drive)
    return _designed(settings.controller, tuple(plain.values.items()), settings.sample_time, limit)


def reference_of(settings: Settings, t: FloatArray) -> FloatArray:
    """Return xr [mm] at the instants t [s], ndarray, shape (n,)."""
    return np.asarray(_REFERENCES[settings.reference](t))


def simulate(settings: Settings, drive: Drive, controller: Controller | None) -> Motion:
    """Simulate what the settings ask for.

    Parameters
    ----------
    drive
        As it is chosen; the settings' limit, delay, counts and effects come on top.
    controller
        From :func:`controller_of`; ``None`` in open loop.

    Raises
    ------
    ValueError
        For values that the drive refuses.
    """
    rig = rig_of(settings, drive)
    t: FloatArray = np.arange(round(DURATION_S / RIG_TIME_S) + 1, dtype=np.float64) * RIG_TIME_S
    if controller is None:
        u = (square if settings.controller == "square" else sine)(t, settings.amplitude, settings.frequency)
        return _bounded(rig, t, *_open_loop(rig, t, u, settings.pushes), None)
    xr = reference_of(settings, t)
    factor = 1.0 if settings.controller == "p" else settings.factor
    return _bounded(rig, t, *_closed_loop(rig, t, xr, controller, factor, settings.pushes), xr)


_Channels = tuple[FloatArray, FloatArray, FloatArray]


def _open_loop(rig: Drive, t: FloatArray, u: FloatArray, pushes: tuple[Push, ...]) -> _Channels:
    if pushes:
        return pushed(rig, t, u, _Played(u), pushes)
    run = rig.simulate(t, u)
    allowed = np.asarray(np.clip(run.u, -rig.voltage_limit, rig.voltage_limit), dtype=np.float64)
    return _channels(run, allowed)


def _closed_loop(
    rig: Drive, t: FloatArray, xr: FloatArray, controller: Controller, factor: float, pushes: tuple[Push, ...]
) -> _Channels:
    if pushes:
        return pushed(rig, t, xr, _Held(_told(controller, xr), factor), pushes)
    if isinstance(controller, LinearController):
        out = run_batch([rig], xr, controller, gains=factor, true_states=False, sample_time=RIG_TIME_S)
        return out[0, 0], out[0, 1], out[0, 4]
    run = rig.simulate_closed_loop(t, xr, _told(controller, xr))
    return _channels(run, run.u)


def _channels(run: Recording, u: FloatArray) -> _Channels:
    assert run.x1 is not None
    return run.x1, np.zeros_like(run.x1) if run.x2 is None else run.x2, u


def _told(controller: Controller, xr: FloatArray) -> Controller:
    """Tell a controller with a preview the reference that it will follow."""
    following: Callable[[FloatArray], Controller] | None = getattr(controller, "following", None)
    return controller if following is None else following(xr)


def _bounded(rig: Drive, t: FloatArray, x1: FloatArray, x2: FloatArray, u: FloatArray, xr: FloatArray | None) -> Motion:
    """End the run where a cart leaves the track, as the STOP button does on the rig."""
    seen = np.abs(np.array([x1, x2]) if rig.carts == 2 else np.array([x1])).max(axis=0)
    outside = ~(seen <= TRAVEL_MM)
    n = max(int(np.argmax(outside)), _EVERY + 1) if outside.any() else len(t)
    return Motion(
        t[:n],
        np.nan_to_num(np.asarray(x1)[:n]),
        np.nan_to_num(np.asarray(x2)[:n]) if rig.carts == 2 else None,
        None if xr is None else xr[:n],
        np.nan_to_num(u[:n]),
        float(t[n - 1]) if outside.any() else None,
        rig.units,
        rig.name,
    )


class _Played:
    """A recorded command as a controller."""

    def __init__(self, u: FloatArray) -> None:
        self._u = u
        self._i = -1

    def reset(self) -> None:
        self._i = -1

    def __call__(self, _observation: Observation, /) -> float:
        self._i += 1
        return float(self._u[self._i])


class _Held:
    """A controller that holds its command between its own samples, times a factor."""

    def __init__(self, controller: Controller, factor: float) -> None:
        every = getattr(controller, "every", None)
        self._every = (every(RIG_TIME_S) if callable(every) else 1) or 1
        self._controller, self._factor = controller, factor
        self.reset()

    def reset(self) -> None:
        self._i, self._u = 0, 0.0
        forget = getattr(self._controller, "reset", None)
        if forget is not None:
            forget()

    def __call__(self, observation: Observation, /) -> float:
        if self._i % self._every == 0:
            self._u = self._controller(observation)
        self._i += 1
        return self._factor * self._u


def pushed(
    rig: Drive, t: FloatArray, xr: Any, controller: Controller, pushes: tuple[Push, ...]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Run a controller on a rig whose carts are struck.

    Parameters
    ----------
    rig
        With all its effects.
    t, xr : ndarray, shape (n,)
        Uniform instants [s] and reference [mm].
    controller
        Asked at every instant.
    pushes
        Each changes one cart's velocity at the sample next to its time.

    Returns
    -------
    x1, x2, u : ndarray, shape (n,)
        Readings [mm] and command [V].
    """
    values: Mapping[str, float] = rig.values
    struck: dict[int, list[Push]] = {}
    for push in pushes:
        if push.cart <= rig.carts:
            struck.setdefault(round(push.time / RIG_TIME_S), []).append(push)
    parameters.check_delays(values, RIG_TIME_S)
    steps = parameters.substeps(values, RIG_TIME_S, RIG_TIME_S)
    p, z, memory = parameters.vector(values), parameters.workspace(values), np.zeros(WORK_SPACE)
    state, reading = np.zeros(4), np.empty(4)
    readings, u = np.empty((4, len(t))), np.empty(len(t))
    limit = rig.voltage_limit
    controller.reset()
    kernels.begin(state, RIG_TIME_S, steps, memory, z, p, reading)
    for i in range(len(t)):
        readings[:, i] = reading
        for push in struck.get(i, ()):
            state[1 if push.cart == 1 else 3] += push.speed
        command = float(controller(Observation(float(t[i]), float(xr[i]), *map(float, reading))))
        u[i] = min(max(command, -limit), limit)
        if i + 1 < len(t):
            kernels.run_sample(state, u[i], i * RIG_TIME_S, RIG_TIME_S, steps, memory, z, p, reading)
    return readings[0], readings[1], u
