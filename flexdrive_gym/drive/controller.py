"""What a controller on the rig sees, and what it must answer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite
from typing import Any, Protocol


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
