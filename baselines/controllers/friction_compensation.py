"""Coulomb friction compensated by the model: + (d1 + d2)·sat(vr/v0), with the identified d1 and d2, on Lab 4 and on the cascade.

The velocity is the reference's, not a measured one: a compensation by the measured sign overcompensates at every reversal of the
vibration and can hold a limit cycle (H. Olsson et al., European Journal of Control 4, 1998, sec. 6).
"""

from __future__ import annotations

import numpy as np

from baselines.controllers._design import Design, Family, derivative, needs_two_carts
from baselines.controllers.cascade import FAMILIES as CASCADE
from baselines.controllers.loop_shaping import FAMILIES as LOOP_SHAPING
from flexdrive_gym import Drive, LinearController

THRESHOLD_MM_S = 5.0


def compensated(controller: LinearController, level: float, threshold: float = THRESHOLD_MM_S) -> LinearController:
    """Return a controller that adds level·sat(vr/threshold), the reference's velocity smoothed as in Lab 4.

    Parameters
    ----------
    controller
        Without friction compensation.
    level
        Coulomb friction to overcome [V].
    threshold
        Velocity at which it is compensated in full [mm/s].
    """
    import control  # noqa: PLC0415  (costs a second; used here only)

    slope = control.sample_system(derivative(), controller.sample_time, method="tustin")
    n, m = controller.order, slope.nstates
    assert controller.L is not None
    A = np.block([[controller.A, np.zeros((n, m))], [np.zeros((m, n)), np.asarray(slope.A)]])
    B = np.vstack([controller.B, np.hstack([np.asarray(slope.B), np.zeros((m, 2))])])
    C = np.vstack([np.append(controller.C[0], np.zeros(m)), np.append(np.zeros(n), np.asarray(slope.C)[0])])
    D = np.vstack([controller.D[0], [float(np.asarray(slope.D)[0, 0]), 0.0, 0.0]])
    return controller.replace(
        A=A, B=B, C=C, D=D, L=np.append(controller.L, np.zeros(m)), friction=level, threshold=threshold
    )  # fmt: skip


def _family(base: Family) -> Family:
    name = f"{base.name}_friction"

    def design(drive: Drive, sample_time: float) -> Design:
        needs_two_carts(drive, name)
        inner = base.made(drive, sample_time)
        level = drive["d1"] + drive["d2"]
        values = {**inner.values, "d1 + d2": (level, "V"), "v0": (THRESHOLD_MM_S, "mm/s")}
        controller = compensated(inner.controller, level).replace(name=name)
        return Design(controller, f"{inner.title}, friction compensated", inner.feedback, values, inner.notes)

    return Family(name, f"{base.about}, with model-based friction compensation", design, base.reads)


FAMILIES = tuple(_family(f) for f in (*LOOP_SHAPING, *CASCADE) if f.name in {"lab4", "cascade"})
