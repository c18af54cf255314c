"""What a figure is drawn from, as files that a page carries within itself."""

from __future__ import annotations

import base64
import gzip
import io
from typing import TYPE_CHECKING

import numpy as np

from identification.plots.style import per_unit

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from flexdrive_gym.recording import FloatArray


def figure_csv(figure: Figure) -> bytes:
    """Return the lines and points of a figure as CSV: panel (from 1), its labels, series, x, y."""
    stream = io.StringIO()
    stream.write("panel,x label,y label,series,x,y\n")
    for number, axes in enumerate((a for a in figure.axes if a.get_visible()), start=1):
        labels = ",".join(_cell(text) for text in (_x_label(figure, axes), axes.get_ylabel()))
        along, up = (per_unit(axis) for axis in (axes.xaxis, axes.yaxis))
        for series, x, y in _series(axes):
            head = f"{number},{labels},{_cell(series)},"
            stream.writelines(f"{head}{a / along:.6g},{b / up:.6g}\n" for a, b in zip(x, y, strict=True))
    return stream.getvalue().encode()


def _x_label(figure: Figure, axes: Axes) -> str:
    """Return the label of the horizontal axis, which panels above one another write once."""
    return axes.get_xlabel() or next((a.get_xlabel() for a in reversed(figure.axes) if a.get_xlabel()), "")


def _cell(text: str) -> str:
    plain = text.replace("$", "").replace('"', "'")
    return f'"{plain}"'


def _series(axes: Axes) -> Iterator[tuple[str, FloatArray, FloatArray]]:
    """Yield name and points of what a panel shows; helper lines have two points, and are left out unless they are named."""
    for i, line in enumerate(axes.lines, start=1):
        x, y = (np.atleast_1d(np.asarray(v, dtype=np.float64)) for v in (line.get_xdata(), line.get_ydata()))
        name = str(line.get_label())
        if not name.startswith("_") or len(x) > 2:
            yield (f"line {i}" if name.startswith("_") else name), x, y
    for i, points in enumerate(axes.collections, start=1):
        offsets = np.asarray(points.get_offsets(), dtype=np.float64)
        if len(offsets) > 1:
            name = str(points.get_label())
            yield (f"points {i}" if name.startswith("_") else name), offsets[:, 0], offsets[:, 1]


def figure_svg(figure: Figure) -> bytes:
    """Return a figure, drawn before, as SVG; clouds of points are pictures in it, as thousands of paths would be slow to draw."""
    # the places found for its PNG hold here too
    figure.set_layout_engine("none")
    for axes in figure.axes:
        for points in axes.collections:
            if len(np.atleast_2d(np.asarray(points.get_offsets()))) > 500:
                points.set_rasterized(True)
    stream = io.BytesIO()
    figure.savefig(stream, format="svg", dpi=150, metadata={"Date": None})
    return stream.getvalue()


def packed(data: bytes) -> str:
    """Return a file, compressed, in base64; the page's script unpacks it when it is asked for."""
    return base64.b64encode(gzip.compress(data, 9, mtime=0)).decode()
