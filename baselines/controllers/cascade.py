"""Collocated PD inside, the second cart outside: the inner loop's reference is moved by ωo·∫(xr - x2) dt + κ·(xr - x2).

The inner loop from x1 is robust but blind to the spring; the outer loop from x2 brings the second cart home. All four gains are
chosen together, by the area of x2² after a step of disturbance, within the demands on margins.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from baselines.controllers._design import Design, Family, best_of, discretised, gain, needs_two_carts, stack
from baselines.controllers.pd import pd_candidates, pd_law
from flexdrive_gym import Drive, LinearController

_OUTER = np.geomspace(2.0, 15.0, 5)
_PROPORTIONAL = (0.0, 1.0)


def cascade(drive: Drive, Kp: float, Kd: float, outer: float, kappa: float, sample_time: float) -> LinearController:
    """Return the cascade for one choice of gains.

    Parameters
    ----------
    Kp, Kd
        Of the inner PD [V/mm], [V s/mm].
    outer, kappa
        Integral [1/s] and proportional [] action of the outer loop.
    """
    import control  # noqa: PLC0415  (costs a second; used here only)

    correction = control.ss(control.tf([kappa, outer], [1.0, 0.0])) * gain([[1.0, 0.0, -1.0]])
    inside = stack(gain(np.eye(2)), correction) * gain(np.vstack([np.eye(3)[:2], np.eye(3)]))
    return discretised(pd_law(Kp, Kd, drive) * inside, "cascade", sample_time=sample_time)


def _design(drive: Drive, sample_time: float) -> Design:
    needs_two_carts(drive, "cascade")
    # every other pair of the inner loop is fine enough where the outer one varies too
    gains = [(*pd, float(w), k) for pd, w, k in product(pd_candidates(drive)[::3], _OUTER, _PROPORTIONAL)]
    tried = [cascade(drive, *chosen, sample_time) for chosen in gains]
    best, note = best_of(tried, drive)
    Kp, Kd, outer, kappa = gains[tried.index(best)]
    values = {"Kp": (Kp, "V/mm"), "Kd": (Kd, "V s/mm"), "ωo": (outer, "1/s"), "κ": (kappa, "–")}
    return Design(best, "PD from x1, outer loop from x2, feed-forward", "x1, x2", values, (note,) if note else ())


FAMILIES = (Family("cascade", "collocated PD with an outer loop from x2", _design, ("x1", "x2")),)
