"""What a diagnosis says: findings, ties, what stays unnamed, and the figures that prove it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from flexdrive_gym import Drive
from flexdrive_gym.drive.effects import EFFECTS
from flexdrive_gym.drive.parameters import parameter
from flexdrive_gym.recording import Fault, FloatArray
from flexdrive_gym.units import LAB, Units
from identification.diagnosis.maps import Harmonics, Map
from identification.diagnosis.missing_force import MissingForce
from identification.mismatch.split import Split
from identification.quantities import Quantity

SCHEMA = 1
Verdict = Literal["no_mismatch", "explained", "partly_explained", "unexplained"]


@dataclass(frozen=True)
class Estimate:
    """A parameter with its 95 % interval."""

    value: float
    ci95: tuple[float, float]
    unit: str

    def of_rig(self, units: Units) -> Estimate:
        """Return the estimate as the rig's owner reads it."""
        one = units.one(self.unit)
        return Estimate(self.value / one, (self.ci95[0] / one, self.ci95[1] / one), units.name(self.unit))

    def __str__(self) -> str:
        return f"{self.value:.3g} [{self.ci95[0]:.3g}, {self.ci95[1]:.3g}] {self.unit}"


@dataclass(frozen=True)
class Named:
    """An effect at a place."""

    id: str
    where: str


@dataclass(frozen=True)
class Finding:
    """Physics that was left out, named.

    Attributes
    ----------
    parameters
        Short parameter name to estimate.
    ties
        At most three explanations that the data cannot tell from this one.
    separating_experiment
        What to record to tell them apart; ``None`` without ties.
    share_of_error_explained
        Share of the squared error that adding the effect to all others removes, in the recordings learnt from.
    false_alarm_probability
        Chance that an error of the same colour, unrelated to the catalogue, would be explained as well.
    heldout_rms_before, heldout_rms_after
        Over the recordings kept away [unit]: with all other findings, and with this one too.
    statement
        One plain sentence.
    """

    id: str
    where: str
    parameters: Mapping[str, Estimate]
    ties: tuple[Named, ...]
    separating_experiment: str | None
    share_of_error_explained: float
    false_alarm_probability: float
    heldout_rms_before: float
    heldout_rms_after: float
    unit: str
    statement: str


@dataclass(frozen=True)
class Located:
    """Where the baseline's error lives."""

    where: str
    share_of_error: float
    acts_on: str
    evidence: str


@dataclass(frozen=True, eq=False)
class Curve:
    """A missing force as a free function of one variable.

    Attributes
    ----------
    variable
        In words; "friction against ..." where the force is against the motion.
    at, force, band : ndarray, shape (n,)
        Values of the variable, force and its standard error over the recordings, in the rig's units.
    """

    variable: str
    at: FloatArray
    force: FloatArray
    band: FloatArray
    units: Units = LAB


@dataclass(frozen=True)
class Unnamed:
    """Structure that no catalogue entry fits.

    Attributes
    ----------
    where, acts_on
        Cart, and what the force follows.
    share_of_error
        Of the squared error.
    nearest
        Names nearest to it, with their likeness.
    curve
        Its shape, where it is a function of one variable.
    """

    where: str
    share_of_error: float
    acts_on: str
    nearest: tuple[tuple[str, float], ...]
    curve: Curve | None = field(default=None, compare=False)


@dataclass(frozen=True)
class RecordingFit:
    """Rms of one recording before and after: velocities of an open loop [mm/s], positions of a closed one [mm]."""

    recording: str
    before_rms: float
    after_rms: float
    floor_rms: float
    held_out: bool
    unit: str = "mm/s"

    def of_rig(self, units: Units) -> RecordingFit:
        """Return the fit as the rig's owner reads it."""
        one = units.one(self.unit)
        rms = (self.before_rms / one, self.after_rms / one, self.floor_rms / one)
        return RecordingFit(self.recording, *rms, self.held_out, units.name(self.unit))


