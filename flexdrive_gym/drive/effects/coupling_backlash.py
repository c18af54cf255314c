r"""Play in the coupling: inside ±g of deflection the spring is loose.

The whole spring, dampers and non-linear terms included, feels δ - clip(δ, ±g), and has no damping inside. A contact loses what a
body that bounces back lacks: its force is larger while it is pressed together than while it is let go,

.. math:: F \leftarrow F \max(0, 1 + \lambda \operatorname{sgn}(\delta) \dot\delta) ,

never a pull (K. H. Hunt, F. R. E. Crossley, J. Appl. Mech. 42, 1975). Worked
check: with k = 0.095 V/mm and g = 0.5 mm a deflection of 2 mm carries 0.143 V instead of 0.190 V; the describing
function at amplitude A ≫ g is k·(1 - 4g/(πA)).
"""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.effects._effect import Effect, Parameter
from flexdrive_gym.drive.simd.pack import chosen


def _deflection(delta: float, p: Any, o: int) -> float:
    return delta - min(max(delta, -p[o]), p[o])


def _spring(f: float, delta: float, rate: float, z: Any, oz: int, p: Any, o: int) -> float:
    if p[o + 1] == 0.0:
        return f
    return f * max(0.0, 1.0 + p[o + 1] * chosen(delta >= 0.0, rate, -rate))


EFFECT = Effect(
    id="coupling_backlash",
    where=("spring",),
    equation="δ ← δ - clip(δ, ±g),  F ← F·max(0, 1 + λ·sgn(δ)·dδ/dt)",
    parameters=(
        Parameter("g", "mm", 0.0, 0.0, 20.0, "half the play", (0.3, 1.0)),
        Parameter("loss", "s/mm", 0.0, 0.0, 0.01, "loss λ of the contact", (2e-4,), finer=True),
    ),
    hooks={"deflection": _deflection, "spring": _spring},
    # of all that the spring carries
    order=9,
    tells_itself_by="soft at small δ",
    looks_like=("hardening_spring", "coil_bind"),
    separating_experiment="small sine near resonance",
    reference="M. Nordin, P.-O. Gutman, Controlling mechanical systems with backlash: a survey, Automatica 38(10), 2002",
)
