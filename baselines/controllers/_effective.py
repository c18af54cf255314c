r"""The drive as a linear design sees it: named effects that act linearly, folded into delay, masses and scale.

Around a crossover of 25 rad/s a lag of the amplifier by :math:`\tau` is a delay by :math:`\tau` to within
:math:`(\omega\tau)^3/3` of phase and :math:`(\omega\tau)^2/2` of gain (3 mrad and 3 % at 10 ms); an encoder that is late by
:math:`\tau` is, in the loop that reads it, exactly a command that is late by it. The motor behind a gap and appendages above the
crossover move with their carts. What is left, friction laws, dead zones, play and other curves, no linear design can use; see
:mod:`baselines.controllers.iterative_learning`.
"""

from __future__ import annotations

import numpy as np

from flexdrive_gym import Drive, LinearController
from flexdrive_gym.drive import parameters

_TAU = "input_delay.tau"


def effective(drive: Drive, reads: tuple[str, ...]) -> Drive:
    """Return the drive for a linear design; the same drive where nothing is to be folded.

    Parameters
    ----------
    drive
        With its effects.
    reads
        Which of ``x1``, ``x2`` the controller reads; the mean of their delays counts.
    """
    late = [drive[f"encoder_delay.encoder_{x[1]}.tau"] for x in reads]
    changes = {
        _TAU: drive["amplifier_lag.tau"] + float(np.mean(late)),
        "m1": drive["motor_gear_backlash.mass"] + drive["extra_mode.mass_1"],
    }
    if drive.carts == 2:
        changes["m2"] = drive["extra_mode.mass_2"]
    changes = {name: drive[name] + more for name, more in changes.items() if more > 0.0}
    if not changes:
        return drive
    if _TAU in changes:
        changes[_TAU] = min(changes[_TAU], parameters.parameter(_TAU).upper)
    folded = ("amplifier_lag", "encoder_delay", "motor_gear_backlash", "extra_mode")
    kept = {name: value for name, value in drive.values.items() if name.split(".")[0] not in folded}
    return Drive({**kept, **changes}, name=drive.name)


def rescaled(controller: LinearController, drive: Drive) -> LinearController:
    """Return the controller for an encoder 2 that reads (1 + s)·x2: it divides what it reads by that."""
    scale = 1.0 + drive["encoder_scale.s"]
    if scale == 1.0:
        return controller
    weights = np.array([1.0, 1.0, 1.0 / scale])
    return controller.replace(B=controller.B * weights, D=controller.D * weights)
