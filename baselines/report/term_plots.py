"""Figures of a term: parameters over groups, critical gains, and what differs between rigs, sessions and runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.ticker import PercentFormatter

from baselines.term.summary import Term
from identification.plots.style import CART, MARK, heading, legend_above, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from baselines.term.random_effects import Spread

_COLUMNS = 4
_LEVEL_COLOURS = {"rig": "#1f5a99", "session": "#2e7d4f", "run": "#d9660f"}
_TRAJECTORY, _LINEAR = "critical_gain_x2_trajectory", "critical_gain_x2_linear"


@styled
def plot_parameters(term: Term) -> Figure:
    """Draw every parameter of every group with its 95 % interval; what stands out is a red square."""
    shown = term.usable
    names = list(dict.fromkeys(n for _, r in shown for n in r["parameters"]))
    rows = -(-len(names) // _COLUMNS)
    figure = new_figure(rows * (0.9 + 0.17 * len(shown)))
    panels = figure.subplots(rows, _COLUMNS, sharey=True, squeeze=False)
    strange = {(o.group, o.what) for o in term.outliers if o.kind == "parameter"}
    for axes, name in zip(panels.flat, names, strict=False):
        for i, (group, row) in enumerate(shown):
            if name in row["parameters"]:
                # by shape, too: not every eye tells the colours apart
                looks = (MARK, "s") if (group.label, name) in strange else (CART[1], "o")
                _dot(axes, i, row["parameters"][name], *looks)
        unit = next(r["parameters"][name]["unit"] for _, r in shown if name in r["parameters"])
        axes.set_title(f"{name} [{unit}]" if unit else name)
        _around([r["parameters"][name] for _, r in shown if name in r["parameters"]], axes)
    for axes in panels.flat[len(names) :]:
        axes.set_visible(False)
    for axes in panels[:, 0]:
        _groups(axes, [g.label for g, _ in shown])
    return figure


def _dot(axes: Axes, at: float, estimate: Mapping[str, Any], colour: str, marker: str = "o") -> None:
    if estimate["ci95"] is not None and None not in estimate["ci95"]:
        axes.plot(estimate["ci95"], [at, at], color=colour, linewidth=1.0)
    axes.plot([estimate["value"]], [at], marker, color=colour, markersize=3.5 if marker == "o" else 5.0)


def _around(estimates: Sequence[Mapping[str, Any]], axes: Axes) -> None:
    """Keep an interval of nothing from making all others a point."""
    values = np.array([e["value"] for e in estimates])
    ends = np.array([e["ci95"] for e in estimates if e["ci95"] is not None and None not in e["ci95"]]).ravel()
    low, high = float(values.min()), float(values.max())
    reach = max(high - low, 0.25 * abs(high)) or 1.0
    inside = ends[(ends > low - reach) & (ends < high + reach)]
    axes.set_xlim(min([low, *inside]) - 0.08 * reach, max([high, *inside]) + 0.08 * reach)


def _groups(axes: Axes, labels: Sequence[str]) -> None:
    short = [label if len(label) <= 26 else f"{label[:12]}…{label[-12:]}" for label in labels]
    axes.set_yticks(range(len(labels)), short, fontsize=7)
    axes.set_ylim(len(labels) - 0.4, -0.6)


@styled
def plot_gains(term: Term) -> Figure:
    """Draw the gain from x2 at which a loop begins to ring: predicted with interval, linear, and what the rig did."""
    shown = [(g, r) for g, r in term.usable if _gain(r, _TRAJECTORY) or _gain(r, _LINEAR)]
    figure = new_figure(0.9 + 0.19 * len(shown))
    axes = figure.subplots()
    for i, (_, row) in enumerate(shown):
        label = i == 0
        predicted, linear, reached = _gain(row, _TRAJECTORY), _gain(row, _LINEAR), row["critical_gain"]["reached"]
        if predicted:
            _dot(axes, i, predicted, CART[1])
            axes.plot([], [], "o-", color=CART[1], markersize=3.5, label="predicted, 95 %" if label else None)
        if linear:
            axes.plot([linear["value"]], [i], "|", color="#808080", markersize=8, label="linear" if label else None)
        for key, marker, words in (("holds", ">", "held on the rig"), ("grows", "<", "grew on the rig")):
            if reached[key] is not None:
                axes.plot([reached[key]], [i + 0.22], marker, color=MARK, markersize=4, label=_once(axes, words))
    _groups(axes, [g.label for g, _ in shown])
    unit = next((p["unit"] for _, r in shown for p in r["critical_gain"]["predicted"].values()), "V/mm")
    axes.set_xlabel(f"gain from x2 [{unit}]")
    legend_above(axes)
    return figure


def _once(axes: Axes, label: str) -> str | None:
    return None if label in axes.get_legend_handles_labels()[1] else label


def _gain(row: Mapping[str, Any], name: str) -> Mapping[str, Any] | None:
    found = row["critical_gain"]["predicted"].get(name)
    return found if found and found["value"] is not None else None


@styled
def plot_spreads(spreads: Sequence[Spread]) -> Figure:
    """Draw the standard deviation of every parameter between rigs, between sessions and between runs, with its interval."""
    names = list(dict.fromkeys(s.parameter for s in spreads))
    levels = list(dict.fromkeys(s.level for s in spreads))
    figure = new_figure(0.9 + 0.32 * len(names))
    axes = figure.subplots()
    for s in spreads:
        y = names.index(s.parameter) + 0.22 * (levels.index(s.level) - (len(levels) - 1) / 2.0)
        colour = _LEVEL_COLOURS[s.level]
        label = f"between {s.level}s ({s.units})" if s.parameter == names[0] else None
        axes.plot(s.ci95, [y, y], color=colour, linewidth=1.0)
        axes.plot([s.value], [y], "o", color=colour, markersize=4, label=label)
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.set_xlim(0.0, 1.15 * max(0.05, *(min(s.ci95[1], 2.5 * s.value + 0.05) for s in spreads)))
    axes.xaxis.set_major_formatter(PercentFormatter(1.0))
    axes.set_xlabel("standard deviation")
    legend_above(axes)
    return figure


@styled
def plot_changes(term: Term) -> Figure:
    """Draw by how much parameters changed from one term to the next, rig by rig; significant ones are filled."""
    found = term.changes
    names = [f"{c.rig}, {c.parameter}" + (f", {c.before} → {c.after}" if len(term.terms) > 2 else "") for c in found]
    figure = new_figure(0.9 + 0.16 * len(found))
    axes = figure.subplots()
    for i, c in enumerate(found):
        colour = MARK if c.significant else "#808080"
        axes.plot([100.0 * (x - 1.0) for x in c.ci95], [i, i], color=colour, linewidth=1.0)
        fill = colour if c.significant else "white"
        axes.plot([100.0 * (c.ratio - 1.0)], [i], "o", color=colour, markersize=3.5, markerfacecolor=fill)
    axes.axvline(0.0, color="black", linewidth=0.6)
    _groups(axes, names)
    axes.set_xlabel("change [%]")
    heading(figure, "Filled: significant; bars: 95 %")
    return figure
