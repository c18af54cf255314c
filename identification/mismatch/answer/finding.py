"""Findings: physics that a base model lacks, with a name, with its ties, or without one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from flexdrive_gym import Drive
from flexdrive_gym.drive.effects import EFFECTS
from flexdrive_gym.drive.parameters import parameter
from flexdrive_gym.recording import FloatArray
from flexdrive_gym.units import Units


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
        How often, at most, the best of the catalogue does as well in data of this rig in which nothing is left out.
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
            f"{Named(self.id, self.where)}: {sizes}; explains {percent(self.share_of_error_explained)} of the squared error left "
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
    nearest: tuple[tuple[Named, float], ...] = ()
    curve: Curve | None = field(default=None, compare=False, repr=False)

    def as_json(self) -> dict[str, Any]:
        """Return the entry of ``diagnosis.json``."""
        near = [{"id": n.id, "similarity": s} for n, s in self.nearest]
        return {"where": self.where, "share_of_error": self.share_of_error, "acts_on": self.acts_on, "nearest": near}


def percent(share: float) -> str:
    """Return a share in words: what is not quite nothing is not called 0%."""
    return "less than 1%" if 0.0 < share < 0.005 else f"{share:.0%}"


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
