"""What a comparison found of one controller, as data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from baselines.compare.cases import Case
from baselines.compare.entries import Entry
from baselines.evaluation.metrics import NAMES, Measures
from baselines.evaluation.proportions import Share, share
from baselines.loop_analysis.empirical_margins import EmpiricalMargins
from baselines.loop_analysis.margins import Margins
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
