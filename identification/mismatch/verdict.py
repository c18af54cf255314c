"""What a diagnosis says: findings with their ties, what stays unnamed, and errors on recordings that nothing was chosen by."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Literal

from flexdrive_gym import Drive
from flexdrive_gym.drive.effects import EFFECTS
from flexdrive_gym.drive.parameters import parameter
from flexdrive_gym.recording import Fault, FloatArray
from flexdrive_gym.units import LAB, Units
from identification.mismatch.homogeneity import Homogeneity
from identification.mismatch.maps import Harmonics, Located, Map
from identification.mismatch.missing_force import MissingForce
from identification.mismatch.split import Split
from identification.quantities import Quantity

SCHEMA = 2
Verdict = Literal["no_mismatch", "explained", "partly_explained", "unexplained"]
Part = Literal["estimation", "report"]


@dataclass(frozen=True)
class Estimate:
    """A parameter with its 95 % interval, which has no width where the parameter rests at a bound or was not fitted."""

    value: float
    ci95: tuple[float, float]
    unit: str

    def of_rig(self, units: Units) -> Estimate:
        """Return the estimate as the rig's owner reads it."""
        one = units.one(self.unit)
        return Estimate(self.value / one, (self.ci95[0] / one, self.ci95[1] / one), units.name(self.unit))

    def __str__(self) -> str:
        low, high = self.ci95
        width = f"[{low:.3g}, {high:.3g}]" if low < high else "(no interval)"
        return f"{self.value:.3g} {width} {'' if self.unit == '1' else self.unit}".rstrip()


@dataclass(frozen=True)
class Named:
    """An effect at a place."""

    id: str
    where: str

    def __str__(self) -> str:
        return f"{phrase(self.id)} at {self.where.replace('_', ' ')}"


@dataclass(frozen=True)
class Finding:
    """Physics that the base model lacks, named.

    Attributes
    ----------
    id, where
        Effect and place, of the catalogue.
    parameters
        Short parameter name to estimate.
    ties
        At most three explanations whose paired scores over recordings do not differ from this one's.
    separating_experiment
        What to record to tell them apart; ``None`` without ties.
    share_of_error_explained
        Of the squared error left without it, every estimation recording weighted by its own noise level.
    p_value
        How often the best of the catalogue does as well in data of this rig in which nothing is left out.
    report_rms_before, report_rms_after
        Over the report recordings [unit], with what was found before it, and with it.
    unit
        Of velocities.
    keys
        Its parameters' keys.
    drives
        The drive with this finding, and one for each tie: all fitted to the same recordings in the same round.
    """

    id: str
    where: str
    parameters: Mapping[str, Estimate]
    ties: tuple[Named, ...]
    separating_experiment: str | None
    share_of_error_explained: float
    p_value: float
    report_rms_before: float
    report_rms_after: float
    unit: str = "mm/s"
    keys: tuple[str, ...] = ()
    drives: tuple[Drive, ...] = field(default=(), repr=False, compare=False)

    def of_rig(self, units: Units) -> Finding:
        """Return the finding as the rig's owner reads it."""
        one = units.one(self.unit)
        return replace(
            self,
            parameters={name: e.of_rig(units) for name, e in self.parameters.items()},
            report_rms_before=self.report_rms_before / one,
            report_rms_after=self.report_rms_after / one,
            unit=units.name(self.unit),
            drives=tuple(d.replace(units=units) for d in self.drives),
        )

    @property
    def name(self) -> str:
        """``effect@place``."""
        return f"{self.id}@{self.where}"

    @property
    def statement(self) -> str:
        """One plain sentence: what, where, how big, how sure, what it explains."""
        sizes = ", ".join(f"{n} = {e}" for n, e in self.parameters.items())
        text = (
            f"{Named(self.id, self.where)}: {sizes}; explains {self.share_of_error_explained:.0%} of the squared error left "
            f"without it, p = {self.p_value:.2g}"
        )
        if self.ties:
            text += f"; these recordings cannot tell it from {' or '.join(str(t) for t in self.ties)}"
        return text + "."

    def as_json(self) -> dict[str, Any]:
        """Return the entry of ``diagnosis.json``."""
        return {
            "id": self.id,
            "where": self.where,
            "parameters": {
                n: {"value": e.value, "ci95": list(e.ci95), "unit": e.unit} for n, e in self.parameters.items()
            },
            "ties": [asdict(t) for t in self.ties],
            "separating_experiment": self.separating_experiment,
            "share_of_error_explained": self.share_of_error_explained,
            "false_alarm_probability": self.p_value,
            "heldout_rms_before": self.report_rms_before,
            "heldout_rms_after": self.report_rms_after,
            "unit": self.unit,
            "statement": self.statement,
        }


@dataclass(frozen=True, eq=False)
class Curve:
    """A missing force as a free function of one variable.

    Attributes
    ----------
    variable, unit
        In words, and its unit in the rig's.
    at, force, band : ndarray, shape (n,)
        Values of the variable, force and its standard error over the recordings.
    command
        Unit of the force.
    """

    variable: str
    unit: str
    at: FloatArray
    force: FloatArray
    band: FloatArray
    command: str = "V"

    def of_rig(self, units: Units) -> Curve:
        """Return the curve as the rig's owner reads it."""
        one, force = units.one(self.unit), units.one("V")
        return Curve(
            self.variable,
            units.name(self.unit),
            self.at / one,
            self.force / force,
            self.band / force,
            units.command,
        )


