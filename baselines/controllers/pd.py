"""PD on the motor cart (collocated) with feed-forward: u = Kp·(x1r - x1) + Kd·(vr - v1) + (m1 + m2)·ar + (b1 + b2)·vr.

Cart 2 lags cart 1 by the spring's deflection, so cart 1's reference leads: x1r = xr + (m2·ar + b2·vr)/k. A stiff PD holds
cart 1 so firmly that cart 2 rings on its spring with the bare drive's damping, and no gain of this structure can change that.
"""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from baselines.controllers._design import (
    DERIVATIVE_POLE,
    Design,
    Family,
    best_of,
    discretised,
    feed_forward,
    gain,
    spring_feed_forward,
    stack,
)
from flexdrive_gym import Drive, LinearController

if TYPE_CHECKING:
    import control

_BANDWIDTHS = np.geomspace(8.0, 60.0, 12)
_DAMPINGS = np.geomspace(0.4, 2.0, 6)


def pd_law(Kp: float, Kd: float, drive: Drive) -> control.StateSpace:
    """Return the continuous law from (xr, x1, correction of x1's reference) to u, feed-forward included."""
    import control  # noqa: PLC0415  (costs a second; used here only)

    damper = control.ss(control.tf([Kd, 0.0], [1.0 / DERIVATIVE_POLE, 1.0]))
    forward = feed_forward(drive)
    if drive.carts == 2:
        forward = forward + Kp * spring_feed_forward(drive)
    split = [[1.0, -1.0, 1.0], [1.0, -1.0, 0.0], [1.0, 0.0, 0.0]]
    return gain([[1.0, 1.0, 1.0]]) * stack(gain(Kp), damper, forward) * gain(split)


def pd_candidates(drive: Drive) -> list[tuple[float, float]]:
    """Return pairs Kp [V/mm], Kd [V s/mm] that would give the rigid drive a range of bandwidths and dampings."""
    linear = drive.linear
    mass, damping = (linear.m1, linear.b1) if linear.rigid else (linear.m1 + linear.m2, linear.b1 + linear.b2)
    return [
        (float(mass * w**2), float(max(0.0, 2.0 * z * mass * w - damping))) for w, z in product(_BANDWIDTHS, _DAMPINGS)
    ]


def _design(drive: Drive, sample_time: float) -> Design:
    from_readings = gain([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.0]])

    def made(Kp: float, Kd: float) -> LinearController:
        return discretised(pd_law(Kp, Kd, drive) * from_readings, "pd_x1", sample_time=sample_time)

    gains = pd_candidates(drive)
    tried = [made(*pair) for pair in gains]
    best, note = best_of(tried, drive)
    Kp, Kd = gains[tried.index(best)]
    values = {"Kp": (Kp, "V/mm"), "Kd": (Kd, "V s/mm")}
    return Design(best, "PD from x1 with feed-forward (collocated)", "x1", values, (note,) if note else ())


FAMILIES = (Family("pd_x1", "PD from x1 with feed-forward", _design, ("x1",)),)
