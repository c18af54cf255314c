"""The upper half of the picture: rail, carts, spring, reference and travel limits.

Both positions are 0 with the spring at rest, so cart 2 is drawn a natural gap further right than its position says,
and each cart has a scale of its own: cart 1 below the rail, cart 2 and the reference above it.
"""

from __future__ import annotations

from itertools import pairwise
from math import isfinite

import numpy as np

from flexdrive_gym.rendering.canvas import Canvas
from flexdrive_gym.rendering.history import Frame
from flexdrive_gym.rendering.scale import Scale, text
from flexdrive_gym.rendering.style import CART, LIMIT, PAPER, QUIET, RAIL, REFERENCE, SPRING

EDGE = 70.0  # from the picture's side to the first and last place of a cart's middle
GAP = 168.0  # between the carts' middles when the spring is at rest
HALF = {1: 37.0, 2: 29.0}  # half widths of the carts
UPPER, ROOF, FLOOR, RAIL_TOP, LOWER = 64.0, 92.0, 136.0, 146.0, 162.0
WHEEL = 6.0
COILS = 7


def draw_rail(canvas: Canvas, frame: Frame, span: float) -> None:
    """Draw the rail with everything on it; ``span`` is the largest position shown [mm]."""
    gap = 0.0 if frame.rigid else GAP
    one = Scale(-span, span, EDGE, canvas.width - EDGE - gap)
    two = Scale(-span, span, EDGE + gap, canvas.width - EDGE)
    limited = isfinite(frame.travel_limit)
    _draw_scale(canvas, one, CART[1], LOWER, 1.0, limited=limited)
    if not frame.rigid:
        _draw_scale(canvas, two, CART[2], UPPER, -1.0, limited=limited)
        canvas.text((one.end + 14.0, LOWER + 1.0), frame.units.label("cart 1: x1 [mm]"), CART[1])
        canvas.text((two.start - 14.0, UPPER - 1.0), frame.units.label("cart 2: x2 [mm]"), CART[2], "right")
    left, right = one.start - HALF[1], two.end + (HALF[1] if frame.rigid else HALF[2])
    canvas.box(left, RAIL_TOP, right, RAIL_TOP + 3.0, RAIL)
    if limited:
        canvas.box(left - 6.0, ROOF, left, RAIL_TOP + 3.0, LIMIT)
        canvas.box(right, ROOF, right + 6.0, RAIL_TOP + 3.0, LIMIT)
    _draw_carts(canvas, frame, one, two)


def _draw_scale(canvas: Canvas, scale: Scale, colour: str, y: float, down: float, *, limited: bool) -> None:
    canvas.rule(scale.start, y, scale.end, y, colour)
    ends = [scale.low, scale.high] if limited else []
    # a tick whose number would run into the limit's number stays unwritten
    ticks = [v for v in scale.ticks(10) if all(abs(scale(v) - scale(e)) > 36.0 for e in ends)]
    for values, tint, length in ((ticks, colour, 5.0), (ends, LIMIT, 9.0)):
        for value in values:
            x = scale(value)
            canvas.rule(x, y, x, y + down * length, tint, 1.0 if tint == colour else 2.0)
            canvas.text((x, y + down * 16.0), text(value), LIMIT if tint == LIMIT else QUIET, "centre", 12.0)


def _draw_carts(canvas: Canvas, frame: Frame, one: Scale, two: Scale) -> None:
    x1, x2, goal = (_place(s, x) for s, x in ((one, frame.x1), (two, frame.x2), (two, frame.xr)))
    if x1 is not None and x2 is not None:
        _draw_spring(canvas, x1 + HALF[1], x2 - HALF[2])
    if goal is not None:
        canvas.dashed_rule(goal, UPPER + 10.0, goal, RAIL_TOP, REFERENCE, 1.0, 5.0)
    if x1 is not None:
        canvas.rule(x1, FLOOR, x1, LOWER, CART[1], 2.0)
        _draw_cart(canvas, x1, 1, ("cart 1", "motor cart"))
    if x2 is not None:
        canvas.rule(x2, ROOF, x2, UPPER, CART[2], 2.0)
        _draw_cart(canvas, x2, 2, ("cart 2",))
    if goal is not None:
        canvas.polygon([(goal - 6.0, UPPER + 1.0), (goal + 6.0, UPPER + 1.0), (goal, UPPER + 11.0)], REFERENCE)
        # on the side where cart 2 is not
        away = 1.0 if x2 is None or goal >= x2 else -1.0
        canvas.text((goal + 9.0 * away, UPPER + 12.0), "xr", REFERENCE, "left" if away > 0.0 else "right", 12.0)


def _place(scale: Scale, x: float) -> float | None:
    """Return where a cart is drawn: a runaway stays in the picture, just beyond the end."""
    return min(max(scale(x), scale.start - 8.0), scale.end + 8.0) if isfinite(x) else None


def _draw_cart(canvas: Canvas, x: float, number: int, lines: tuple[str, ...]) -> None:
    half = HALF[number]
    canvas.box(x - half, ROOF, x + half, FLOOR + 2.0, CART[number], 4.0)
    for wheel in (x - half + 14.0, x + half - 14.0):
        canvas.disc((wheel, RAIL_TOP - WHEEL), WHEEL, SPRING)
        canvas.disc((wheel, RAIL_TOP - WHEEL), 2.0, PAPER)
    for row, line in enumerate(lines):
        middle = 0.5 * (ROOF + FLOOR) - 4.0 + 15.0 * (row - 0.5 * (len(lines) - 1))
        canvas.text((x, middle), line, PAPER, "centre", 13.0 if row == 0 else 12.0)


def _draw_spring(canvas: Canvas, left: float, right: float) -> None:
    if right <= left:
        return  # the carts touch
    y, amplitude = 0.5 * (ROOF + FLOOR) - 2.0, 10.0
    straight = min(8.0, 0.1 * (right - left))
    turns = np.linspace(left + straight, right - straight, 2 * COILS + 1)
    heights = np.concatenate(([y], np.tile([y - amplitude, y + amplitude], COILS)[: 2 * COILS - 1], [y]))
    points = [(left, y), *zip(turns.tolist(), heights.tolist(), strict=True), (right, y)]
    for a, b in pairwise(points):
        canvas.lines([a, b], SPRING, 2.0)
        canvas.disc(b, 1.0, SPRING)  # a thick line has no corners of its own
