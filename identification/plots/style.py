"""The one look of all figures: colours, fonts, sizes, and the few drawing habits they share."""

from __future__ import annotations

import io
from collections.abc import Callable
from functools import wraps
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar
from weakref import WeakKeyDictionary

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.ticker import FuncFormatter

from flexdrive_gym.files import write_atomically

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.axis import Axis

    from flexdrive_gym.recording import FloatArray, Recording
    from flexdrive_gym.units import Units

CART = {1: "#1f5a99", 2: "#d9660f"}
COMMAND = "#333333"
REFERENCE = "#808080"
MEASURED = "#808080"
MARK = "#b3202c"
SHADE = "#e9e9e9"
FAULTS = ("#f6d5d5", "#fbeed0", "#e0e6f5")
# a command at its limit is no fault of the data
SATURATION = "#d3ead6"

# text width of an A4 report [in]
WIDTH = 7.2

_RC: dict[Any, Any] = {
    "font.size": 9.0,
    "axes.titlesize": 9.0,
    "axes.labelsize": 9.0,
    "legend.fontsize": 8.0,
    "legend.frameon": False,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.linewidth": 0.7,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.2,
    "lines.solid_capstyle": "round",
    "savefig.dpi": 150.0,
}

P = ParamSpec("P")
R = TypeVar("R")


def styled(function: Callable[P, R]) -> Callable[P, R]:
    """Draw a figure in the package's style, whatever the user's own settings are."""

    @wraps(function)
    def inside(*args: P.args, **kwargs: P.kwargs) -> R:
        with mpl.rc_context(_RC):
            return function(*args, **kwargs)

    return inside


def new_figure(height: float, width: float = WIDTH) -> Figure:
    """Return an empty figure [in] with constrained layout."""
    return Figure(figsize=(width, height), layout="constrained")


def save_png(figure: Figure, path: Path, dpi: float) -> Path:
    """Write a figure as a PNG file, whole or not at all, and return its path."""
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=dpi)
    return write_atomically(path, stream.getvalue())


def moving_mean(values: FloatArray, samples: int) -> FloatArray:
    """Return the centred moving mean, shorter at the ends, ndarray, shape (n,)."""
    kernel = np.ones(min(max(samples, 1), len(values)))
    return np.asarray(np.convolve(values, kernel, "same") / np.convolve(np.ones(len(values)), kernel, "same"))


def draw_velocity(axes: Axes, t: FloatArray, v: FloatArray, colour: str, label: str) -> None:
    """Draw a velocity as recorded, pale, and its 15 ms mean on top: raw differences of counts are coarse."""
    samples = round(0.015 / float(np.median(np.diff(t)))) | 1
    axes.plot(t, v, color=colour, alpha=0.22, linewidth=0.5)
    axes.plot(t, moving_mean(v, samples), color=colour, label=label)


def shade_faults(axes: Axes, recording: Recording, *places: str) -> None:
    """Shade a run's faults at the places a panel shows (``encoder_1``, ``encoder_2``, ``actuator``).

    Every kind of fault gets one legend entry; faults of the recording as a whole are always shown. A command at its limit has a
    colour of its own.
    """
    shown = [fault for fault in recording.faults if fault.where in (*places, "recording")]
    kinds = [kind for kind in dict.fromkeys(fault.id for fault in shown) if kind != "saturation"]
    named: set[str] = set()
    # longest first, so that a short dropout stays visible inside a long stretch of lost counts
    for fault in sorted(shown, key=lambda f: f.start_s - f.end_s):
        # a fault of one sample must be seen too
        end = max(fault.end_s, fault.start_s + 0.002 * float(np.ptp(recording.t)))
        limited = fault.id == "saturation"
        label = None if fault.id in named else "command at its limit" if limited else fault.id.replace("_", " ")
        colour = SATURATION if limited else FAULTS[kinds.index(fault.id) % len(FAULTS)]
        axes.axvspan(fault.start_s, end, color=colour, linewidth=0.0, label=label, zorder=0)
        named.add(fault.id)


# axes that are drawn in the engine's units and labelled in the rig's
_PER_UNIT: WeakKeyDictionary[Axis, float] = WeakKeyDictionary()


def per_unit(axis: Axis) -> float:
    """Return how many of the numbers on an axis make one of what its label says; see :func:`label_in`."""
    return _PER_UNIT.get(axis, 1.0)


def label_in(axis: Axis, text: str, units: Units) -> None:
    """Label an axis whose numbers are the engine's as the rig's owner reads it.

    Parameters
    ----------
    axis
        Drawn in the engine's units.
    text
        Label that ends with the lab's unit in brackets, such as ``velocity [mm/s]``.
    units
        The rig's.
    """
    axis.set_label_text(units.name(text))
    one = units.one(text[text.rindex("[") + 1 : text.rindex("]")])
    _PER_UNIT[axis] = one
    if one != 1.0:
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value / one:g}"))


def rename_units(figure: Figure, units: Units) -> None:
    """Name the rig's units in a figure whose numbers are the rig's and whose labels name the lab's in square brackets."""
    if units.lab:
        return
    for text in figure.findobj(Text):
        text.set_text(units.label(text.get_text()))


def legend_above(axes: Axes) -> None:
    """Put the legend above the panel at its right end, where it covers no data."""
    if not axes.get_legend_handles_labels()[0]:
        return
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=4, borderaxespad=0.1, handlelength=1.6)


def heading(figure: Figure, text: str) -> None:
    """Put a heading at the figure's upper left, clear of the legends above the panels."""
    figure.suptitle(text, x=0.01, ha="left", fontsize=9.0)
