"""What every rig can do: say what it is, take samples at its period, put out a command, and fall silent."""

from __future__ import annotations

from dataclasses import dataclass, fields
from math import inf, isfinite
from typing import Protocol

from flexdrive_gym.units import LAB, Units

MOST_NAME = 32


class RigStopped(OSError):  # noqa: N818  (it says what happened)
    """The motor was stopped before the experiment was over.

    Attributes
    ----------
    reason
        ``late sample``, ``lost peer``, ``command limit``, ``watchdog``, ``travel`` or ``stopped``.
    """

    def __init__(self, reason: str, sentence: str) -> None:
        super().__init__(f"{reason}: {sentence}")
        self.reason = reason


@dataclass(frozen=True)
class Limits:
    """What stops the motor.

    Attributes
    ----------
    travel
        Largest distance of a cart from the rig's zero [mm].
    voltage
        Largest command [V]; a controller's command is clipped to it.
    resting
        How long a command may rest against that limit without a break [s].
    late
        How much later a sample may come than the earliest of its run did, by the rig's own clock [s]; also the longest gap of
        lost samples.
    watchdog
        How long both sides wait for one another [s].
    """

    travel: float = inf
    voltage: float = inf
    resting: float = inf
    late: float = inf
    watchdog: float = 0.1

    def __post_init__(self) -> None:
        for f in fields(self):
            if not getattr(self, f.name) > 0.0:
                raise ValueError(f"{f.name}: must be a positive number; got {getattr(self, f.name)!r}.")
        if not isfinite(self.watchdog):
            raise ValueError(f"watchdog: must be a finite time [s]; got {self.watchdog!r}.")

    def within(self, other: Limits) -> Limits:
        """Return the stricter of every two limits."""
        return Limits(**{f.name: min(getattr(self, f.name), getattr(other, f.name)) for f in fields(self)})


@dataclass(frozen=True)
class Description:
    """What a rig says of itself.

    Attributes
    ----------
    name
        At most 32 bytes of UTF-8 travel.
    period
        Of its samples [s].
    carts
        2, or 1 for a rigid drive.
    quantum
        Length of an encoder's count, cart 1 and cart 2 [mm].
    limits
        Its own; nobody can widen them.
    real_time
        Whether its clock is that on the wall, so that samples can be late; a simulation may wait for its commands.
    returns
        Whether its carts stand at rest at 0 whenever a run starts, as those of a simulation do.
    saturation
        Command at which a simulated amplifier saturates [V]; a controller's command is clipped to it, an excitation is not.
    units
        Those of its owner; everything else here is in mm, V and s.
    """

    name: str
    period: float
    carts: int = 2
    quantum: tuple[float, float] = (0.0, 0.0)
    limits: Limits = Limits()
    real_time: bool = True
    returns: bool = False
    saturation: float = inf
    units: Units = LAB


@dataclass(frozen=True, slots=True)
class Reading:
    """One sample.

    Attributes
    ----------
    sequence
        Counts from 0 within a run.
    t
        Instant by the rig's clock since the run's first sample [s].
    x1, x2
        Encoders [mm], from the rig's zero; ``x2`` is 0 for one cart.
    u
        What was put out over the period that ended now [V].
    v1, v2
        Velocities where the rig makes them itself [mm/s].
    latency
        From taking a sample to having its command, for the last command that came, by the rig's clock [s].
    """

    sequence: int
    t: float
    x1: float
    x2: float
    u: float
    v1: float | None = None
    v2: float | None = None
    latency: float | None = None


class Rig(Protocol):
    """A rig, real or simulated; one run after another."""

    @property
    def description(self) -> Description:
        """What it is."""

    def start(self, watchdog: float) -> None:
        """Begin a run: samples are taken from now on, and 0 V is put out when no command came for so long [s]."""

    def read(self, timeout: float) -> Reading:
        """Wait for the next sample.

        Raises
        ------
        RigStopped
            If none came within the timeout [s], or the rig stopped itself.
        """

    def write(self, u: float) -> None:
        """Put out a command [V] until another one comes."""

    def stop(self) -> None:
        """Put out 0 V and end the run; at any time, any number of times, without an exception."""

    def close(self) -> None:
        """Stop, and give up the connection."""
