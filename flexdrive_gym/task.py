"""What an environment is about, checked once: drive, reference, limits, sensing, reward.

A :class:`Task` turns the arguments of ``gymnasium.make`` into the numbers that the kernels read; the single and the batched
environment are made from the same task.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from math import inf, isfinite
from pathlib import Path
from typing import Any, Literal

import numpy as np

from flexdrive_gym.checks import as_mapping, check_member, check_positive, did_you_mean, is_number
from flexdrive_gym.drive import parameters
from flexdrive_gym.drive.default import DEFAULT_DRIVE, HANDOUT_LIMIT_V
from flexdrive_gym.drive.drive import Drive
from flexdrive_gym.drive.toml import load_drive
from flexdrive_gym.recording import FloatArray
from flexdrive_gym.references import is_random, sample_reference

Sensing = Literal["collocated", "non_collocated", "full_state"]
SENSINGS: dict[str, int] = {"collocated": 1, "non_collocated": 2, "full_state": 3}

# a raw difference over one control period is coarse; this is what a student's derivative filter does
DEFAULT_VELOCITY_CUTOFF_HZ = 30.0
DEFAULT_REWARD: dict[str, float] = {"tracking": 1.0, "effort": 0.01, "rate": 0.01, "failure": 100.0}
ERROR_SCALE_MM = 10.0
RANDOM_REFERENCES = 64
MOST_LATE = 16


@dataclass(frozen=True, eq=False)
class Randomisation:
    """How parameters are drawn at every reset.

    Attributes
    ----------
    names
        Of the parameters.
    low, high : ndarray, shape (n,)
        Bounds in the parameters' units.
    factor : ndarray, shape (n, n) or (0, 0)
        Cholesky factor of a joint normal distribution around the drive's values; empty for uniform draws.
    """

    names: tuple[str, ...] = ()
    low: FloatArray = field(default_factory=lambda: np.zeros(0))
    high: FloatArray = field(default_factory=lambda: np.zeros(0))
    factor: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))


@dataclass(frozen=True, eq=False)
class Task:
    """The arguments of an environment.

    Parameters
    ----------
    sensing
        Which encoders the controller sees: ``collocated`` (x1), ``non_collocated`` (x2) or ``full_state`` (both).
    drive
        A :class:`~flexdrive_gym.Drive`, the path of a ``drive.toml``, or ``None`` for the documented default.
    reference
        Name in :data:`~flexdrive_gym.references.REFERENCES`, ``"name:keyword=value:…"``, (name, arguments), array at control
        periods, or function of time [mm].
    control_period
        Time for which an action is held [s]; a whole number of physics steps.
    physics_step
        Longest step of the simulation [s].
    duration
        Time limit of an episode [s].
    travel_limit
        Largest distance of a cart from x = 0 [mm]; beyond it the episode terminates.
    stroke_limit
        Largest deflection x1 - x2 of the spring either way [mm]; beyond it the episode terminates.
    voltage_limit
        Command at action 1 [V]; ``None``: the drive's own limit, or 8 V.
    preview
        How far ahead of now the controller sees the reference [s].
    reward
        Weights of ``tracking`` ((e/10 mm)², e = xr - x2), ``effort`` ((u/limit)²), ``rate`` ((Δu/limit)²) and
        ``failure`` (once, on termination); all are subtracted.
    randomise
        ``None``; ``"identified"`` for the drive's identified covariance; or parameter names with (low, high).
    effects
        Parameters to change in the drive, for example ``{"input_delay.tau": 0.002}``.
    quantum
        Encoder count [mm]; ``None``: the drive's.
    noise
        Rms of additional position noise [mm].
    velocity_cutoff
        Cut-off of the velocity filter [Hz]; ``None``: the drive's, or 30 Hz; 0: raw difference.
    sensor_delay
        Age of what the controller sees [s]; whole control periods.
    normalise
        Scale every entry of the observation to -1 … 1 by its bound.
    """

    sensing: Sensing
    drive: Drive | str | Path | None = None
    reference: Any = "handout"
    control_period: float = 5e-3
    physics_step: float = 1e-3
    duration: float = 4.0
    travel_limit: float = 250.0
    stroke_limit: float = 100.0
    voltage_limit: float | None = None
    preview: Iterable[float] = (0.02, 0.05, 0.1)
    reward: Mapping[str, float] | None = None
    randomise: str | Mapping[str, tuple[float, float]] | None = None
    effects: Mapping[str, float] | None = None
    quantum: float | None = None
    noise: float = 0.0
    velocity_cutoff: float | None = None
    sensor_delay: float = 0.0
    normalise: bool = False

    def __post_init__(self) -> None:
        check_member("sensing", self.sensing, SENSINGS)
        for name in ("control_period", "physics_step", "duration", "travel_limit", "stroke_limit"):
            check_positive(name, getattr(self, name))
        if self.voltage_limit is not None:
            check_positive("voltage_limit", self.voltage_limit)
        for name in ("noise", "quantum", "velocity_cutoff", "sensor_delay"):
            value = getattr(self, name)
            if value is not None and not (is_number(value) and 0.0 <= value < inf):
                raise ValueError(f"{name}: must be a number of at least 0; got {value!r}.")
        ratio = self.control_period / self.physics_step
        if abs(ratio - round(ratio)) > 1e-6 * ratio or round(ratio) < 1:
            raise ValueError(
                f"physics_step: the control period must be a whole number of physics steps; got {self.control_period:g} s "
                f"over {self.physics_step:g} s. Use {self.control_period / max(1, round(ratio)):g} s."
            )
        late = self.sensor_delay / self.control_period
        if abs(late - round(late)) > 1e-6 * max(late, 1.0) or late > MOST_LATE:
            raise ValueError(
                f"sensor_delay: must be a whole number of control periods, at most {MOST_LATE}; got {self.sensor_delay:g} s over "
                f"{self.control_period:g} s. Use {min(MOST_LATE, round(late)) * self.control_period:g} s."
            )
        if self.duration < self.control_period:
            raise ValueError(f"duration: must be at least one control period; got {self.duration:g} s.")
        given: Any = self.preview
        single = isinstance(given, str | bytes | Mapping) or not isinstance(given, Iterable)
        if single or (isinstance(given, np.ndarray) and given.ndim != 1):
            raise TypeError(
                f"preview: must be a list of times ahead [s], () for none; got {given!r}. Try preview=(0.02, 0.05)."
            )
        object.__setattr__(self, "preview", tuple(given))
        if not all(is_number(a) and 0.0 <= a <= 10.0 for a in self.preview):
            raise ValueError(f"preview: must be times ahead between 0 and 10 s; got {self.preview!r}.")
        object.__setattr__(self, "rig", self._rig())
        object.__setattr__(self, "weights", self._weights())
        parameters.check_delays(self.rig.values, self.control_period)
        object.__setattr__(self, "randomisation", self._randomisation())
        object.__setattr__(self, "references", self._references())

    rig: Drive = field(init=False, repr=False)
    weights: dict[str, float] = field(init=False, repr=False)
    randomisation: Randomisation = field(init=False, repr=False)
    references: FloatArray = field(init=False, repr=False)

    @property
    def horizon(self) -> int:
        """Time limit in control periods."""
        return round(self.duration / self.control_period)

    @property
    def voltage(self) -> float:
        """Command at action 1 [V]."""
        if self.voltage_limit is not None:
            return self.voltage_limit
        own = self.rig.voltage_limit
        return own if isfinite(own) else HANDOUT_LIMIT_V

    @property
    def preview_periods(self) -> np.ndarray:
        """Preview in control periods, ndarray of int."""
        return np.array([round(a / self.control_period) for a in self.preview], dtype=np.int64)

    @property
    def late(self) -> int:
        """Age of what the controller sees, in control periods."""
        return round(self.sensor_delay / self.control_period)

    @property
    def substeps(self) -> int:
        """Physics steps per control period, refined where an effect is fast."""
        drawn = self.randomisation
        corners = [dict(zip(drawn.names, bounds, strict=True)) for bounds in (drawn.low, drawn.high) if drawn.names]
        return max(
            parameters.substeps({**self.rig.values, **corner}, self.control_period, self.physics_step)
            for corner in [{}, *corners]
        )

    def names(self) -> list[tuple[str, str, float]]:
        """Return name, unit and bound of every entry of the observation."""
        position, speed = 2.0 * self.travel_limit, 4.0 * self.top_speed
        carts = {1: ("x1",), 2: ("x2",), 3: ("x1", "x2")}[SENSINGS[self.sensing]]
        entries = [e for x in carts for e in ((x, "mm", position), (f"v{x[1]}", "mm/s", speed))]
        seen = "x1" if self.sensing == "collocated" else "x2"
        entries += [(f"xr - {seen}", "mm", 2.0 * position), ("xr", "mm", position), ("last u", "V", self.voltage)]
        return entries + [(f"xr in {a:g} s", "mm", position) for a in self.preview]

    @property
    def top_speed(self) -> float:
        """Steady velocity at the largest command without friction [mm/s]; at least 100."""
        damping = self.rig["b1"] + (self.rig["b2"] if self.rig.carts == 2 else 0.0)
        return max(100.0, self.voltage / max(damping, 1e-3))

    def _rig(self) -> Drive:
        if self.drive is None:
            rig = DEFAULT_DRIVE
        elif isinstance(self.drive, Drive):
            rig = self.drive
        elif isinstance(self.drive, str | Path):
            rig = load_drive(self.drive)
        else:
            raise TypeError(f"drive: must be a Drive or the path of a drive.toml; got {type(self.drive).__name__}.")
        changes = as_mapping("effects", self.effects, "{'input_delay.tau': 0.002}")
        for i in range(1, rig.carts + 1):
            if self.quantum is not None:
                changes[f"encoder_quantisation.encoder_{i}.quantum"] = self.quantum
            key = f"velocity_processing.encoder_{i}.cutoff"
            if self.velocity_cutoff is not None:
                changes[key] = self.velocity_cutoff
            elif key not in rig.values and key not in changes:
                changes[key] = DEFAULT_VELOCITY_CUTOFF_HZ
        if rig.carts == 1 and self.sensing != "collocated":
            raise ValueError(f"drive: {self.sensing} needs two carts; got a rigid drive. Use FlexDrive-Collocated-v0.")
        try:
            return rig.replace(changes, intervals=rig.intervals, covariance=rig.covariance)
        except (KeyError, ValueError) as error:
            raise ValueError(f"effects: {error.args[0]}") from error

    def _weights(self) -> dict[str, float]:
        given = as_mapping("reward", self.reward, "{'effort': 0.1}")
        for name, value in given.items():
            check_member("reward", name, DEFAULT_REWARD)
            if not is_number(value) or not 0.0 <= value < inf:
                raise ValueError(f"reward: the weight of {name} must be a number of at least 0; got {value!r}.")
        return {**DEFAULT_REWARD, **{k: float(v) for k, v in given.items()}}

    def _randomisation(self) -> Randomisation:
        if self.randomise is None:
            return Randomisation()
        if isinstance(self.randomise, str):
            return self._identified()
        ranges = as_mapping("randomise", self.randomise, "'identified' or {'m1': (6e-4, 9e-4)}")
        names = tuple(ranges)
        for name, bounds in ranges.items():
            spec = _specification("randomise", name)
            listed = isinstance(bounds, tuple | list) or (isinstance(bounds, np.ndarray) and bounds.ndim == 1)
            pair = listed and len(bounds) == 2 and all(map(is_number, bounds))
            if not pair or not spec.lower <= bounds[0] <= bounds[1] <= spec.upper:
                raise ValueError(
                    f"randomise: {name} must be (low, high) within [{spec.lower:g}, {spec.upper:g}] {spec.unit}; got {bounds!r}."
                )
            if (self.rig.carts == 1) and name in {"m2", "b2", "d2", "k", "C"}:
                raise ValueError(f"randomise: a rigid drive has no {name}.")
        low, high = (np.array([ranges[n][i] for n in names], dtype=np.float64) for i in (0, 1))
        return Randomisation(names, low, high)

    def _identified(self) -> Randomisation:
        covariance = self.rig.covariance
        if self.randomise != "identified":
            raise ValueError(f"randomise: must be None, 'identified' or a mapping; got {self.randomise!r}.")
        if covariance is None:
            raise ValueError(
                "randomise: 'identified' needs a drive with a covariance; got one without. Use the drive.toml of "
                "'flexdrive identify --method ml', or give ranges."
            )
        values = np.array([self.rig[n] for n in covariance.names])
        eigenvalues, vectors = np.linalg.eigh(covariance.matrix)
        # QR of the symmetric root is a Cholesky factor that a parameter without variance does not upset
        root = (vectors * np.sqrt(np.maximum(eigenvalues, 0.0))).T
        factor = np.transpose(np.asarray(np.linalg.qr(root, mode="r")))
        specs = [parameters.parameter(n) for n in covariance.names]
        # far tails of a wide normal distribution are no drives: stay within a third to three times the value
        low = np.maximum([s.lower for s in specs], np.minimum(values / 3.0, values * 3.0))
        high = np.minimum([s.upper for s in specs], np.maximum(values / 3.0, values * 3.0))
        high = np.where(values == 0.0, 1e-9, high)
        return Randomisation(covariance.names, low, high, np.ascontiguousarray(factor))

    def _references(self) -> FloatArray:
        longest = int(self.preview_periods.max(initial=0))
        t = np.arange(self.horizon + longest + 2) * self.control_period
        rows = RANDOM_REFERENCES if is_random(self.reference) else 1
        rng = np.random.default_rng(0)  # the pool is part of the task; which row an episode takes comes from its seed
        table = np.ascontiguousarray([sample_reference(self.reference, t, rng) for _ in range(rows)])
        peak = float(np.max(np.abs(table)))
        if peak > self.travel_limit:
            raise ValueError(
                f"reference: must stay within the travel of ±{self.travel_limit:g} mm; got {peak:g} mm. Raise travel_limit or "
                "lower the reference."
            )
        return table


def check_arguments(given: Iterable[str], own: Iterable[str]) -> None:
    """Refuse arguments that neither a :class:`Task` nor the environment itself (its ``own``) has, with the nearest name."""
    known = [*(f.name for f in fields(Task) if f.init), *own]
    for name in given:
        if name not in known:
            raise TypeError(
                f"{name}: the environment has no such argument; it has {', '.join(known)}.{did_you_mean(name, known)}"
            )


def _specification(argument: str, name: str) -> Any:
    try:
        return parameters.parameter(name)
    except KeyError as error:
        raise ValueError(f"{argument}: {error.args[0]}") from error
