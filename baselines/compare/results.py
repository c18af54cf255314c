"""What a comparison found, as data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from baselines.compare.cases import Case
from baselines.compare.entries import Entry
from baselines.compare.tables import tables
from baselines.evaluation.metrics import NAMES, Measures
from baselines.evaluation.proportions import Share, share
from baselines.loop_analysis.empirical_margins import EmpiricalMargins
from baselines.loop_analysis.margins import Margins
from flexdrive_gym import Drive
from flexdrive_gym.recording import FloatArray
from flexdrive_gym.units import measured_in


@dataclass(frozen=True, eq=False)
class Result:
    """What the comparison found of one controller.

    Attributes
    ----------
    nominal
        On the identified drive with its friction, counts and limit, along the handout's trajectory.
    margins
        By python-control on the linear drive, or ``None`` for a black box.
    empirical
        By trial on the linear drive, or ``None`` where not asked for.
    on_rig
        By trial, simulated with friction, counts and limit, or ``None`` where not asked for or it fails as it is.
    swing
        Of the cart that swings most in the last six of twelve seconds after one move, simulated with friction, peak to peak [mm],
        or ``None`` where margins by trial were not asked for.
    draws, stable_draws
        Shares of success and of stability over the drawn drives, or ``None`` without draws.
    draw_rms
        5 %, 50 % and 95 % point of the rms error over the drawn drives [mm].
    effects
        Case to measures.
    unseen
        Name of another reference to measures on the identified drive.
    measures
        Every case's measures in the engine's units, ndarray, shape (cases, len(NAMES)).
    """

    entry: Entry = field(metadata=measured_in(None))
    nominal: Measures
    margins: Margins | None
    empirical: EmpiricalMargins | None
    on_rig: EmpiricalMargins | None
    swing: float | None = field(metadata=measured_in("mm"))
    draws: Share | None
    stable_draws: Share | None
    draw_rms: tuple[float, float, float] | None = field(metadata=measured_in("mm"))
    effects: Mapping[str, Measures]
    unseen: Mapping[str, Measures]
    measures: FloatArray

    @property
    def effect_share(self) -> Share | None:
        """Share of effects at their typical size with which the controller still succeeds."""
        return share([m.success for m in self.effects.values()])

    def column(self, measure: str, chosen: np.ndarray) -> FloatArray:
        """Return one measure on some cases, ndarray, shape (chosen,)."""
        return np.asarray(self.measures[chosen, NAMES.index(measure)])


@dataclass(frozen=True, eq=False)
class Group:
    """Results that differ by their training seed alone; a classical design is a group of one."""

    name: str
    results: tuple[Result, ...]

    @property
    def learnt(self) -> bool:
        """Whether it was trained."""
        return self.results[0].entry.learnt

    @property
    def middle(self) -> Result:
        """The result with the median rms error on the identified drive: the seed to show."""
        ranked = sorted(self.results, key=lambda r: r.nominal.rms)
        return ranked[(len(ranked) - 1) // 2]

    def table(self, measure: str, chosen: np.ndarray) -> FloatArray:
        """Return one measure on some cases, ndarray, shape (seeds, chosen)."""
        return np.array([r.column(measure, chosen) for r in self.results])


@dataclass(frozen=True, eq=False)
class Comparison:
    """All controllers on all cases.

    Attributes
    ----------
    results
        In the order of the entries.
    skipped
        Controller to the reason why it is not there.
    """

    drive: Drive
    cases: tuple[Case, ...] = field(metadata=measured_in(None))
    results: tuple[Result, ...]
    limit: float = field(metadata=measured_in("V"))
    tolerance: float = field(metadata=measured_in("mm"))
    duration: float = field(metadata=measured_in("s"))
    seed: int
    skipped: Mapping[str, str] = field(default_factory=dict)

    def __str__(self) -> str:
        return "\n\n".join(str(table) for table in tables(self))

    @property
    def groups(self) -> tuple[Group, ...]:
        """Results by group, in the order of the entries."""
        members: dict[str, list[Result]] = {}
        for r in self.results:
            members.setdefault(r.entry.group or r.entry.name, []).append(r)
        return tuple(Group(name, tuple(found)) for name, found in members.items())

    @property
    def references(self) -> tuple[str, ...]:
        """Names of the references beside the handout's trajectory."""
        return tuple(dict.fromkeys(str(c.reference) for c in self.cases if not c.handout))

    def where(self, group: str | None = None, reference: str | None = None) -> np.ndarray:
        """Return the numbers of the cases of a group along a reference; ``None`` for the handout's trajectory.

        Without a group it is the drawn drives, or the identified one where none were drawn.
        """
        along = [
            c.handout if reference is None else not c.handout and str(c.reference) == reference for c in self.cases
        ]
        if group is None:
            drawn = [a and c.group == "draw" for a, c in zip(along, self.cases, strict=True)]
            group = "draw" if any(drawn) else "nominal"
        return np.flatnonzero([a and c.group == group for a, c in zip(along, self.cases, strict=True)])


def result_of(
    entry: Entry,
    cases: tuple[Case, ...],
    table: FloatArray,
    analytic: Margins | None,
    empirical: EmpiricalMargins | None,
    on_rig: EmpiricalMargins | None,
    swing: float | None,
) -> Result:
    """Return the result of one controller from its table of measures."""
    found = list(zip(cases, map(_as_measures, table), strict=True))
    drawn = [m for c, m in found if c.group == "draw" and c.handout]
    quantiles = np.quantile([m.rms for m in drawn], (0.05, 0.5, 0.95)) if drawn else None
    return Result(
        entry=entry,
        nominal=next(m for c, m in found if c.group == "nominal" and c.handout),
        margins=analytic,
        empirical=empirical,
        on_rig=on_rig,
        swing=swing,
        draws=share([m.success for m in drawn]),
        stable_draws=share([m.stable for m in drawn]),
        draw_rms=None if quantiles is None else (float(quantiles[0]), float(quantiles[1]), float(quantiles[2])),
        effects={c.name: m for c, m in found if c.group == "effect"},
        unseen={str(c.reference): m for c, m in found if c.group == "nominal" and not c.handout},
        measures=table,
    )


def _as_measures(row: FloatArray) -> Measures:
    values: dict[str, Any] = dict(zip(NAMES, map(float, row), strict=True))
    return Measures(**{**values, "stable": values["stable"] > 0.5, "success": values["success"] > 0.5})
