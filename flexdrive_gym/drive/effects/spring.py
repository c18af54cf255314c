"""The linear spring between the carts: k·(x1 - x2), part of Eq. (1)."""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.effects._effect import Effect, Parameter


def _spring(f: float, delta: float, rate: float, z: Any, oz: int, p: Any, o: int) -> float:
    return f + p[o] * delta


EFFECT = Effect(
    id="spring",
    where=("spring",),
    equation="F = k·δ,  δ = x1 - x2",
    parameters=(Parameter("k", "V/mm", 0.0, 0.0, 1e4, "stiffness", (0.1,)),),
    hooks={"spring": _spring},
    tells_itself_by="the resonance of v2",
    looks_like=("hardening_spring",),
    separating_experiment="sines near resonance at two amplitudes",
    reference="Lab 3 handout, Eq. (1)",
    base=True,
    symbols={"spring": ("k",)},
)
