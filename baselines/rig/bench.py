"""The handout's experiments on a rig: where they start, what stops them, and how they went."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from baselines.lab.experiments import DURATION_S, P_CONTROL_S, closed_loop_name, open_loop_name
from baselines.rig.loop import run
from baselines.rig.protocol import Limits, Rig, RigStopped
from baselines.rig.timing import Timing
from flexdrive_gym import Excitation, Observation, PControl, Recording
from flexdrive_gym.recording import FloatArray
from flexdrive_gym.references import handout_trajectory, sine, square
from flexdrive_gym.units import Units

# stiff enough that friction leaves the cart within a few mm of the middle, and slow
HOMING_GAIN, HOMING_V, HOMING_MM_S = 0.2, 2.0, 50.0
HOME_MM = 10.0
_HOLD_S, _REST_S, _STILL_S = 0.5, 1.5, 0.2
_STILL_COUNTS = 4
_MOST_HOMINGS = 3


@dataclass(frozen=True)
class Playback:
    """A recorded or generated command as a controller.

    Attributes
    ----------
    u : ndarray, shape (n,)
        One per sample [V].
    period
        Of the samples [s].
    """

    u: FloatArray
    period: float

    def __call__(self, observation: Observation, /) -> float:
        """Return the command of this instant [V]."""
        return float(self.u[round(observation.t / self.period)])


class RigBench:
    """A rig on which the handout's experiments are made, one after another.

    Parameters
    ----------
    rig
        Real or simulated.
    limits
        What stops the motor.
    tell
        Is given a sentence for what takes time.

    Attributes
    ----------
    timings
        Of every recorded run, by its name.
    """

    def __init__(
        self, rig: Rig, limits: Limits | None = None, *, tell: Callable[[str], None] = lambda _sentence: None
    ) -> None:
        self.rig = rig
        self.limits = (limits or Limits()).within(rig.description.limits)
        self.timings: dict[str, Timing] = {}
        self._tell = tell

    @property
    def carts(self) -> int:
        """2, or 1 for a rigid drive."""
        return self.rig.description.carts

    @property
    def units(self) -> Units:
        """The rig's."""
        return self.rig.description.units

    def p_control(self, gain: float, feedback: Literal["x1", "x2"], name: str = "") -> Recording:
        """Run P-control on the handout's trajectory for 4 s (2.1-2.4)."""
        t = self._times(P_CONTROL_S)
        self.go_home()
        limit = min(self.limits.voltage, self.rig.description.saturation)
        made = self._run(
            PControl(gain, feedback),
            handout_trajectory(t),
            name or closed_loop_name(gain, feedback, self.units),
            replace(self.limits, voltage=limit),
        )
        at_limit = bool(np.max(np.abs(made.u)) >= limit)
        excitation = Excitation(
            "closed_loop", float(np.ptp(handout_trajectory(t))), 0.5, feedback, gain,
            limit=limit if at_limit else None,
        )  # fmt: skip
        return replace(made, excitation=excitation, v1=None, v2=None)

    def open_loop(self, kind: Literal["square", "sine"], amplitude: float, frequency: float) -> Recording:
        """Run an open-loop excitation for 8 s (2.5, 2.6); velocities are recorded.

        Raises
        ------
        ValueError
            If the excitation goes beyond the command limit; nothing has moved then.
        """
        if amplitude > self.limits.voltage:
            raise ValueError(
                f"{kind}: the amplitude must be within the command limit of {self.units.text(self.limits.voltage, 'V')}; got "
                f"{self.units.text(amplitude, 'V')}. "
                "Lower it."
            )
        t = self._times(DURATION_S)
        u = (square if kind == "square" else sine)(t, amplitude, frequency)
        self.go_home()
        made = self._run(
            Playback(u, self.rig.description.period),
            np.zeros(len(t)),
            open_loop_name(kind, amplitude, frequency, self.units),
            self.limits,
        )
        return replace(made, excitation=Excitation(kind, amplitude, frequency), xr=None, x1=None, x2=None)

    def go_home(self) -> None:
        """Bring the carts near the rig's zero and wait until they rest, as a student does between experiments.

        Raises
        ------
        RigStopped
            If they do not come to rest there.
        """
        if self.rig.description.returns:
            return
        for _ in range(_MOST_HOMINGS):
            x1, still = self._look()
            if abs(x1) < HOME_MM and still:
                return
            if abs(x1) >= HOME_MM:
                self._tell(f"bringing cart 1 back from {x1:+.0f} mm")
                self._walk(-x1)
        raise RigStopped(
            "stopped",
            f"cart 1 does not come to rest within {HOME_MM:g} mm of the rig's zero. Bring the carts to the middle by hand, and "
            "see that nothing holds them.",
        )

    def _look(self) -> tuple[float, bool]:
        """Wait at 0 V; return where cart 1 is by the rig's zero [mm], and whether the carts stand still."""
        seen = run(self.rig, lambda _observation: 0.0, np.zeros(self._samples(_REST_S)), self.limits)
        last = seen.recording.t >= seen.recording.t[-1] - _STILL_S
        moved = [np.ptp(x[last]) for x in (seen.recording.x1, seen.recording.x2) if x is not None]
        still = all(m <= _STILL_COUNTS * q for m, q in zip(moved, self.rig.description.quantum, strict=False))
        return seen.zero[0] + float(np.asarray(seen.recording.x1)[-1]), still

    def _walk(self, distance: float) -> None:
        """Move cart 1 by a distance [mm], slowly."""
        moving = self._samples(abs(distance) / HOMING_MM_S)
        path = distance * np.minimum(np.arange(moving + self._samples(_HOLD_S)) / moving, 1.0)
        gentle = replace(self.limits, voltage=min(HOMING_V, self.limits.voltage), resting=np.inf)
        run(self.rig, PControl(HOMING_GAIN, "x1"), path, gentle)

    def _samples(self, duration: float) -> int:
        return max(round(duration / self.rig.description.period), 1)

    def _times(self, duration: float) -> FloatArray:
        return np.asarray(np.arange(self._samples(duration) + 1) * self.rig.description.period)

    def _run(
        self, controller: Callable[[Observation], float], reference: FloatArray, name: str, limits: Limits
    ) -> Recording:
        made = run(self.rig, controller, reference, limits, name=name)
        self.timings[name] = made.timing
        if made.lost:
            made = replace(
                made, recording=replace(made.recording, notes=(*made.recording.notes, f"{made.lost} samples lost"))
            )
        return made.recording
