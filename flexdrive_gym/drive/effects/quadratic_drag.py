"""Drag that grows with the square of the speed: c·v·|v|, of air, or the curvature of any viscous law.

As a viscous coefficient it is b + c·|v|; together they never fall below zero. Worked check: with b1 = 0.0096 V s/mm
and c = 3e-6 V s²/mm² drag is 0.1 V of the viscous 1.75 V at 183 mm/s.
"""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.effects._effect import Effect, Parameter


def _damping(b: float, v: float, s: float, t: float, p: Any, o: int) -> float:
    return b + p[o] * abs(v)


EFFECT = Effect(
    id="quadratic_drag",
    where=("cart_1", "cart_2"),
    equation="F = -c·v·|v|",
    parameters=(Parameter("c", "V s²/mm²", 0.0, -1e-3, 1e-3, "quadratic coefficient", (3e-6, -3e-6)),),
    hooks={"damping": _damping},
    tells_itself_by="curvature of the steady velocity over u",
    looks_like=("stribeck", "viscous_friction"),
    separating_experiment="plateaus at ±0.7…1 V and at ±3 V; b swallows 98 % of it at one amplitude",
    reference="I. Newton, Principia, 1687, book II",
    order=2,
)
