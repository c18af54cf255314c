"""What a rig, real or simulated, leaves behind: sampled signals with units and provenance.

A :class:`Recording` is the one currency between rig, simulation, identification and reports. All lengths are
in mm, times in s, velocities in mm/s and commands in V, whatever units the file had; for a rig that is measured in other
units ``units`` says how these numbers read there.

Two conventions matter at 1 kHz and are the rig's own:

* ``u[n]`` is held from ``t[n]`` until ``t[n+1]`` (zero-order hold), unless the recording says that a continuous command
  was sampled;
* ``v[n]`` is made from the encoder readings at ``t[n]`` and before, so the raw difference is
  ``v[n] = (x[n] - x[n-1]) / Ts``.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from datetime import datetime
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np
import numpy.typing as npt

from flexdrive_gym.units import LAB, Units

if TYPE_CHECKING:
    from collections.abc import Iterator

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
Channel = Literal["x1", "x2", "v1", "v2"]
Hold = Literal["zero", "band_limited"]
Kind = Literal["square", "sine", "closed_loop", "other"]

CHANNELS: tuple[Channel, ...] = ("x1", "x2", "v1", "v2")


@dataclass(frozen=True)
class Excitation:
    """What drove the rig, as recognised from the data (never from a file name).

    Attributes
    ----------
    kind
        ``square``, ``sine``, ``closed_loop`` or ``other``.
    amplitude
        Of the command [V]; for ``closed_loop`` the largest excursion of the reference from its start [mm]; 0 where
        unknown.
    frequency
        Of the command or of the repeating reference [Hz]; 0 where it does not repeat.
    feedback
        For ``closed_loop``: the fed-back position, ``x1`` or ``x2``.
    gain
        For ``closed_loop``: Kp [V/mm] estimated from u and xr - x.
    limit
        Largest |u| where u rests against a limit [V], else ``None``.
    """

    kind: Kind
    amplitude: float = 0.0
    frequency: float = 0.0
    feedback: Literal["x1", "x2"] | None = None
    gain: float | None = None
    limit: float | None = None

    def text(self, units: Units = LAB) -> str:
        """Return what drove the run in words, figures in the rig's units."""
        if self.kind == "closed_loop" and self.gain is None:
            return "closed loop, controller not recognised"
        if self.kind == "closed_loop" and self.gain is not None:
            return f"P-control from {self.feedback}, Kp = {units.text(self.gain, 'V/mm')}"
        if self.kind == "other":
            return "other excitation"
        return f"{self.kind} ±{units.text(self.amplitude, 'V', 3)}, {units.text(self.frequency, 'Hz', 3)}"

    def __str__(self) -> str:
        return self.text()


@dataclass(frozen=True)
class Fault:
    """A data fault, not physics: reported, masked, never fitted.

    ``start_s`` and ``end_s`` are the first and last faulty instants [s].
    """

    recording: str
    where: Literal["encoder_1", "encoder_2", "actuator", "recording"]
    id: str
    start_s: float
    end_s: float
    note: str = ""


