r"""Play between motor and rack: the motor's inertia moves freely within ±g before it meets cart 1.

The command acts on the motor (mass :math:`m_m`, in addition to m1; position :math:`\rho` relative to cart 1, velocity
:math:`v_m`),

.. math:: m_m \dot v_m = u - F_c, \qquad \dot\rho = v_m - v_1,

and cart 1 feels the contact :math:`F_c` instead of u. Outside the gap, with :math:`e = \rho -
\operatorname{clip}(\rho, \pm g)`,

.. math:: F_c = k_c e\,(1 + \lambda\,\operatorname{sgn}(e)\,(v_m - v_1)), \quad \text{pushing only}, \qquad
   \lambda = 0.01\ \text{s/mm},

Hunt and Crossley's contact: continuous when it closes, and an impact at 50 mm/s loses about a third of its speed. The
motor starts in the middle of the gap. At :math:`m_m = 0` the motor follows at once: :math:`F_c = u`. Worked check:
after a reversal of u while the carts stand still the motor crosses 2g in :math:`\sqrt{4 g m_m/u}`, 7.7 ms for
:math:`m_m` = 1.5e-4 V s²/mm, g = 0.2 mm and u = 2 V.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from flexdrive_gym.drive.compilation import inlined
from flexdrive_gym.drive.effects._effect import Effect, Parameter
from flexdrive_gym.drive.simd.pack import chosen

_LAMBDA = 0.01


@inlined
def _contact(rho: float, rate: float, gap: float, stiffness: float) -> float:
    inside = rho - min(max(rho, -gap), gap)
    # a contact pushes, it does not pull
    push = stiffness * inside * max(1.0 + chosen(inside > 0.0, _LAMBDA, -_LAMBDA) * rate, 0.0)
    return chosen(inside == 0.0, 0.0, push)


def _transmission(u: float, v1: float, z: Any, oz: int, p: Any, o: int) -> float:
    if p[o] == 0.0:
        return u
    return _contact(z[oz], z[oz + 1] - v1, p[o + 1], p[o + 2])


def _rates(
    w: int, x1: float, v1: float, x2: float, v2: float, u: float, a: float, t: float, z: Any, oz: int, p: Any, o: int
) -> int:
    if p[o] != 0.0:
        z[oz + w] = z[oz + 1] - v1
        z[oz + 1 + w] = (u - _contact(z[oz], z[oz + 1] - v1, p[o + 1], p[o + 2])) / p[o]
    return w


def _begin(w: int, v: float, v1: float, v2: float, u: float, z: Any, oz: int, p: Any, o: int) -> int:
    z[oz + 1] = v1
    return w


def _fastest_rate(values: tuple[float, ...], masses: tuple[float, float]) -> float:
    mass, _gap, stiffness = values
    return 1.5 * float(np.sqrt(stiffness / mass)) if mass > 0.0 else 0.0


EFFECT = Effect(
    id="motor_gear_backlash",
    where=("drivetrain",),
    equation="m_m·dv_m/dt = u - Fc,  Fc = kc·e·(1 + λ·sgn(e)·dρ/dt),  e = ρ - clip(ρ, ±g),   ρ = x_m - x1",
    parameters=(
        Parameter("mass", "V s²/mm", 0.0, 0.0, 1.0, "the motor's own inertia, besides m1", (1e-4, 3e-4)),
        Parameter("gap", "mm", 0.2, 0.0, 10.0, "half the play", (0.1, 0.3, 0.8), role="shape"),
        Parameter("kc", "V/mm", 5.0, 0.1, 1e3, "stiffness of the contact", (5.0, 20.0), role="shape"),
    ),
    hooks={"transmission": _transmission, "rates": _rates, "begin": _begin},
    states=("rho", "v_m"),
    fastest_rate=_fastest_rate,
    tells_itself_by="v1 jumps a few ms after a reversal",
    looks_like=("breakaway", "encoder_play"),
    separating_experiment="fast reversals at two amplitudes: the gap's time falls with the root of u",
    reference=(
        "M. Nordin, P.-O. Gutman, Controlling mechanical systems with backlash: a survey, Automatica 38(10), 2002; "
        "K. H. Hunt, F. R. E. Crossley, J. Appl. Mech. 42(2), 1975 (contact)"
    ),
)
