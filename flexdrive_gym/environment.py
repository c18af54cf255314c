"""The flexible drive as a Gymnasium environment."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import replace
from math import nan
from sys import getrefcount
from typing import TYPE_CHECKING, Any, Literal, cast

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from flexdrive_gym.drive.compilation import compiled_before
from flexdrive_gym.drive.drive import Drive
from flexdrive_gym.drive.linear import LinearDrive
from flexdrive_gym.fleet import MOST_SPARE, NEVER, Fleet, Outputs, counts_references
from flexdrive_gym.info import Unread, unread
from flexdrive_gym.start import start_state
from flexdrive_gym.task import Task, check_arguments

if TYPE_CHECKING:
    from gymnasium.envs.registration import EnvSpec

    from flexdrive_gym.rendering import Frame, Renderer

Observation = npt.NDArray[np.float32]
Info = dict[str, Any]
RENDER_MODES = ("human", "rgb_array", "ansi")
WINDOW_FPS = 50


def action_space() -> Any:
    """Return the space of actions: command over the voltage limit."""
    return spaces.Box(-1.0, 1.0, (1,), np.float32)


def observation_space(fleet: Fleet) -> Any:
    """Return the space of one drive's observations; every entry has a finite, symmetric bound."""
    return spaces.Box(-fleet.bound, fleet.bound, dtype=np.float32)


def announce_compilation() -> None:
    """Say once, on standard error, that the first use compiles."""
    if not compiled_before():
        sys.stderr.write("flexdrive: compiling the drive once; this takes about half a minute and is cached\n")


def frame_of(task: Task, clock: int, now: Mapping[str, float], title: str) -> Frame:
    """Return what a renderer is told of a drive after so many control periods; ``now`` is an ``info``."""
    from flexdrive_gym.rendering import Frame  # noqa: PLC0415  (rendering is an extra)

    return Frame(
        t=clock * task.control_period,
        x1=now["x1"],
        x2=now["x2"] if task.rig.carts == 2 else nan,
        xr=now["xr"],
        u=now["u"],
        travel_limit=task.travel_limit,
        voltage_limit=task.voltage,
        title=title,
        units=task.rig.units,
    )


class Slot:
    """What one step of a single environment writes and returns; used again when the caller has dropped it.

    Making the arrays and the dictionary anew for every step would take as long as the physics.
    """

    __slots__ = ("address", "ended", "info", "observation", "outputs", "reward", "terminated", "truncated")

    def __init__(self, outputs: Outputs) -> None:
        self.outputs, self.address, self.observation = outputs, outputs.addresses[0], outputs.observation
        # memoryviews read single numbers in a third of the time that array indexing takes
        views: list[Any] = [memoryview(a) for a in (outputs.reward, outputs.terminated, outputs.truncated)]  # type: ignore[arg-type]
        self.reward, self.terminated, self.truncated = views
        self.ended = outputs.ended[0]
        self.unread()

    def unread(self) -> Unread:
        """Return a new ``info`` of what is written here."""
        self.info = unread(self.outputs.record)
        return self.info