@dataclass(frozen=True, eq=False)
class Recording:
    """One run of the drive.

    Attributes
    ----------
    name
        Short name, unique in a data set.
    t, u
        Time [s] and command [V], ndarray, shape (n,).
    x1, x2
        Cart positions [mm], ndarray, shape (n,), or ``None`` where not recorded.
    v1, v2
        Cart velocities [mm/s], ndarray, shape (n,), or ``None``.
    xr
        Reference position [mm], ndarray, shape (n,), or ``None`` for open-loop runs.
    quantum
        Encoder counts of cart 1 and cart 2 [mm]; 0 where the channel shows none.
    velocity_cutoff
        How velocity was made from position: 0 for the raw backward difference, a cut-off [Hz] for a first-order
        filtered derivative, ``None`` where that is unknown (then it is treated as the raw difference).
    excitation
        What drove the run.
    faults
        Sensor and data faults found in it.
    notes
        Named warnings met while reading, for example jitter.
    source
        File it came from, or how it was simulated.
    hold
        What the command did between samples: ``zero`` where it was held, ``band_limited`` where it is the samples of a
        continuous signal without content above half the sampling rate.
    units
        The rig's units, for everything that is printed.
    recorded
        When the run was recorded, where its file says so.
    session
        Which session it belongs to, such as a date or a folder; empty where nothing tells.
    held
        Carts that were held in place (1, 2): the other one moves on the spring alone.
    """

    name: str
    t: FloatArray
    u: FloatArray
    x1: FloatArray | None = None
    x2: FloatArray | None = None
    v1: FloatArray | None = None
    v2: FloatArray | None = None
    xr: FloatArray | None = None
    quantum: tuple[float, float] = (0.0, 0.0)
    velocity_cutoff: float | None = 0.0
    excitation: Excitation = field(default_factory=lambda: Excitation("other"))
    faults: tuple[Fault, ...] = ()
    notes: tuple[str, ...] = ()
    source: str = ""
    hold: Hold = "zero"
    units: Units = LAB
    recorded: datetime | None = None
    session: str = ""
    held: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        n = len(self.t)
        for name in ("u", *CHANNELS, "xr"):
            values = getattr(self, name)
            if values is not None and np.shape(values) != (n,):
                raise ValueError(
                    f"{name}: must have the shape of t, ({n},); got {np.shape(values)}. "
                    "Pass one value of each channel per sample."
                )

    @property
    def n(self) -> int:
        """Number of samples."""
        return len(self.t)

    @cached_property
    def sample_time(self) -> float:
        """Sampling period Ts [s], the median step of ``t``."""
        return float(np.median(np.diff(self.t)))

    @property
    def closed_loop(self) -> bool:
        """Whether the command was made by feedback."""
        return self.excitation.kind == "closed_loop"

    def in_rig_units(self) -> Recording:
        """Return the recording with the numbers that the rig's owner reads, for plots and tables; no model runs on it."""
        return self.rescaled(Units(self.units.length, self.units.command))

    def rescaled(self, units: Units) -> Recording:
        """Return the same recording on another scale: its signals in the engine's new numbers.

        Parameters
        ----------
        units
            How many of the engine's units make one of the rig's on the new scale.
        """
        if units == self.units:
            return self

        def one(unit: str) -> float:
            return self.units.one(unit) / units.one(unit)

        length, speed, command, time = one("mm"), one("mm/s"), one("V"), one("s")
        scaled = {
            name: values / (speed if name[0] == "v" else length)
            for name in (*CHANNELS, "xr")
            if (values := getattr(self, name)) is not None
        }
        drove = replace(
            self.excitation,
            amplitude=self.excitation.amplitude / (length if self.closed_loop else command),
            frequency=self.excitation.frequency / one("Hz"),
            gain=None if self.excitation.gain is None else self.excitation.gain / one("V/mm"),
            limit=None if self.excitation.limit is None else self.excitation.limit / command,
        )
        return replace(
            self,
            t=self.t / time,
            u=self.u / command,
            **scaled,
            quantum=(self.quantum[0] / length, self.quantum[1] / length),
            velocity_cutoff=self.velocity_cutoff and self.velocity_cutoff / one("Hz"),
            excitation=drove,
            faults=tuple(replace(f, start_s=f.start_s / time, end_s=f.end_s / time) for f in self.faults),
            units=units,
        )

    def channels(self) -> Iterator[tuple[Channel, FloatArray]]:
        """Yield the measured channels that are present, in the order x1, x2, v1, v2."""
        for name in CHANNELS:
            values = getattr(self, name)
            if values is not None:
                yield name, values

    def valid(self, channel: Channel) -> BoolArray:
        """Return which samples of a channel no fault touches.

        Returns
        -------
        ndarray of bool, shape (n,)
        """
        ok = np.ones(self.n, dtype=np.bool_)
        where = f"encoder_{channel[1]}"
        half = 0.5 * self.sample_time
        for fault in self.faults:
            if fault.where in (where, "recording"):
                ok &= ~((self.t >= fault.start_s - half) & (self.t <= fault.end_s + half))
        return ok
