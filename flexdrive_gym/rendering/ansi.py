"""The drive in two lines of text."""

from __future__ import annotations

from math import isfinite, isnan

from flexdrive_gym.rendering.history import Frame
from flexdrive_gym.rendering.scale import Scale, reading

WIDTH = 79
# columns between the two carts' digits when the spring is at rest
GAP = 8


def draw_ansi(frame: Frame, span: float) -> str:
    """Return the rail and the numbers.

    Carts stand at ``[1]`` and ``[2]`` with the spring ``~`` between them, and ``v`` is where cart 2 should be; it
    gives way only to a cart's digit. Ends of the rail are where x1 = -span and x2 = span.

    Parameters
    ----------
    frame
        What to show.
    span
        Largest position on the rail [mm].

    Returns
    -------
    str
        Two lines.
    """
    rail = ["-"] * WIDTH
    rail[0] = rail[-1] = "|"
    gap = 0 if frame.rigid else GAP
    scale = Scale(-span, span, 2.0, WIDTH - 3.0 - gap)
    one, two, goal = (
        round(scale(min(max(x, -span), span))) + offset if isfinite(x) else None
        for x, offset in ((frame.x1, 0), (frame.x2, gap), (frame.xr, gap))
    )
    if one is not None and two is not None:
        rail[one:two] = "~" * max(two - one, 0)
    for place, digit in ((one, "1"), (two, "2")):
        if place is not None:
            rail[place - 1 : place + 2] = f"[{digit}]"
    if goal is not None and rail[goal] not in "12":
        rail[goal] = "v"
    positions = (("x1", frame.x1), ("x2", frame.x2), ("xr", frame.xr))
    numbers = [f"{name} = {reading(x, 'mm', frame.units, 2)}" for name, x in positions if not isnan(x)]
    line = "  ".join([f"t = {frame.t:.3f} s", *numbers, f"u = {reading(frame.u, 'V', frame.units, 2)}"])
    # terminals may lack the true minus sign
    return "".join(rail) + "\n" + line.replace("−", "-").replace("–", "-")
