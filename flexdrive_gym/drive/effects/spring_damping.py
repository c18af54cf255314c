"""Damping inside the spring: C·(v1 - v2), part of Eq. (1); the handout assumes C = 0."""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.effects._effect import Effect, Parameter


def _spring(f: float, delta: float, rate: float, z: Any, oz: int, p: Any, o: int) -> float:
    return f + p[o] * rate


EFFECT = Effect(
    id="spring_damping",
    where=("spring",),
    equation="F = C·(v1 - v2)",
    parameters=(Parameter("C", "V s/mm", 0.0, 0.0, 1.0, "damping of the spring", (2e-4, 1e-3)),),
    hooks={"spring": _spring},
    tells_itself_by="height of the resonance",
    looks_like=("viscous_friction", "spring_hysteresis"),
    separating_experiment="sines around resonance; 80 % of the effect is swallowed by b2 elsewhere",
    reference="Lab 3 handout, Eq. (1)",
    base=True,
    symbols={"spring": ("C",)},
)
