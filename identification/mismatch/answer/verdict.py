"""What a diagnosis says: its findings, what they predict, and errors on recordings that nothing was chosen by."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

from flexdrive_gym import Drive
from flexdrive_gym.recording import Fault
from flexdrive_gym.units import LAB, Units
from identification.mismatch.answer.finding import Finding, Unnamed, percent
from identification.mismatch.answer.homogeneity import Homogeneity
from identification.mismatch.force.maps import Harmonics, Located, Map
from identification.mismatch.force.missing_force import MissingForce
from identification.mismatch.selection.detection import DetectionLimit
from identification.mismatch.split import Split
from identification.quantities import Quantity

SCHEMA = 2
Verdict = Literal["no_mismatch", "explained", "partly_explained", "unexplained"]
Part = Literal["estimation", "report"]


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
    detection_limits
        Below which size these recordings do not show what is not named.
    notes
        Sentences a reader should see.
    ended
        Whether nothing was left to name when the search ended; otherwise it had come to the most rounds that it may have.
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
    detection_limits: tuple[DetectionLimit, ...] = ()
    unit: str = "mm/s"
    notes: tuple[str, ...] = ()
    maps: tuple[Map, ...] = ()
    harmonics: tuple[Harmonics, ...] = ()
    forces: tuple[MissingForce, ...] = ()
    tied: Drive | None = None
    ended: bool = True

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
                "detection_limits": [limit.as_json() for limit in self.detection_limits],
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
                f"unnamed: {percent(u.share_of_error)} of the squared error, on {u.where.replace('_', ' ')}, {u.acts_on}."
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
        detection_limits=tuple(limit.of_rig(units) for limit in found.detection_limits),
        unit=units.name("mm/s"),
        maps=tuple(m.of_rig(units) for m in found.maps),
        harmonics=tuple(h.of_rig(units) for h in found.harmonics),
    )