class FlexDriveEnv(gymnasium.Env[Observation, npt.NDArray[np.float32]]):
    """Track a reference with the drive's second cart (the only one of a rigid drive).

    Action: command u over the voltage limit, in [-1, 1]. Observation: see :meth:`Task.names` and
    ``docs/environment.md``. The episode *terminates* when a cart leaves the travel or the spring its stroke, and is
    *truncated* at the time limit. ``info`` carries true states, readings, command, reference and error in physical units,
    and every term of the reward.

    Parameters
    ----------
    render_mode
        ``human``, ``rgb_array``, ``ansi`` or ``None``.
    **arguments
        Of :class:`~flexdrive_gym.task.Task`.
    """

    metadata: dict[str, Any] = {"render_modes": list(RENDER_MODES), "render_fps": 200}  # noqa: RUF012
    _spec: EnvSpec | None = None

    def __init__(self, render_mode: str | None = None, **arguments: Any) -> None:
        check_arguments(arguments, ("render_mode",))
        if render_mode is not None and render_mode not in RENDER_MODES:
            raise ValueError(f"render_mode: must be None, {', '.join(RENDER_MODES)}; got {render_mode!r}.")
        announce_compilation()
        self.task = Task(**arguments)
        # a picture per step is what recorders take, so a video plays in real time at this rate
        self.metadata = {**type(self).metadata, "render_fps": round(1.0 / self.task.control_period)}
        self.render_mode = render_mode
        self._build()

    def _build(self) -> None:
        self._fleet = Fleet(self.task, 1)
        self.action_space = action_space()
        self.observation_space = observation_space(self._fleet)
        actions: Any = self._fleet.actions
        self._actions: Any = memoryview(actions)
        self._z = self._fleet.z
        self._slots: list[Slot] = []
        slot = self._new_slot()
        # how often a slot's things are referred to while the caller has none of them
        self._idle, self._idle_info = getrefcount(slot.observation), getrefcount(slot.info)
        if not counts_references():
            self._idle = NEVER
        self._renderer: Renderer | None = None
        self._seeded = False
        self._await("before the first step")

    def _await(self, when: str | None) -> None:
        """Refuse steps until a reset, which is due at this time; ``None``: allow them."""
        self._due = when
        # in place of the kernel, so that a step that is in order asks nothing
        self._kernel: Any = self._fleet.kernel if when is None else _REFUSALS[when]

    def _new_slot(self) -> Slot:
        slot = Slot(self._fleet.new_outputs(flat=True))
        # whoever keeps what it gets will not give it back: forget the oldest
        self._slots = [slot, *self._slots[: MOST_SPARE - 1]]
        return slot

    def __getstate__(self) -> dict[str, Any]:
        kept = {k: v for k, v in self.__dict__.items() if k not in _REBUILT}
        return {**kept, "_saved": self._fleet.keep()}

    def __setstate__(self, saved: dict[str, Any]) -> None:
        fleet = saved.pop("_saved")
        self.__dict__.update(saved)
        seeded, due = self._seeded, self._due
        self._build()
        self._seeded = seeded
        self._await(due)
        self._fleet.restore(fleet)

    @property
    def drive(self) -> Drive:
        """The drive as it is in this episode, effects and drawn parameters included."""
        drawn = self._fleet.drawn()
        if not drawn:
            return self.task.rig
        return self.task.rig.replace({name: float(values[0]) for name, values in drawn.items()})

    @property
    def spec(self) -> EnvSpec | None:
        """What Gymnasium made the environment from, with the time limit that it has."""
        return self._spec

    @spec.setter
    def spec(self, made: EnvSpec | None) -> None:
        # the limit follows from arguments, so the registered name alone has none
        self._spec = None if made is None else replace(made, max_episode_steps=self.task.horizon)

    def linear_model(self) -> LinearDrive:
        """Return the linear model of :attr:`drive`: state space, transfer functions, poles, from the same numbers."""
        return self.drive.linear

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Observation, Info]:
        """Start an episode.

        Parameters
        ----------
        seed
            Of the environment's random stream (drawn parameters, reference, noise).
        options
            Where to start instead of at rest at 0: any of ``x1``, ``x2`` [mm], ``v1``, ``v2`` [mm/s], the others being 0, or
            ``{"state": (x1, v1, x2, v2)}``.

        Returns
        -------
        observation : ndarray, shape (entries,)
        info : dict
            As in :meth:`step`; with ``randomise`` also ``parameters``, the drawn ones by name.

        Raises
        ------
        ValueError
            For an unknown option, or a start beyond a limit at which an episode ends.
        """
        start = start_state(self.task, options)
        super().reset(seed=seed)
        if seed is not None or not self._seeded:
            self._fleet.seed([int(self.np_random.integers(2**62)) if seed is None else seed])
            self._seeded = True
        slot = self._new_slot()
        self._fleet.outputs = slot.outputs
        self._fleet.reset(start=start)
        self._await(None)
        if self.render_mode is not None:
            if self._renderer is not None:
                self._renderer.reset()
            self._record()
        info = self._info()
        if self.task.randomisation.names:
            info["parameters"] = {name: float(values[0]) for name, values in self._fleet.drawn().items()}
        return slot.observation, info

    def step(self, action: npt.NDArray[np.float32]) -> tuple[Observation, float, bool, bool, Info]:
        """Hold a command for one control period.

        Parameters
        ----------
        action : ndarray, shape (1,)
            Command over the voltage limit; clipped to [-1, 1].

        Raises
        ------
        ValueError
            For an action that is not one finite number; the drive has not moved then.
        gymnasium.error.ResetNeeded
            Before the first reset, and after the end of an episode.
        """
        try:
            self._actions[0] = action.item()  # half the time of indexing
        except (AttributeError, ValueError, TypeError):
            self._actions[0] = _only(action)
        for slot in self._slots:
            if getrefcount(slot.observation) == self._idle and getrefcount(slot.info) == self._idle_info:
                break
        else:
            slot = self._new_slot()
        self._kernel(slot.address, self._z)
        info = slot.info
        if info.__class__ is not Unread:
            info = slot.unread()
        if slot.ended[0]:
            if slot.ended[0] < 0:
                self._fleet.refuse()
            self._await("after the end of an episode")
            if self.render_mode is not None:
                self._record()
            return slot.observation, slot.reward[0], slot.terminated[0], slot.truncated[0], info
        if self.render_mode is not None:
            self._record()
        return slot.observation, slot.reward[0], False, False, info

    def _info(self) -> Info:
        return {key: float(values[0]) for key, values in self._fleet.state().items()}

    def render(self) -> Any:
        """Return the picture of the present state and the last seconds; see :mod:`flexdrive_gym.rendering`."""
        if self._renderer is None:
            return None
        return self._renderer.render()

    def _record(self) -> None:
        """Add the present state to the picture; show it when a frame is due, so that a window runs in real time."""
        from flexdrive_gym.rendering import Renderer  # noqa: PLC0415

        if self._renderer is None:
            self._renderer = Renderer(cast("Literal['human', 'rgb_array', 'ansi']", self.render_mode), fps=WINDOW_FPS)
        clock = int(self._fleet.clock[0])
        self._renderer.add(frame_of(self.task, clock, self._info(), self.task.rig.name))
        if self.render_mode == "human" and clock % max(1, round(1.0 / (WINDOW_FPS * self.task.control_period))) == 0:
            self._renderer.render()

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None


def _only(action: Any) -> float:
    """Return the number in what is no array of one."""
    given = np.ravel(action)
    if given.shape != (1,) or given.dtype.kind not in "iuf":
        raise ValueError(f"action: must be one number, shape (1,), command over the voltage limit; got {action!r}.")
    return float(given[0])


def _refusal(when: str) -> Any:
    def refuse(_address: int, _z: Any) -> None:
        raise gymnasium.error.ResetNeeded(f"step: the environment must be reset {when}. Call reset() first.")

    return refuse


_REFUSALS = {when: _refusal(when) for when in ("before the first step", "after the end of an episode")}
_REBUILT = {"_fleet", "_renderer", "_actions", "_kernel", "_z", "_slots", "_idle", "_idle_info"}