@dataclass(frozen=True)
class Unnamed:
    """A candidate without a name that predicts other recordings better than any name.

    Attributes
    ----------
    where, acts_on
        Cart or spring, and what the force follows.
    share_of_error
        Of the squared error.
    nearest
        Names nearest to it, with their gain over its own.
    curve
        Its shape, where it is a function of one variable.
    """

    where: str
    share_of_error: float
    acts_on: str
    nearest: tuple[tuple[str, float], ...] = ()
    curve: Curve | None = field(default=None, compare=False, repr=False)

    def as_json(self) -> dict[str, Any]:
        """Return the entry of ``diagnosis.json``."""
        near = [{"id": i, "similarity": s} for i, s in self.nearest]
        return {"where": self.where, "share_of_error": self.share_of_error, "acts_on": self.acts_on, "nearest": near}


@dataclass(frozen=True)
class RecordingFit:
    """Rms errors of one recording before and after.

    Attributes
    ----------
    recording, part
        Name, and what the recording was used for.
    before_rms, after_rms, floor_rms
        Of velocities in open loop, of positions in closed loop [unit]; the floor is nan where nothing repeats.
    unit
        ``mm/s`` or ``mm``, or the rig's.
    how
        What was simulated: ``replay`` of the command, ``in the loop``, or ``windows of … s``.
    before_position_rms, after_position_rms
        Of positions in open loop, where they were recorded.
    """

    recording: str
    part: Part
    before_rms: float
    after_rms: float
    floor_rms: float = float("nan")
    unit: str = "mm/s"
    how: str = "replay"
    before_position_rms: float | None = None
    after_position_rms: float | None = None

    @property
    def velocities(self) -> bool:
        """Whether velocities are compared."""
        return self.unit.endswith("/s")

    def of_rig(self, units: Units) -> RecordingFit:
        """Return the fit as the rig's owner reads it."""
        one, length = units.one(self.unit), units.one("mm")
        places = [None if x is None else x / length for x in (self.before_position_rms, self.after_position_rms)]
        return replace(
            self,
            before_rms=self.before_rms / one,
            after_rms=self.after_rms / one,
            floor_rms=self.floor_rms / one,
            unit=units.name(self.unit),
            before_position_rms=places[0],
            after_position_rms=places[1],
        )


@dataclass(frozen=True)
class Interval:
    """A predicted figure with its 95 % interval; ``None`` where there is no such figure, or no such limit."""

    value: float | None
    ci95: tuple[float | None, float | None] | None

    def as_json(self) -> dict[str, Any]:
        """Return the entry of ``diagnosis.json``."""
        return {"value": self.value, "ci95": None if self.ci95 is None else list(self.ci95)}


