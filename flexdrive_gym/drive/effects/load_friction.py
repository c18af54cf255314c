"""Friction that scales with the load: the spring pulls slightly aside and presses the cart on its rail.

The level gains μ·|Fs| with Fs the spring's force. Worked check: a spring of 0.095 V/mm stretched by 10 mm presses
with 0.95 V, so μ = 0.03 adds 0.029 V.
"""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.effects._effect import Effect, Parameter


def _friction(d: float, x: float, v: float, s: float, fs: float, t: float, p: Any, o: int) -> float:
    return d + p[o] * abs(fs)


EFFECT = Effect(
    id="load_friction",
    where=("cart_1", "cart_2"),
    equation="d ← d + μ·|Fs|",
    parameters=(Parameter("mu", "1", 0.0, 0.0, 0.5, "share of the spring's force", (0.03, 0.1)),),
    hooks={"friction": _friction},
    tells_itself_by="friction scales with the spring's force",
    looks_like=("spring_damping",),
    separating_experiment="sines around resonance: this loss grows with δ, that of C with its rate",
    reference="G. Amontons, De la résistance causée dans les machines, 1699",
    order=4,
)
