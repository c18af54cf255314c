"""A spring that pulls otherwise than it pushes: k2·δ².

The stiffness is k + 2·k2·δ: larger when compressed, smaller when stretched (or the reverse). Worked check: with k =
0.095 V/mm and k2 = 5e-4 V/mm² the forces at ±10 mm are 1.00 V and -0.90 V.
"""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.effects._effect import Effect, Parameter


def _spring(f: float, delta: float, rate: float, z: Any, oz: int, p: Any, o: int) -> float:
    return f + p[o] * delta * delta


EFFECT = Effect(
    id="asymmetric_spring",
    where=("spring",),
    equation="F = k2·δ²",
    parameters=(Parameter("k2", "V/mm²", 0.0, -1e-1, 1e-1, "quadratic stiffness", (5e-4, -5e-4)),),
    hooks={"spring": _spring},
    tells_itself_by="even harmonics near resonance",
    looks_like=("coulomb_asymmetry",),
    separating_experiment="sines near resonance and far below it: friction's even part stays, the spring's goes",
    reference="A. H. Nayfeh, D. T. Mook, Nonlinear Oscillations, 1979, ch. 2",
)
