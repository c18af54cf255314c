"""What a picture shows: one frame of the drive, and the frames before it for the strip chart."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from math import inf, isfinite, isnan

import numpy as np

from flexdrive_gym.recording import FloatArray
from flexdrive_gym.units import LAB, Units, measured_in

# more samples than a chart has pixels cannot be seen
MOST_SAMPLES = 4000


@dataclass(frozen=True)
class Frame:
    """The drive at one instant.

    Attributes
    ----------
    t
        Time since the start of the run [s].
    x1, x2, xr
        Positions of the carts and where cart 2 should be [mm]; nan for what does not exist, which is not drawn.
        Without cart 2 the drive is one rigid cart, and the reference is its own.
    u
        Command [V], held from this instant on.
    travel_limit, voltage_limit
        Largest distance of a cart from 0 [mm] and largest size of the command [V]; inf where there is none.
    title
        Headline of the picture.
    units
        The rig's, in which the picture is drawn.
    """

    t: float = field(metadata=measured_in("s"))
    x1: float = field(metadata=measured_in("mm"))
    x2: float = field(metadata=measured_in("mm"))
    xr: float = field(metadata=measured_in("mm"))
    u: float = field(metadata=measured_in("V"))
    travel_limit: float = field(default=inf, metadata=measured_in("mm"))
    voltage_limit: float = field(default=inf, metadata=measured_in("V"))
    title: str = ""
    units: Units = LAB

    @property
    def rigid(self) -> bool:
        """Whether there is no cart 2."""
        return isnan(self.x2)


class History:
    """The last frames, and the largest excursions since the start, so that axes grow but never jump about.

    Parameters
    ----------
    seconds
        How much is kept [s].
    """

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        self.clear()

    def clear(self) -> None:
        """Forget everything."""
        self._rows: deque[tuple[float, float, float, float, float]] = deque()
        self.lowest, self.highest = 0.0, 0.0  # of x1, x2 and xr [mm]
        self.largest_command = 0.0  # [V]
        self.begin = 0.0  # first instant [s]

    def add(self, frame: Frame) -> None:
        """Append a frame; time that runs backwards begins a new history."""
        rows = self._rows
        if rows and frame.t < rows[-1][0]:
            self.clear()
            rows = self._rows
        if not rows:
            self.begin = frame.t
        row = (frame.t, frame.x1, frame.x2, frame.xr, frame.u)
        # the newest sample gives way to the next one until it is far enough from the one before
        if len(rows) > 1 and rows[-1][0] - rows[-2][0] < 0.999 * self.seconds / MOST_SAMPLES:
            rows[-1] = row
        else:
            rows.append(row)
        # one row older than the window stays, so that curves reach its edge
        while len(rows) > 2 and rows[1][0] < frame.t - self.seconds:
            rows.popleft()
        for x in row[1:4]:
            if isfinite(x):
                self.lowest, self.highest = min(self.lowest, x), max(self.highest, x)
        if isfinite(frame.u):
            self.largest_command = max(self.largest_command, abs(frame.u))

    def columns(self) -> FloatArray:
        """Return t [s], x1, x2, xr [mm] and u [V], ndarray, shape (5, n)."""
        return np.array(self._rows, dtype=np.float64).reshape(-1, 5).T
