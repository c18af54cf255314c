"""Play in the coupling: inside ±g of deflection the spring is loose.

The whole spring, dampers and non-linear terms included, feels δ - clip(δ, ±g), and has no damping inside. Worked
check: with k = 0.095 V/mm and g = 0.5 mm a deflection of 2 mm carries 0.143 V instead of 0.190 V; the describing
function at amplitude A ≫ g is k·(1 - 4g/(πA)).
"""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.effects._effect import Effect, Parameter


def _deflection(delta: float, p: Any, o: int) -> float:
    return delta - min(max(delta, -p[o]), p[o])


EFFECT = Effect(
    id="coupling_backlash",
    where=("spring",),
    equation="δ ← δ - clip(δ, ±g)",
    parameters=(Parameter("g", "mm", 0.0, 0.0, 20.0, "half the play", (0.3, 1.0)),),
    hooks={"deflection": _deflection},
    tells_itself_by="soft at small δ",
    looks_like=("hardening_spring", "coil_bind"),
    separating_experiment="small sine near resonance",
    reference="M. Nordin, P.-O. Gutman, Controlling mechanical systems with backlash: a survey, Automatica 38(10), 2002",
)