@dataclass(frozen=True)
class Prediction:
    """What the drives predict of another run of this rig, and what the rig did where it is known.

    Attributes
    ----------
    name
        For example ``critical_gain_x2_simulated``.
    before, after
        Of the base model and of the diagnosed drive [unit].
    measured
        What the recordings say of it, in words; empty where they say nothing.
    extrapolated
        Why the predicted motion leaves what was recorded, in a sentence; ``None`` where it does not.
    """

    name: str
    before: Interval
    after: Interval
    unit: str
    measured: str = ""
    extrapolated: str | None = None

    def as_json(self) -> dict[str, Any]:
        """Return the entry of ``diagnosis.json``."""
        return {
            "name": self.name,
            "before": self.before.as_json(),
            "after": self.after.as_json(),
            "unit": self.unit,
            "measured": self.measured or None,
            "extrapolated": self.extrapolated,
        }


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """Everything a diagnosis found, in the rig's units but for its drives; :meth:`as_json` is ``diagnosis.json``, schema 2.

    Attributes
    ----------
    drive, base
        The drive with all findings, and the base model: both fitted by output error to the estimation recordings alone.
    handout_tied_rms, free_rms
        Of the base model over the estimation recordings [unit], with the handout's ratios and with free ones; the former is nan
        where the ratios do not apply.
    ratios, tied
        Of the base model, with intervals; and the drive with the handout's ratios, ``None`` where they do not apply.
    before_rms, after_rms, floor_rms
        Over the report recordings in open loop, or over all where none were kept [unit].
    located, maps, harmonics
        Of the missing forces of the base model in the estimation recordings.
    forces
        These, in the engine's units.
    split
        Which recordings estimate, select and report.
    p_value
        Of the hypothesis that the base model lacks nothing: that of the best candidate in the first round.
    notes
        Sentences a reader should see.
    """

    verdict: Verdict
    faults: tuple[Fault, ...]
    located: tuple[Located, ...]
    findings: tuple[Finding, ...]
    unnamed: Unnamed | None
    handout_tied_rms: float
    free_rms: float
    ratios: Mapping[str, Quantity]
    before_rms: float
    after_rms: float
    floor_rms: float
    per_recording: tuple[RecordingFit, ...]
    homogeneity: tuple[Homogeneity, ...]
    drive: Drive
    base: Drive
    seconds: float
    split: Split
    p_value: float = float("nan")
    predictions: tuple[Prediction, ...] = ()
    unit: str = "mm/s"
    notes: tuple[str, ...] = ()
    maps: tuple[Map, ...] = ()
    harmonics: tuple[Harmonics, ...] = ()
    forces: tuple[MissingForce, ...] = ()
    tied: Drive | None = None

    def as_json(self, drive: str = "drive.toml") -> dict[str, Any]:
        """Return the object of ``diagnosis.json``; what is not a number becomes null."""
        estimation = [r.name for r in self.split.estimation]
        report = [r.name for r in (*self.split.report, *self.split.loops)]
        plain: dict[str, Any] = _clean(
            {
                "schema": SCHEMA,
                "verdict": self.verdict,
                "p_value": self.p_value,
                "faults": [
                    {k: getattr(f, k) for k in ("recording", "where", "id", "start_s", "end_s")} for f in self.faults
                ],
                "located": [asdict(p) for p in self.located],
                "findings": [f.as_json() for f in self.findings],
                "unnamed": None if self.unnamed is None else self.unnamed.as_json(),
                "baseline": {
                    "handout_tied_rms": self.handout_tied_rms,
                    "free_rms": self.free_rms,
                    "ratios": {
                        n: {"value": q.value, "ci95": list(q.ci95) if q.ci95 else None} for n, q in self.ratios.items()
                    },
                },
                "fit": {
                    "before_rms": self.before_rms,
                    "after_rms": self.after_rms,
                    "floor_rms": self.floor_rms,
                    "unit": self.unit,
                    "heldout_recordings": report,
                    "per_recording": [asdict(r) for r in self.per_recording],
                },
                "split": {"estimation": estimation, "selection": estimation, "report": report},
                "homogeneity": [h.as_json() for h in self.homogeneity],
                "predictions": [p.as_json() for p in self.predictions],
                "notes": list(self.notes),
                "drive": drive,
                "seconds": self.seconds,
            }
        )
        return plain

    def __str__(self) -> str:
        floor = (
            f"floor {self.floor_rms:.3g}"
            if math.isfinite(self.floor_rms)
            else "no floor, because no run repeats itself"
        )
        where = "report recordings" if self.split.report else "all recordings (none kept for the report)"
        lines = [
            f"verdict: {self.verdict.replace('_', ' ')}",
            f"rms error over {where}: {self.before_rms:.3g} -> {self.after_rms:.3g} {self.unit}, {floor}",
            *(f.statement for f in self.findings),
        ]
        if self.unnamed is not None:
            u = self.unnamed
            lines.append(
                f"unnamed: {u.share_of_error:.0%} of the squared error, on {u.where.replace('_', ' ')}, {u.acts_on}."
            )
        return "\n".join([*lines, *self.notes])


def _clean(value: Any) -> Any:
    """Return plain lists and numbers, null for what is not a number or infinite."""
    if isinstance(value, Mapping):
        return {k: _clean(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_clean(v) for v in value]
    if isinstance(value, float) or hasattr(value, "dtype"):
        number = float(value)
        return number if abs(number) < float("inf") else None
    return value


def phrase(id_: str) -> str:
    """Return an effect's name in words."""
    return id_.replace("_", " ")


def short(key: str) -> str:
    """Return the last part of a parameter's key."""
    return key.rsplit(".", maxsplit=1)[-1]


def unit_of(key: str) -> str:
    """Return the unit of a parameter."""
    return parameter(key).unit


def experiment_for(id_: str) -> str | None:
    """Return the experiment that separates an effect from its look-alikes; ``None`` where the catalogue knows none."""
    return next((e.separating_experiment for e in EFFECTS if e.id == id_), None) or None


def in_units(found: Diagnosis, units: Units) -> Diagnosis:
    """Return a diagnosis whose figures are in the engine's units as the rig's owner reads it."""
    if units == LAB:
        return found
    speed, unnamed = units.one("mm/s"), found.unnamed
    if unnamed is not None and unnamed.curve is not None:
        unnamed = replace(unnamed, curve=unnamed.curve.of_rig(units))
    return replace(
        found,
        findings=tuple(f.of_rig(units) for f in found.findings),
        unnamed=unnamed,
        handout_tied_rms=found.handout_tied_rms / speed,
        free_rms=found.free_rms / speed,
        before_rms=found.before_rms / speed,
        after_rms=found.after_rms / speed,
        floor_rms=found.floor_rms / speed,
        per_recording=tuple(f.of_rig(units) for f in found.per_recording),
        drive=found.drive.replace(units=units),
        base=found.base.replace(units=units),
        tied=None if found.tied is None else found.tied.replace(units=units),
        unit=units.name("mm/s"),
        maps=tuple(m.of_rig(units) for m in found.maps),
        harmonics=tuple(h.of_rig(units) for h in found.harmonics),
    )
