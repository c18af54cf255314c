r"""Viscous friction that saturates: of belts that creep, of grease that thins with shear.

.. math:: F = -d \tanh(v / v_0)

Far below :math:`v_0` it is viscous with d/v0, far above it is dry friction of level d, and nowhere does it hold a resting
cart. So the steady speed grows faster than the command, which a square law of a sensor mimics. Worked check: with d = 0.3 V and
v0 = 100 mm/s it is 0.228 V at 100 mm/s and 0.289 V at 200 mm/s; at 1 mm/s it is viscous friction of 0.003 V s/mm.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from flexdrive_gym.drive.effects._effect import Effect, Parameter

# keeps 0/0 away; of v0
_TINY = 1e-6


def _damping(b: float, v: float, s: float, t: float, p: Any, o: int) -> float:
    if p[o] == 0.0:
        return b
    ratio = abs(v) / p[o + 1] + _TINY
    gone = np.exp(-2.0 * ratio)
    return b + p[o] / p[o + 1] * (1.0 - gone) / ((1.0 + gone) * ratio)


EFFECT = Effect(
    id="saturating_friction",
    where=("cart_1", "cart_2"),
    equation="F = -d·tanh(v/v0)",
    parameters=(
        Parameter("d", "V", 0.0, 0.0, 20.0, "level far above v0", (0.05, 0.3)),
        Parameter("v0", "mm/s", 100.0, 5.0, 2000.0, "velocity at which it saturates", (100.0, 40.0), role="shape"),
    ),
    hooks={"damping": _damping},
    tells_itself_by="the steady velocity grows faster than the command, and nothing holds at rest",
    looks_like=("quadratic_drag", "viscous_friction", "stribeck", "coulomb_friction"),
    separating_experiment="plateaus at many levels from near zero to full command",
    reference="H. Olsson et al., Friction models and friction compensation, European Journal of Control 4, 1998",
    order=2,
)
