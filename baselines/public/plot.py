"""The ladder as a picture: error against what was found, beside the published methods."""

from __future__ import annotations

from math import isfinite, log10
from typing import TYPE_CHECKING

from matplotlib.ticker import NullFormatter, StrMethodFormatter

from identification.plots.style import CART, MARK, MEASURED, legend_above, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from baselines.public.run import Result

_PARTS = {"learnt": ("fitted to", MEASURED, "o"), "validation": ("own validation part", CART[1], "s")}


@styled
def draw_ladder(result: Result) -> Figure:
    """Draw the error of every rung, one line per part, and the published methods as levels.

    Returns
    -------
    Figure
    """
    b = result.benchmark
    figure = new_figure(3.6)
    axes = figure.subplots()
    place = range(len(result.ladder))
    lines: list[tuple[str, str, str, str, str | None]]
    lines = [(label, colour, mark, part, None) for part, (label, colour, mark) in _PARTS.items()]
    lines += [(f"test, {c}", CART[2], "D", "test", c) for c in b.columns]
    for label, colour, mark, part, column in lines:
        errors = [result.rms(rung.name, part, column) for rung in result.ladder]
        if any(isfinite(e) for e in errors):
            axes.plot(place, errors, color=colour, marker=mark, markersize=4.0, label=label)
    for i, column in enumerate(b.columns):
        for method in (b.published[0], b.published[-1]):
            axes.axhline(method.figures[i], color=MARK, linewidth=0.7, linestyle="--" if i else ":", zorder=0)
            text = method.method if len(b.columns) == 1 else f"{method.method}, {column}"
            axes.annotate(
                text, (1.0, method.figures[i]), xycoords=("axes fraction", "data"), ha="right", va="bottom",
                fontsize=6.5, color=MARK,
            )  # fmt: skip
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter(NullFormatter() if _decades(result) > 1.0 else StrMethodFormatter("{x:g}"))
    axes.set_ylabel(f"free-simulation rms [{b.rule.unit}]")
    axes.set_xticks(list(place), [_label(rung.name, i) for i, rung in enumerate(result.ladder)])
    axes.set_xlim(-0.3, len(result.ladder) - 0.2)
    axes.set_title(b.title, loc="left")
    legend_above(axes)
    return figure


def _decades(result: Result) -> float:
    """Return over how many decades the picture goes."""
    figures = [s.rms for s in result.scores] + [f for p in result.benchmark.published for f in p.figures]
    return log10(max(figures) / min(figures))


def _label(name: str, place: int) -> str:
    effect, _, where = name.replace("_", " ").partition("@")
    return effect.replace(" ", "\n", 1) if not place else "+ " + "\n".join([*effect.split(), where])
