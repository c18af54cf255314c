"""The handout's P-control."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from typing import Literal

from flexdrive_gym.drive.controller import Observation
from flexdrive_gym.drive.linear_controller import LinearController


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
