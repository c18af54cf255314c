"""Figures of a concealed trial; each function takes judged trials and returns a matplotlib Figure."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.ticker import LogFormatter, NullFormatter, PercentFormatter

from baselines.blind_study.judge import Judged
from baselines.blind_study.summary import Summary
from identification.plots.style import heading, legend_above, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

_GOOD, _TIE, _BAD, _QUIET = "#2e7d4f", "#8fbf6f", "#b3202c", "#b8b8b8"
_LAST = ("in a tie", "unnamed", "nothing")


@styled
def plot_confusion(summary: Summary) -> Figure:
    """Draw the confusion matrix: concealed effects against answers, as counts."""
    rows = sorted(summary.confusion, key=lambda name: (name == "nothing", "@" not in name, name))
    said = {s for counts in summary.confusion.values() for s in counts}
    columns = [*sorted(said - set(_LAST)), *(s for s in _LAST if s in said)]
    figure = new_figure(1.2 + 0.19 * len(rows))
    axes = figure.subplots()
    for i, true in enumerate(rows):
        for name, count in summary.confusion[true].items():
            j = columns.index(name)
            right = (
                name == true
                or (name == "unnamed" and "@" not in true and true != "nothing")
                or (name == true == "nothing")
            )
            colour = _GOOD if right else _TIE if name == "in a tie" else _QUIET if name in _LAST else _BAD
            axes.add_patch(_square(j, i, colour))
            axes.text(j, i, str(count), ha="center", va="center", fontsize=6, color="white")
    axes.set_xlim(-0.5, len(columns) - 0.5)
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.set_xticks(range(len(columns)), columns, rotation=90, fontsize=6)
    axes.set_yticks(range(len(rows)), rows, fontsize=6)
    axes.set_ylabel("concealed")
    axes.set_xlabel("said")
    axes.grid(visible=True, linewidth=0.3)
    axes.set_axisbelow(True)
    heading(figure, "Green: correct; light: in a tie; grey: not named; red: another name")
    return figure


def _square(x: float, y: float, colour: str) -> Patch:
    from matplotlib.patches import Rectangle  # noqa: PLC0415

    return Rectangle((x - 0.45, y - 0.45), 0.9, 0.9, facecolor=colour)


@styled
def plot_detection(summary: Summary) -> Figure:
    """Draw from which size on every effect is named: trials as dots, the curve's 50 % and 90 % points as a bar."""
    found = sorted(summary.detection, key=lambda d: d.half)
    figure = new_figure(1.0 + 0.2 * len(found))
    axes = figure.subplots()
    for i, d in enumerate(found):
        axes.plot([d.half, d.nine_tenths], [i, i], color="#1f5a99", linewidth=1.2, marker="|", markersize=6)
        for size, (named, tried) in d.by_size.items():
            for n in range(tried):
                axes.plot(
                    size * 1.06 ** (n - (tried - 1) / 2.0), i, "o", markersize=4,
                    color=_GOOD if n < named else _BAD, markerfacecolor=_GOOD if n < named else "white",
                )  # fmt: skip
    axes.set_xscale("log")
    axes.set_xlim(0.1, 8.0)
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xticks([0.125, 0.25, 0.5, 1.0, 2.0, 4.0], ["1/8", "1/4", "1/2", "1", "2", "4"])
    axes.set_yticks(range(len(found)), [d.name for d in found], fontsize=7)
    axes.set_ylim(-0.7, len(found) - 0.3)
    axes.set_xlabel("size, in multiples of plainly present")
    heading(figure, "Full dots: named; rings: missed; bar: named in 50 % to 90 % of trials")
    return figure


@styled
def plot_gains(trials: Sequence[Judged]) -> Figure:
    """Draw the critical gain that each drive predicts against the concealed rig's own."""
    figure = new_figure(3.2)
    left, right = figure.subplots(1, 2)
    for drive, colour, marker in (("tied", _QUIET, "x"), ("free", "#d9660f", "o"), ("diagnosed", "#1f5a99", "o")):
        pairs = [
            (t.critical_gain, gain)
            for t in trials
            if t.critical_gain is not None and (gain := (t.predicted or {}).get(drive)) is not None
        ]
        if pairs:
            x, y = np.array(pairs).T
            left.plot(x, y / x - 1.0, marker, color=colour, markersize=3.5, label=drive, linestyle="none", alpha=0.7)
    left.axhline(0.0, color="black", linewidth=0.6)
    left.set_ylim(-0.6, 0.6)
    left.set_xlabel("critical gain of the concealed rig [V/mm]")
    left.yaxis.set_major_formatter(PercentFormatter(1.0))
    left.set_ylabel("error of the prediction")
    legend_above(left)
    fits = [(t.before / t.floor, t.after / t.floor) for t in trials if isfinite(t.before / t.floor)]
    if fits:
        before, after = np.array(fits).T
        right.loglog(before, after, "o", color="#1f5a99", markersize=3.5, alpha=0.7)
        most = float(max(before.max(), 2.0))
        right.loglog([0.7, most], [0.7, most], color="black", linewidth=0.6)
        right.axhline(1.0, color="black", linewidth=0.6, linestyle=":")
        for axis in (right.xaxis, right.yaxis):
            axis.set_major_formatter("{x:g}")
            axis.set_minor_formatter(LogFormatter(minor_thresholds=(1.0, 0.4)))
    right.set_xlabel("rms held out over floor, before naming")
    right.set_ylabel("after naming")
    return figure
