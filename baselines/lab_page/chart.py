"""What ``static/plot.js`` draws: a chart as data, free of any page."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

Colour = Literal["x1", "x2", "xr", "u", "ink", "soft", "good", "warn", "bad", "accent"]


def _plain(values: npt.ArrayLike) -> list[float | None]:
    """Return numbers as JSON knows them, six digits, what is not finite as a gap."""
    given = np.asarray(values, dtype=np.float64).ravel()
    return [float(f"{v:.6g}") if np.isfinite(v) else None for v in given.tolist()]


@dataclass(frozen=True)
class Axis:
    """One axis; bounds that are ``None`` follow the data."""

    label: str
    low: float | None = None
    high: float | None = None
    log: bool = False


@dataclass(frozen=True)
class Series:
    """Points in the order given: a line, dots or crosses."""

    x: list[float | None]
    y: list[float | None]
    colour: Colour = "ink"
    kind: Literal["line", "dots", "crosses"] = "line"
    name: str = ""
    dash: bool = False
    width: float = 1.8


def series(x: npt.ArrayLike, y: npt.ArrayLike, colour: Colour = "ink", **more: Any) -> Series:
    """Return a series of arrays, shape (n,) each."""
    return Series(_plain(x), _plain(y), colour, **more)


@dataclass(frozen=True)
class Line:
    """A straight line across the chart at one value."""

    at: float
    across: Literal["x", "y"]
    colour: Colour = "soft"
    label: str = ""


@dataclass(frozen=True)
class Chart:
    """One chart.

    Attributes
    ----------
    summary
        What a screen reader says of it.
    equal
        Whether both axes have one scale.
    circle
        Whether the unit circle is drawn.
    brush
        Whether a range of x can be chosen.
    """

    title: str
    x: Axis
    y: Axis
    series: list[Series] = field(default_factory=list)
    lines: list[Line] = field(default_factory=list)
    summary: str = ""
    equal: bool = False
    circle: bool = False
    brush: bool = False

    def json(self) -> dict[str, Any]:
        """Return the chart as plain data."""
        return asdict(self)
