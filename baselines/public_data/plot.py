"""The ladder as a picture: error against what was found, beside the published methods."""

from __future__ import annotations

from math import isfinite, log10
from typing import TYPE_CHECKING

from matplotlib.ticker import NullFormatter, StrMethodFormatter

from baselines.public_data.run import AVERAGE
from identification.plots.style import CART, MARK, MEASURED, legend_above, new_figure, styled

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from baselines.public_data.run import Result, Rung

    # label, colour, marker, part and column of the scores
    Line = tuple[str, str, str, str, str | None]


@styled
def draw_ladder(result: Result) -> Figure:
    """Draw the error of every rung, and the published methods as levels; test recordings have a panel of their own.

    Returns
    -------
    Figure
    """
    b = result.benchmark
    figure = new_figure(3.6 * (1 + result.tested))
    panels = figure.subplots(1 + result.tested, 1, squeeze=False)[:, 0]
    lines = [("fitted to", MEASURED, "o", "fitted", None), ("blocks left out", CART[1], "s", "validation", None)]
    _draw(panels[0], result, result.ladder, lines)
    panels[0].set_title(b.title, loc="left")
    if result.tested:
        tests = [
            (c, colour, "D", "test", c) for c, colour in zip(b.columns, (CART[2], CART[1], MEASURED), strict=False)
        ]
        _draw(panels[1], result, result.ladder, tests)
        panels[1].set_title("test recordings", loc="left")
    return figure


def _draw(axes: Axes, result: Result, rungs: Sequence[Rung], lines: Sequence[Line]) -> None:
    b, place = result.benchmark, range(len(rungs))
    for label, colour, mark, part, column in lines:
        errors = [result.rms(rung.name, part, column) for rung in rungs]
        if any(isfinite(e) for e in errors):
            axes.plot(place, errors, color=colour, marker=mark, markersize=4.0, label=label)
    parts = {part for *_, part, _ in lines}
    scored = {s.column for s in result.scores if s.part in parts}
    for i, column in enumerate(b.columns):
        if column not in scored:
            continue
        for method in (b.published[0], b.published[-1]):
            axes.axhline(method.figures[i], color=MARK, linewidth=0.7, linestyle=("-", "--", ":")[i], zorder=0)
            text = method.method if len(b.columns) == 1 else f"{method.method}, {column}"
            axes.annotate(
                text, (1.0, method.figures[i]), xycoords=("axes fraction", "data"), ha="right", va="bottom",
                fontsize=6.5, color=MARK,
            )  # fmt: skip
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter(NullFormatter() if _decades(result) > 1.0 else StrMethodFormatter("{x:g}"))
    axes.set_ylabel(f"free-simulation rms [{b.rule.unit}]")
    axes.set_xticks(list(place), [_label(rung.name, i) for i, rung in enumerate(rungs)])
    axes.set_xlim(-0.3, len(rungs) - 0.2)
    legend_above(axes)


def _decades(result: Result) -> float:
    """Return over how many decades the picture goes."""
    figures = [s.rms for s in result.scores] + [f for p in result.benchmark.published for f in p.figures]
    return log10(max(figures) / min(figures))


def _label(name: str, place: int) -> str:
    if name == AVERAGE:
        return "average"
    effect, _, where = name.replace("_", " ").partition("@")
    return (
        effect.replace(" ", "\n", 1)
        if not place
        else "+ " + "\n".join([*effect.split(), *([] if where in effect else [where])])
    )
