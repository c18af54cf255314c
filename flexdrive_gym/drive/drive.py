"""The frozen Drive: a parameter set with intervals and provenance, which can be simulated and linearised."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import inf, isfinite, log
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt

from flexdrive_gym.drive import parameters
from flexdrive_gym.drive import simulate as simulation
from flexdrive_gym.drive.controller import Controller
from flexdrive_gym.drive.linear import LinearDrive
from flexdrive_gym.recording import FloatArray, Recording
from flexdrive_gym.units import LAB, Units, in_rig_units, measured_in

# far tails are no drives: a factor between runs stays within a third to three, as parameters do
_FARTHEST = log(3.0)


def _upper(name: str) -> float:
    return parameters.parameter(name).upper


@dataclass(frozen=True)
class Provenance:
    """Where a drive's numbers come from.

    Attributes
    ----------
    method
        ``handout``, ``ml``, ``values`` or another sentence.
    recordings
        Names of the recordings it was identified from.
    version
        Version of flexdrive that made it.
    note
        Anything a reader should know.
    """

    method: str = "values"
    recordings: tuple[str, ...] = ()
    version: str = ""
    note: str = ""


@dataclass(frozen=True, eq=False)
class Covariance:
    """Joint uncertainty of identified parameters.

    Attributes
    ----------
    names
        Of the parameters.
    matrix : ndarray, shape (n, n)
        In their units, or of their logarithms where that is said.
    degrees
        Degrees of freedom of the estimate of the matrix (recordings beyond parameters); inf for a matrix that is known.
    """

    names: tuple[str, ...]
    matrix: FloatArray
    degrees: float = inf


@dataclass(frozen=True)
class Recorded:
    """How far the recordings reach that a drive was identified from; beyond it a prediction extrapolates.

    Attributes
    ----------
    u
        Largest command [V].
    v
        Largest speed of a cart [mm/s].
    deflection
        Largest deflection of the spring from the middle [mm]; 0 for one cart.
    slowest, fastest
        Frequencies that were excited [Hz].
    travel
        Longest way that a cart went, from one end to the other [mm]; 0 where it is not known.
    """

    u: float = field(metadata=measured_in("V"))
    v: float = field(metadata=measured_in("mm/s"))
    deflection: float = field(default=0.0, metadata=measured_in("mm"))
    slowest: float = field(default=0.0, metadata=measured_in("Hz"))
    fastest: float = field(default=inf, metadata=measured_in("Hz"))
    travel: float = field(default=0.0, metadata=measured_in("mm"))


@dataclass(frozen=True, eq=False)
class Drive:
    """The two-mass drive with all its effects, most of them absent.

    Parameters
    ----------
    values
        Parameter name to value in the handout's units, for example ``{"m1": 4.5e-4, "b1": 0.01, "d1": 0.35,
        "m2": 2.4e-4, "k": 0.09, "saturation.limit": 8.0}``. What is not named is at its null value. Without ``m2``
        the drive is rigid: one cart, Lab 2's model.
    intervals
        95 % confidence intervals of identified parameters.
    covariance
        Their joint uncertainty.
    provenance
        Where the numbers come from.
    name
        Title for tables and plots.
    units
        The rig's units, for everything that is printed; values here and all signals are the engine's (V, mm, s).
    run_to_run
        Covariance of the logarithms of what differs from run to run on the same rig (dry friction).
    recorded
        How far the recordings reach that it was identified from.

    Raises
    ------
    KeyError, ValueError
        For an unknown parameter or a value out of bounds.
    """

    values: Mapping[str, float]
    intervals: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    covariance: Covariance | None = None
    provenance: Provenance = field(default_factory=Provenance)
    name: str = "drive"
    units: Units = LAB
    run_to_run: Covariance | None = None
    recorded: Recorded | None = None

    def __post_init__(self) -> None:
        values = parameters.checked(self.values, self.units)
        if "m1" not in values:
            raise ValueError("m1: a drive needs the mass of cart 1; got no value. Pass m1 [V s²/mm].")
        if "m2" not in values and "k" in values:
            raise ValueError("m2: a drive with a spring needs a second mass; got k alone. Pass m2, or drop k.")
        object.__setattr__(self, "values", MappingProxyType(values))

    def __getitem__(self, name: str) -> float:
        return self.values.get(name, parameters.parameter(name).null)

    def __reduce__(self) -> tuple[Any, ...]:
        state = (dict(self.values), dict(self.intervals), self.covariance, self.provenance, self.name)
        return Drive, (*state, self.units, self.run_to_run, self.recorded)

    def __repr__(self) -> str:
        inside = ", ".join(f"{k}={v:.6g}" for k, v in self.values.items())
        return f"Drive({self.name!r}: {inside})"

    @property
    def carts(self) -> int:
        """2, or 1 for a rigid drive."""
        return 2 if np.isfinite(self["m2"]) else 1

    @property
    def linear(self) -> LinearDrive:
        """The linear part: Eq. (1) without Coulomb friction and the other effects."""
        return LinearDrive(*(self[name] for name in ("m1", "m2", "b1", "b2", "k", "C")))

    @property
    def voltage_limit(self) -> float:
        """Command limit [V]; inf where there is none."""
        return self["saturation.limit"]

    def replace(self, changes: Mapping[str, float] | None = None, **more: Any) -> Drive:
        """Return a drive with other parameter values, or other fields (``name``, ``intervals``, ...).

        Changing a value drops the intervals and the covariance of that value unless they are given too.
        """
        own = ("intervals", "covariance", "provenance", "name", "units", "run_to_run", "recorded")
        fields = {k: more.pop(k) for k in own if k in more}
        changed = {**(changes or {}), **more}
        if changed:
            fields.setdefault("intervals", {k: v for k, v in self.intervals.items() if k not in changed})
            fields.setdefault("covariance", None)
        return replace(self, values={**self.values, **changed}, **fields)

    def rescaled(self, units: Units) -> Drive:
        """Return the same physical drive on another scale: its values, intervals and covariances in the engine's new numbers.

        Parameters
        ----------
        units
            How many of the engine's units make one of the rig's on the new scale.
        """
        if units == self.units:
            return self

        def factor(name: str) -> float:
            unit = parameters.parameter(name).unit
            return units.one(unit) / self.units.one(unit)

        covariance = self.covariance
        if covariance is not None:
            sizes = np.array([factor(name) for name in covariance.names])
            covariance = replace(covariance, matrix=covariance.matrix * np.outer(sizes, sizes))
        old = self.units
        step = Units(
            per_length=old.per_length / units.per_length,
            per_command=old.per_command / units.per_command,
            per_time=old.per_time / units.per_time,
        )
        return replace(
            self,
            values={name: value * factor(name) for name, value in self.values.items()},
            intervals={name: (a * factor(name), b * factor(name)) for name, (a, b) in self.intervals.items()},
            covariance=covariance,
            recorded=in_rig_units(self.recorded, step),
            units=units,
        )

    def in_rig_units(self) -> Drive:
        """Return the drive with the numbers that the rig's owner reads, for gains and tables; what simulates takes its scale."""
        return self.rescaled(Units(self.units.length, self.units.command))

    def spring_force(self, deflection: npt.ArrayLike) -> FloatArray:
        """Return the force of the spring on cart 2 [V] where it rests at deflections x1 - x2 [mm], and has no past.

        Of the same shape as ``deflection``.
        """
        return simulation.spring_force(self.values, deflection)

    def vector(self) -> FloatArray:
        """Return the parameter vector of the compiled step, ndarray, shape (n_parameters,)."""
        return parameters.vector(self.values)

    def draw(self, rng: np.random.Generator, n: int) -> list[Drive]:
        """Draw drives as this rig may be in another run: from the identified covariance, and from what differs between runs.

        Parameters are jointly normal around this drive, with Student's t for a covariance of finite degrees of freedom; what
        differs from run to run is a factor of its own on top.

        Parameters
        ----------
        rng
            Source of the draws; the same state gives the same drives.
        n
            How many.

        Returns
        -------
        list of Drive
            Without intervals and covariance. Far tails are no drives: every value stays within a third to three times its own
            and within its bounds.

        Raises
        ------
        ValueError
            If the drive has no covariance.
        """
        if self.covariance is None:
            raise ValueError(
                f"covariance: drawing needs a drive with a covariance; got {self.name!r} without one. Use the drive.toml of "
                "'flexdrive identify --method ml'."
            )
        names = self.covariance.names
        values, specs = np.array([self[n] for n in names]), [parameters.parameter(n) for n in names]
        drawn = rng.multivariate_normal(values, self.covariance.matrix, size=n, method="eigh")
        if isfinite(self.covariance.degrees):
            widened = np.sqrt(self.covariance.degrees / rng.chisquare(self.covariance.degrees, size=n))
            drawn = values + (drawn - values) * widened[:, None]
        least, most = np.minimum(values / 3.0, 3.0 * values), np.maximum(values / 3.0, 3.0 * values)
        low = np.maximum([s.lower for s in specs], least)
        drawn = np.clip(drawn, low, np.maximum(low, np.minimum([s.upper for s in specs], most)))
        changes = [dict(zip(names, map(float, row), strict=True)) for row in drawn]
        for own, factors in zip(changes, self._factors(rng, n), strict=True):
            own.update(
                {name: min(factor * own.get(name, self[name]), _upper(name)) for name, factor in factors.items()}
            )
        return [
            self.replace(own, intervals={}, run_to_run=None, name=f"{self.name}, draw {i + 1}")
            for i, own in enumerate(changes)
        ]

    def _factors(self, rng: np.random.Generator, n: int) -> list[dict[str, float]]:
        """Draw the factors that parameters have in each of n runs."""
        spread = self.run_to_run
        if spread is None:
            return [{} for _ in range(n)]
        logs = rng.multivariate_normal(np.zeros(len(spread.names)), spread.matrix, size=n, method="eigh")
        factors = np.exp(np.clip(logs, -_FARTHEST, _FARTHEST))
        return [dict(zip(spread.names, map(float, row), strict=True)) for row in factors]

    def simulate(
        self,
        t: npt.ArrayLike,
        u: npt.ArrayLike,
        *,
        start: npt.ArrayLike = (0.0, 0.0, 0.0, 0.0),
        physics_step: float = 1e-3,
        travel_limit: float = inf,
        name: str = "simulation",
    ) -> Recording:
        """Drive open loop with a recorded or generated command.

        Parameters
        ----------
        t : array_like, shape (n,)
            Uniform sample instants [s].
        u : array_like, shape (n,)
            Command [V], held over each sample.
        start : array_like, shape (4,)
            x1 [mm], v1 [mm/s], x2 [mm], v2 [mm/s] at ``t[0]``.
        physics_step
            Longest step of the integration [s].
        travel_limit
            The run ends when a cart is farther than this from x = 0 [mm], as the STOP button ends it on the rig.
        name
            Name of the recording.

        Returns
        -------
        Recording
            With x1, x2, v1, v2 as the drive's encoders and velocity processing report them.
        """
        times, commands = simulation.uniform(t, u, "u")
        run = simulation.open_loop(self.values, times, commands, start, physics_step, travel_limit, name)
        return run if self.units.lab else replace(run, units=self.units)

    def simulate_closed_loop(
        self,
        t: npt.ArrayLike,
        reference: npt.ArrayLike,
        controller: Controller,
        *,
        start: npt.ArrayLike = (0.0, 0.0, 0.0, 0.0),
        physics_step: float = 1e-3,
        travel_limit: float = inf,
        name: str = "simulation",
    ) -> Recording:
        """Close the loop at every instant of ``t``.

        Parameters
        ----------
        t : array_like, shape (n,)
            Uniform sample instants [s]; their step is the control period.
        reference : array_like, shape (n,)
            xr [mm].
        controller
            Called with an :class:`~flexdrive_gym.drive.controller.Observation`, returns the command [V]; limited to
            the drive's saturation. A :class:`~flexdrive_gym.drive.p_control.PControl` or
            :class:`~flexdrive_gym.drive.linear_controller.LinearController` of this period runs in the compiled loop.
        start, physics_step, travel_limit, name
            As in :meth:`simulate`.

        Returns
        -------
        Recording
            With xr, u, x1, x2, v1, v2.
        """
        times, xr = simulation.uniform(t, reference, "reference")
        run = simulation.closed_loop(self.values, times, xr, controller, start, physics_step, travel_limit, name)
        return run if self.units.lab else replace(run, units=self.units)
