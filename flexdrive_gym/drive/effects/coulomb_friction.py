"""Set-valued Coulomb friction on each cart.

A moving cart feels d·sgn(v). A cart at rest feels whatever force in [-d, d] keeps it at rest: it sticks exactly,
without creep, until the remaining force exceeds d. The step (:mod:`flexdrive_gym.drive.step`) keeps that set-valued
law; this leaf only supplies the level.
"""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.effects._effect import Effect, Parameter


def _friction(d: float, x: float, v: float, s: float, fs: float, t: float, p: Any, o: int) -> float:
    return d + p[o]


EFFECT = Effect(
    id="coulomb_friction",
    where=("cart_1", "cart_2"),
    equation="F ∈ -d·Sgn(v),  Sgn(0) = [-1, 1]",
    parameters=(Parameter("d", "V", 0.0, 0.0, 8.0, "Coulomb friction level", (0.3, 1.0, 0.1)),),
    hooks={"friction": _friction},
    tells_itself_by="offset of the steady velocity against u; standstill below a threshold",
    looks_like=("dead_zone",),
    separating_experiment="small sine riding on motion",
    reference="Lab 3 handout, below Eq. (2); J. J. Moreau, Unilateral contact and dry friction, 1988",
    base=True,
    symbols={"cart_1": ("d1",), "cart_2": ("d2",)},
)