@dataclass(frozen=True)
class Prediction:
    """A figure that the naming changed, and what the rig did where it is known.

    Attributes
    ----------
    before, after
        Of the free fit and of the diagnosed drive [unit]; ``None`` where there is no such figure.
    measured
        What the recordings say of it, in words; empty where they say nothing.
    """

    name: str
    before: float | None
    after: float | None
    unit: str
    measured: str = ""

    def of_rig(self, units: Units) -> Prediction:
        """Return the prediction as the rig's owner reads it."""
        one = units.one(self.unit)
        before, after = (None if value is None else value / one for value in (self.before, self.after))
        return replace(self, before=before, after=after, unit=units.name(self.unit))


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """Everything a diagnosis found, in the rig's units but for its drives; :meth:`as_json` is ``diagnosis.json``.

    Attributes
    ----------
    drive, free
        The diagnosed drive, and the free fit without named physics.
    learnt
        The diagnosed drive fitted to the recordings learnt from alone, which held-out figures are about; ``None`` where it
        was not kept.
    tied
        The drive fitted with the handout's ratios, or ``None`` where they do not apply.
    own_rms
        ``before_rms`` and ``after_rms`` with each run's own dry friction; ``None`` where nothing was named or the spread of
        friction is not known.
    notes
        Sentences a reader should see.
    maps, harmonics, forces, remaining
        For the report: maps and missing forces of the baseline, and maps of what remains.
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
    predictions: tuple[Prediction, ...]
    drive: Drive
    free: Drive
    seconds: float
    split: Split
    notes: tuple[str, ...] = ()
    maps: tuple[Map, ...] = ()
    harmonics: tuple[Harmonics, ...] = ()
    forces: tuple[MissingForce, ...] = ()
    remaining: tuple[Map, ...] = ()
    friction_spread: float = 0.0
    unit: str = "mm/s"
    extra: Mapping[str, Any] = field(default_factory=dict)
    learnt: Drive | None = None
    tied: Drive | None = None
    own_rms: tuple[float, float] | None = None

    def as_json(self, drive: str = "drive.toml") -> dict[str, Any]:
        """Return the object of ``diagnosis.json``; not-a-number becomes null."""
        plain: dict[str, Any] = _clean(
            {
                "schema": SCHEMA,
                "verdict": self.verdict,
                "faults": [
                    {"recording": f.recording, "where": f.where, "id": f.id, "start_s": f.start_s, "end_s": f.end_s}
                    for f in self.faults
                ],
                "located": [
                    {"where": p.where, "share_of_error": p.share_of_error, "acts_on": p.acts_on, "evidence": p.evidence}
                    for p in self.located
                ],
                "findings": [_finding(f) for f in self.findings],
                "unnamed": None
                if self.unnamed is None
                else {
                    "where": self.unnamed.where,
                    "share_of_error": self.unnamed.share_of_error,
                    "acts_on": self.unnamed.acts_on,
                    "nearest": [{"id": i, "similarity": s} for i, s in self.unnamed.nearest],
                },
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
                    "heldout_recordings": [r.name for r in (*self.split.prove, *self.split.loops)],
                    "per_recording": [vars(r) for r in self.per_recording],
                    "friction_spread": self.friction_spread,
                    "own_friction_rms": None if self.own_rms is None else list(self.own_rms),
                },
                "predictions": [vars(p) for p in self.predictions],
                "notes": list(self.notes),
                "drive": drive,
                "seconds": self.seconds,
            }
        )
        return plain

    def __str__(self) -> str:
        lines = [
            f"verdict: {self.verdict.replace('_', ' ')}",
            f"rms kept away: {self.before_rms:.3g} -> {self.after_rms:.3g} {self.unit}, "
            + (
                f"floor {self.floor_rms:.3g}"
                if math.isfinite(self.floor_rms)
                else "no floor, because no run repeats itself"
            ),
        ]
        if self.own_rms is not None:
            before, after = self.own_rms
            lines.append(f"with each run's own dry friction: {before:.3g} -> {after:.3g} {self.unit}")
        lines += [f.statement for f in self.findings]
        if self.unnamed is not None:
            lines.append(
                f"unnamed: {self.unnamed.share_of_error:.0%} of the error, on {self.unnamed.where}, {self.unnamed.acts_on}"
            )
        return "\n".join([*lines, *self.notes])


def _finding(f: Finding) -> dict[str, Any]:
    return {
        "id": f.id,
        "where": f.where,
        "parameters": {n: {"value": e.value, "ci95": list(e.ci95), "unit": e.unit} for n, e in f.parameters.items()},
        "ties": [{"id": t.id, "where": t.where} for t in f.ties],
        "separating_experiment": f.separating_experiment,
        "share_of_error_explained": f.share_of_error_explained,
        "false_alarm_probability": f.false_alarm_probability,
        "heldout_rms_before": f.heldout_rms_before,
        "heldout_rms_after": f.heldout_rms_after,
        "unit": f.unit,
        "statement": f.statement,
    }


def _clean(value: Any) -> Any:
    """Plain lists and numbers, null for not-a-number and infinity."""
    if isinstance(value, Mapping):
        return {k: _clean(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_clean(v) for v in value]
    if isinstance(value, float) or hasattr(value, "dtype"):
        number = float(value)
        return number if abs(number) < float("inf") else None
    return value


def statement(
    id_: str, where: str, parameters: Mapping[str, Estimate], share: float, probability: float, ties: Sequence[Named]
) -> str:
    """Return the finding's plain sentence: what, where, how big, how sure, what it explains."""
    sizes = ", ".join(f"{n} = {e}" for n, e in parameters.items())
    text = (
        f"{phrase(id_)} at {where.replace('_', ' ')}: {sizes}; explains {share:.0%} of the squared error left without it, "
        f"false-alarm probability {probability:.2g}"
    )
    if ties:
        rivals = " or ".join(f"{phrase(t.id)} at {t.where.replace('_', ' ')}" for t in ties)
        text += f"; these recordings cannot tell it from {rivals}"
    return text + "."


def phrase(id_: str) -> str:
    """Return an effect's name in words."""
    return id_.replace("_", " ")


def short(key: str) -> str:
    """Return the last part of a parameter's key."""
    return key.rsplit(".", maxsplit=1)[-1]


def unit_of(key: str) -> str:
    """Return the unit of a parameter."""
    return parameter(key).unit


def experiment_for(id_: str) -> str:
    """Return the experiment that separates an effect from its look-alikes."""
    return next((e.separating_experiment for e in EFFECTS if e.id == id_), "")
