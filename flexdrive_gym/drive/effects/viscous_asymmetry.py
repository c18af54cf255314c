"""Viscous friction that depends on the direction: b⁺ = b + a to the right, b⁻ = b - a to the left.

A coefficient never falls below zero. Worked check: with b1 = 0.0096 and a = 0.0004 V s/mm the steady velocity of cart
1 alone under ±2 V against 0.36 V of friction is 164 mm/s to the right and 178 mm/s to the left.
"""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.effects._effect import Effect, Parameter


def _damping(b: float, v: float, s: float, t: float, p: Any, o: int) -> float:
    return b + s * p[o]


EFFECT = Effect(
    id="viscous_asymmetry",
    where=("cart_1", "cart_2"),
    equation="b ← b + a·sgn(v)",
    parameters=(Parameter("a", "V s/mm", 0.0, -0.1, 0.1, "half the difference b⁺ - b⁻", (3e-4, -3e-4)),),
    hooks={"damping": _damping},
    tells_itself_by="even harmonics that grow with v",
    looks_like=("gain_asymmetry", "ground_spring", "coulomb_asymmetry"),
    separating_experiment="plateaus both ways at several amplitudes",
    reference="B. Armstrong-Hélouvry, Control of Machines with Friction, 1991",
    order=1,
)
