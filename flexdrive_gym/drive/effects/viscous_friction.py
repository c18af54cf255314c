"""Viscous friction on each cart: b·v, part of Eq. (1)."""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.effects._effect import Effect, Parameter


def _damping(b: float, v: float, s: float, t: float, p: Any, o: int) -> float:
    return b + p[o]


EFFECT = Effect(
    id="viscous_friction",
    where=("cart_1", "cart_2"),
    equation="F = -b·v",
    parameters=(Parameter("b", "V s/mm", 0.0, 0.0, 1e3, "viscous damping", (0.005,)),),
    hooks={"damping": _damping},
    tells_itself_by="steady velocity proportional to u; the real pole -p",
    looks_like=("quadratic_drag", "stribeck"),
    separating_experiment="plateaus at several amplitudes; back-EMF and b1 are never separable from u and v alone",
    reference="Lab 3 handout, Eq. (1)",
    base=True,
    symbols={"cart_1": ("b1",), "cart_2": ("b2",)},
)
