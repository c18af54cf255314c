"""What a diagnosis says: findings with their ties, what stays unnamed, and errors on recordings that nothing was chosen by."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

from flexdrive_gym import Drive
from flexdrive_gym.recording import Fault
from identification.diagnosis.homogeneity import Homogeneity

SCHEMA = 2
Verdict = Literal["no_mismatch", "explained", "partly_explained", "unexplained"]


@dataclass(frozen=True)
class Estimate:
    """A parameter with its 95 % interval."""

    value: float
    ci95: tuple[float, float]
    unit: str

    def __str__(self) -> str:
        return f"{self.value:.3g} [{self.ci95[0]:.3g}, {self.ci95[1]:.3g}] {self.unit}"


@dataclass(frozen=True)
class Named:
    """An effect at a place."""

    id: str
    where: str

    def __str__(self) -> str:
        return f"{self.id.replace('_', ' ')} at {self.where.replace('_', ' ')}"


@dataclass(frozen=True)
class Finding:
    """Physics that the base model lacks, named.

    Attributes
    ----------
    effect
        What and where.
    parameters
        Short parameter name to estimate.
    ties
        At most three explanations whose paired scores over recordings do not differ from this one's.
    separating_experiment
        What to record to tell them apart; ``None`` without ties.
    share_of_error_explained
        Of the squared error, every estimation recording weighted by its own noise level.
    p_value
        How often the best of the catalogue does as well in data of this rig in which nothing is left out.
    report_rms_before, report_rms_after
        Over the report recordings [unit], without and with it.
    """

    effect: Named
    parameters: Mapping[str, Estimate]
    ties: tuple[Named, ...]
    separating_experiment: str | None
    share_of_error_explained: float
    p_value: float
    report_rms_before: float
    report_rms_after: float

    @property
    def statement(self) -> str:
        """One plain sentence: what, where, how big, how sure, what it explains."""
        sizes = ", ".join(f"{n} = {e}" for n, e in self.parameters.items())
        text = (
            f"{self.effect}: {sizes}; explains {self.share_of_error_explained:.0%} of the squared error left without it, "
            f"p = {self.p_value:.2g}"
        )
        if self.ties:
            text += f"; these recordings cannot tell it from {' or '.join(str(t) for t in self.ties)}"
        return text + "."

    def as_json(self, unit: str) -> dict[str, Any]:
        """Return the entry of ``diagnosis.json``."""
        return {
            "id": self.effect.id,
            "where": self.effect.where,
            "parameters": {
                n: {"value": e.value, "ci95": list(e.ci95), "unit": e.unit} for n, e in self.parameters.items()
            },
            "ties": [asdict(t) for t in self.ties],
            "separating_experiment": self.separating_experiment,
            "share_of_error_explained": self.share_of_error_explained,
            "false_alarm_probability": self.p_value,
            "heldout_rms_before": self.report_rms_before,
            "heldout_rms_after": self.report_rms_after,
            "unit": unit,
            "statement": self.statement,
        }


@dataclass(frozen=True)
class Unnamed:
    """A free function that predicts other recordings better than any name."""

    where: str
    share_of_error: float
    acts_on: str
    nearest: tuple[tuple[str, float], ...] = ()

    def as_json(self) -> dict[str, Any]:
        """Return the entry of ``diagnosis.json``."""
        near = [{"id": i, "similarity": s} for i, s in self.nearest]
        return {"where": self.where, "share_of_error": self.share_of_error, "acts_on": self.acts_on, "nearest": near}


@dataclass(frozen=True)
class RecordingFit:
    """Rms errors of one recording before and after, of velocities [mm/s] and, where positions were recorded, of those [mm]."""

    recording: str
    part: Literal["estimation", "report"]
    before_rms: float
    after_rms: float
    floor_rms: float
    before_position_rms: float | None = None
    after_position_rms: float | None = None


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """Everything a diagnosis found; :meth:`as_json` is ``diagnosis.json``, schema 2.

    Attributes
    ----------
    drive, base
        The drive with all findings, and the base model's fit.
    before_rms, after_rms, floor_rms
        Over the report recordings, or over all where none were kept [mm/s].
    notes
        Sentences a reader should see.
    """

    verdict: Verdict
    faults: tuple[Fault, ...]
    findings: tuple[Finding, ...]
    unnamed: Unnamed | None
    before_rms: float
    after_rms: float
    floor_rms: float
    per_recording: tuple[RecordingFit, ...]
    homogeneity: tuple[Homogeneity, ...]
    drive: Drive
    base: Drive
    seconds: float
    unit: str = "mm/s"
    notes: tuple[str, ...] = ()
    split: Mapping[str, Sequence[str]] = field(default_factory=dict)

    def as_json(self, drive: str = "drive.toml") -> dict[str, Any]:
        """Return the object of ``diagnosis.json``; what is not a number becomes null."""
        faults = [{k: getattr(f, k) for k in ("recording", "where", "id", "start_s", "end_s")} for f in self.faults]
        plain: dict[str, Any] = _clean(
            {
                "schema": SCHEMA,
                "verdict": self.verdict,
                "faults": faults,
                "findings": [f.as_json(self.unit) for f in self.findings],
                "unnamed": None if self.unnamed is None else self.unnamed.as_json(),
                "fit": {
                    "before_rms": self.before_rms,
                    "after_rms": self.after_rms,
                    "floor_rms": self.floor_rms,
                    "unit": self.unit,
                    "per_recording": [asdict(r) for r in self.per_recording],
                },
                "split": {part: list(names) for part, names in self.split.items()},
                "homogeneity": [h.as_json() for h in self.homogeneity],
                "predictions": [],
                "notes": list(self.notes),
                "drive": drive,
                "seconds": self.seconds,
            }
        )
        return plain

    def __str__(self) -> str:
        lines = [
            f"verdict: {self.verdict.replace('_', ' ')}",
            f"rms over report recordings: {self.before_rms:.3g} -> {self.after_rms:.3g} {self.unit}, floor {self.floor_rms:.3g}",
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
