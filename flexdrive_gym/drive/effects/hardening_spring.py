"""A spring whose stiffness changes with amplitude, alike in both directions: k3·δ³ (Duffing).

k3 > 0 hardens, k3 < 0 softens. Under a deflection of amplitude A the describing function is k + ¾·k3·A², so the
resonance moves by about ⅜·k3·A²/k. Worked check: with k = 0.095 V/mm, k3 = 4e-5 V/mm³ and A = 15 mm the stiffness
grows by 7.1 %, the resonance by 3.5 %.
"""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.effects._effect import Effect, Parameter


def _spring(f: float, delta: float, rate: float, z: Any, oz: int, p: Any, o: int) -> float:
    return f + p[o] * delta * delta * delta


EFFECT = Effect(
    id="hardening_spring",
    where=("spring",),
    equation="F = k3·δ³",
    parameters=(Parameter("k3", "V/mm³", 0.0, -1e-2, 1e-2, "cubic stiffness", (4e-5, -2e-5)),),
    hooks={"spring": _spring},
    tells_itself_by="resonance bends with amplitude, third harmonic",
    looks_like=("spring_damping", "coupling_backlash", "coil_bind"),
    separating_experiment="small sine near resonance: a backlash softens there, a cubic becomes linear",
    reference="G. Duffing, Erzwungene Schwingungen bei veränderlicher Eigenfrequenz, 1918",
)
