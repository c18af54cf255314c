"""The lower half of the picture: positions and command over the last seconds, with their current values."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite, isnan

import numpy as np

from flexdrive_gym.recording import FloatArray
from flexdrive_gym.rendering.canvas import Canvas
from flexdrive_gym.rendering.history import Frame, History
from flexdrive_gym.rendering.scale import Scale, reading, round_out, text
from flexdrive_gym.rendering.style import CART, COMMAND, GRID, LIMIT, QUIET, REFERENCE, TEXT

LEFT, LEGEND = 62.0, 190.0
TOP, BETWEEN, BOTTOM = 218.0, 34.0, 36.0
SHARE = 0.64  # of the height for the positions
# an axis shows a limit once this share of it has been reached; until then it is only written
NEAR = 0.6


@dataclass(frozen=True)
class Panel:
    """The axes of one chart."""

    x: Scale
    y: Scale

    def points(self, t: FloatArray, values: FloatArray) -> FloatArray:
        """Return the places of a curve's finite samples, ndarray, shape (n, 2)."""
        places = np.stack((self.x.places(t), self.y.places(values)), axis=1)
        return places[np.isfinite(places).all(axis=1)]


def draw_charts(canvas: Canvas, frame: Frame, history: History) -> None:
    """Draw both charts and their legends."""
    height = (canvas.height - TOP - BOTTOM - BETWEEN) * SHARE
    begin = max(history.begin, frame.t - history.seconds)
    time = Scale(begin, begin + history.seconds, LEFT, canvas.width - LEGEND - 22.0)
    low, high = position_range(history, frame.travel_limit, 5.0 / frame.units.one("mm"))
    upper = Panel(time, Scale(low, high, TOP + height, TOP))
    largest = command_range(history, frame.voltage_limit, 0.5 / frame.units.one("V"))
    lower = Panel(time, Scale(-largest, largest, canvas.height - BOTTOM, TOP + height + BETWEEN))
    _draw_axes(canvas, upper, frame.units.label("position [mm]"), frame.travel_limit, 6)
    _draw_axes(canvas, lower, frame.units.label("command u [V]"), frame.voltage_limit, 4)
    _draw_time(canvas, lower)
    _draw_curves(canvas, upper, lower, history)
    _draw_legends(canvas, frame, upper, lower)


def _draw_curves(canvas: Canvas, upper: Panel, lower: Panel, history: History) -> None:
    t, x1, x2, xr, u = history.columns()
    with canvas.clipped(upper.x.start, upper.y.end - 1.0, upper.x.end + 3.0, upper.y.start + 1.0):
        canvas.dashes(upper.points(t, xr), REFERENCE, 1.6)
        canvas.lines(upper.points(t, x1), CART[1], 1.6)
        canvas.lines(upper.points(t, x2), CART[2], 1.6)
    with canvas.clipped(lower.x.start, lower.y.end - 1.0, lower.x.end + 3.0, lower.y.start + 1.0):
        # the command is held from sample to sample
        canvas.lines(lower.points(np.repeat(t, 2)[1:], np.repeat(u, 2)[:-1]), COMMAND, 1.3)
    for panel, values, colour in ((upper, x1, CART[1]), (upper, x2, CART[2]), (lower, u, COMMAND)):
        for x, y in panel.points(t[-1:], values[-1:]):
            canvas.disc((x, y), 2.5, colour)


def position_range(history: History, limit: float, least: float = 5.0) -> tuple[float, float]:
    """Return the range of the position axis: all that was seen, ``least`` either way, and a limit that came near."""
    middle, half = 0.5 * (history.lowest + history.highest), 0.5 * (history.highest - history.lowest)
    low, high = round_out(middle - max(1.08 * half, least), middle + max(1.08 * half, least), 8)
    if history.lowest < -NEAR * limit:
        low = min(-1.08 * limit, low)
    if history.highest > NEAR * limit:
        high = max(1.08 * limit, high)
    return low, high


def command_range(history: History, limit: float, least: float = 0.5) -> float:
    """Return the largest value of the command axis; at least ``least`` where there is no limit."""
    if history.largest_command > NEAR * limit:
        return 1.15 * max(limit, history.largest_command)
    floor = 0.25 * limit if isfinite(limit) else least
    return round_out(0.0, max(1.1 * history.largest_command, floor), 2)[1]


def _draw_axes(canvas: Canvas, panel: Panel, label: str, limit: float, most: int) -> None:
    x, y = panel.x, panel.y
    for value in y.ticks(most):
        canvas.rule(x.start, y(value), x.end, y(value), GRID)
        canvas.text((x.start - 8.0, y(value)), text(value), QUIET, "right", 12.0)
    for value in x.ticks(9):
        canvas.rule(x(value), y.start, x(value), y.end, GRID)
    for value in (-limit, limit):
        if y.low <= value <= y.high:
            canvas.dashed_rule(x.start, y(value), x.end, y(value), LIMIT)
    canvas.rule(x.start, y.end, x.start, y.start, TEXT)
    canvas.rule(x.start, y.start, x.end, y.start, TEXT)
    canvas.text((x.start, y.end - 12.0), label, TEXT)


def _draw_time(canvas: Canvas, panel: Panel) -> None:
    y = panel.y.start
    for value in panel.x.ticks(9):
        x = panel.x(value)
        canvas.rule(x, y, x, y + 4.0, TEXT)
        canvas.text((x, y + 14.0), text(value), QUIET, "centre", 12.0)
    canvas.text((canvas.width - LEGEND, y + 14.0), "t [s]", TEXT)


def _draw_legends(canvas: Canvas, frame: Frame, upper: Panel, lower: Panel) -> None:
    positions = [
        ("x1", frame.x1, CART[1]),
        ("x2", frame.x2, CART[2]),
        ("xr", frame.xr, REFERENCE),
        ("x2 − x1", float(frame.x2) - float(frame.x1), None),
    ]
    positions = [entry for entry in positions if not isnan(entry[1])]
    for row, (name, value, colour) in enumerate(positions):
        _draw_entry(canvas, upper, row, name, reading(value, "mm", frame.units, 2), colour)
    _draw_limit(
        canvas, upper, len(positions), f"travel ±{reading(frame.travel_limit, 'mm', frame.units)}", frame.travel_limit
    )
    _draw_entry(canvas, lower, 0, "u", reading(frame.u, "V", frame.units, 3), COMMAND)
    _draw_limit(canvas, lower, 1, f"limit ±{reading(frame.voltage_limit, 'V', frame.units)}", frame.voltage_limit)


def _draw_entry(canvas: Canvas, panel: Panel, row: int, name: str, value: str, colour: str | None) -> None:
    x, y = canvas.width - LEGEND, _row(panel, row)
    if colour is not None:
        draw = canvas.dashed_rule if colour == REFERENCE else canvas.rule
        draw(x, y, x + 24.0, y, colour, 2.0)
    canvas.text((x + 32.0, y), name, TEXT)
    canvas.text((canvas.width - 20.0, y), value, TEXT, "right")


def _draw_limit(canvas: Canvas, panel: Panel, row: int, words: str, limit: float) -> None:
    if isfinite(limit):
        x, y = canvas.width - LEGEND, _row(panel, row)
        canvas.dashed_rule(x, y, x + 24.0, y, LIMIT)
        canvas.text((x + 32.0, y), words, LIMIT)


def _row(panel: Panel, row: int) -> float:
    return panel.y.end + 8.0 + 23.0 * row
