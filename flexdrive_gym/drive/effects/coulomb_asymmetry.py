"""Coulomb friction that depends on the direction: d⁺ = d + a to the right, d⁻ = d - a to the left.

A level never falls below zero. Worked check: with d = 0.357 V and a = 0.02 V cart 1 needs 0.377 V to the right and
0.337 V to the left; under a symmetric drive that keeps it moving it drifts like under an offset of -0.02 V.
"""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.effects._effect import Effect, Parameter


def _friction(d: float, x: float, v: float, s: float, fs: float, t: float, p: Any, o: int) -> float:
    return d + s * p[o]


EFFECT = Effect(
    id="coulomb_asymmetry",
    where=("cart_1", "cart_2"),
    equation="d ← d + a·sgn(v)",
    parameters=(Parameter("a", "V", 0.0, -4.0, 4.0, "half the difference d⁺ - d⁻", (0.03, -0.03)),),
    hooks={"friction": _friction},
    tells_itself_by="even harmonics, mean drift",
    looks_like=("gain_asymmetry", "input_offset"),
    separating_experiment="slow ramps from rest both ways; the spring uncoupled tells cart 1 from cart 2",
    reference="B. Armstrong-Hélouvry et al., Automatica 30(7), 1994",
    order=1,
)
