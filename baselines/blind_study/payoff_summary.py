"""Designs on several drives, compared on concealed rigs: medians over rigs, paired ratios, tables."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from baselines.blind_study.payoff import LEARNING, P_HALF, Outcome, Payoff


@dataclass(frozen=True)
class Median:
    """A median over n rigs with its 95 % interval; nan where there are none."""

    value: float
    low: float
    high: float
    n: int

    def __str__(self) -> str:
        return "–" if not self.n else f"{self.value:.3g} [{self.low:.3g}, {self.high:.3g}]"


@dataclass(frozen=True)
class Figures:
    """One design on one drive, over all rigs that it did not refuse.

    Attributes
    ----------
    rms
        Median [mm].
    margin, worst_margin
        Median and smallest :attr:`Outcome.margin` on the rig [].
    broken_promise
        Median of |margin on the rig / margin the drive promised - 1|.
    stable
        Share of all rigs on which the loop was made and stable.
    refused
        Number of rigs.
    """

    rms: float
    margin: float
    worst_margin: float
    broken_promise: Median
    stable: float
    refused: int


@dataclass(frozen=True)
class Row:
    """One design over all rigs.

    Attributes
    ----------
    design
        Its name.
    drives
        Name of the drive to its figures.
    ratios
        ``diagnosed/free`` and ``diagnosed/tied``: the median of the paired ratios of rms; below 1 the diagnosis pays.
    gain_errors
        Of ``p_x2_half``: name of the drive to the median of |predicted/true - 1| of the critical gain; empty for others.
    """

    design: str
    drives: Mapping[str, Figures]
    ratios: Mapping[str, Median]
    gain_errors: Mapping[str, Median]


def summary(payoffs: Sequence[Payoff], better: str = "diagnosed") -> tuple[Row, ...]:
    """Return one row per design: medians over rigs, and what the better drive pays, in pairs.

    Parameters
    ----------
    payoffs
        One per rig.
    better
        The drive whose rms is divided by that of each other one of the same rig.
    """
    designs = dict.fromkeys(o.design for p in payoffs for o in p.outcomes)
    drives = tuple(dict.fromkeys(o.drive for p in payoffs for o in p.outcomes))
    rows = []
    for made in designs:
        figures = {drive: _figures([p.find(drive, made) for p in payoffs]) for drive in drives}
        ratios = {}
        for other in drives:
            pairs = [(p.find(better, made), p.find(other, made)) for p in payoffs]
            found = [a.rms / b.rms for a, b in pairs if a and b and a.rms is not None and b.rms]
            if other != better:
                ratios[f"{better}/{other}"] = median(found)
        errors = {drive: median(_gain_errors(payoffs, drive)) for drive in drives} if made == P_HALF else {}
        rows.append(Row(made, figures, ratios, errors))
    return tuple(rows)


def _figures(outcomes: Sequence[Outcome | None]) -> Figures:
    made = [o for o in outcomes if o is not None]

    def middle(values: Iterable[float | None]) -> float:
        known = [v for v in values if v is not None]
        return float(np.median(known)) if known else float("nan")

    margins = [o.margin for o in made]
    return Figures(
        rms=middle(o.rms for o in made),
        margin=middle(margins),
        worst_margin=min((m for m in margins if m is not None), default=float("nan")),
        broken_promise=median(
            [abs(o.margin / o.predicted_margin - 1.0) for o in made if o.margin and o.predicted_margin]
        ),
        stable=sum(o.stable for o in made) / len(outcomes),
        refused=len(outcomes) - len(made),
    )


def _gain_errors(payoffs: Sequence[Payoff], drive: str) -> list[float]:
    pairs = [(p.predicted_critical_gain.get(drive), p.true_critical_gain) for p in payoffs]
    return [abs(predicted / true - 1.0) for predicted, true in pairs if predicted is not None and true is not None]


def median(values: Sequence[float]) -> Median:
    """Return the median with its bootstrap interval."""
    if not values:
        return Median(float("nan"), float("nan"), float("nan"), 0)
    middle = float(np.median(values))
    if len(values) == 1 or max(values) == min(values):
        return Median(middle, middle, middle, len(values))
    from scipy.stats import bootstrap  # noqa: PLC0415  (slow to import)

    found = bootstrap((np.asarray(values),), np.median, method="percentile", rng=np.random.default_rng(0))
    interval = found.confidence_interval
    return Median(middle, float(interval.low), float(interval.high), len(values))


Table = tuple[tuple[str, ...], list[tuple[str, ...]]]


def tables(rows: Sequence[Row]) -> tuple[Table, Table]:
    """Return the summary as two tables, each columns and rows: tracking and what the diagnosis pays, and margins on the rig."""
    drives, ratios = (tuple(rows[0].drives), tuple(rows[0].ratios)) if rows else ((), ())
    tracking = [
        (_words(r.design), *(f"{r.drives[d].rms:.2f}" for d in drives), *(str(r.ratios[q]) for q in ratios))
        for r in rows
    ]
    margins: list[tuple[str, ...]] = [
        (
            _words(row.design),
            drive,
            *(f"{own.margin:.2f}", f"{own.worst_margin:.2f}", f"{own.broken_promise.value:.1%}", f"{own.stable:.0%}"),
        )
        for row in rows
        # a command by iterative learning control leaves the loop as it is
        if not row.design.endswith(LEARNING)
        for drive, own in row.drives.items()
    ]
    return (
        (("design", *(f"rms on the {d} drive [mm]" for d in drives), *(f"rms {q}" for q in ratios)), tracking),
        (
            (
                "design",
                "designed on",
                "median gain margin",
                "smallest",
                "error of the predicted margin",
                "stable on the rig",
            ),
            margins,
        ),
    )


def _words(made: str) -> str:
    """Return a design's name in the registry, and what was done with it."""
    if made == P_HALF:
        return "p_x2 at half the predicted critical gain"
    return f"{made.removesuffix(LEARNING)}, iterative learning control" if made.endswith(LEARNING) else made
