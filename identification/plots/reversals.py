"""Mean reversals, measured and simulated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from identification.plots import style
from identification.plots.style import new_figure, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from identification.reversals import Reversal

_LINES = ("#333333", "#b3202c", "#2a8a5b", "#7a5195")


@styled
def plot_reversals(
    groups: Mapping[str, Sequence[Reversal]],
    simulated: Mapping[str, Mapping[str, Sequence[Reversal]]],
    *,
    unit: str = "mm/s",
) -> Figure:
    """Plot v1 and v2 around the reversals of the command.

    Parameters
    ----------
    groups
        Title of a row (an amplitude) to the measured reversals of its recordings, one thick line each.
    simulated
        Name of a model to the same of its simulations; of each group their first is drawn.
    unit
        Of velocities.

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure = new_figure(0.9 + 1.7 * len(groups))
    carts = len(next(iter(groups.values()))[0].v)
    grid = figure.subplots(len(groups), carts, sharex=True, squeeze=False)
    for axes, (title, measured) in zip(grid, groups.items(), strict=True):
        for cart, panel in enumerate(axes):
            for i, r in enumerate(measured):
                label = "measured, each recording" if i == 0 else None
                colour = style.CART[cart + 1]
                panel.plot(1e3 * r.t, r.v[cart], color=colour, linewidth=2.0, alpha=0.45, label=label)
            for (name, model), colour in zip(simulated.items(), _LINES, strict=False):
                for r in model[title][:1]:
                    panel.plot(1e3 * r.t, r.v[cart], color=colour, linewidth=1.1, label=name)
            panel.set_ylabel(f"change of $v_{cart + 1}$ [{unit}]")
            panel.set_title(title, loc="left")
    for panel in grid[-1]:
        panel.set_xlabel("time since the reversal [ms]")
    handles, labels = grid[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=2)
    return figure
