"""Coils that touch, or an end stop: beyond ±δ0 the spring is stiffer by kb.

Worked check: with k = 0.095 V/mm, kb = 0.1 V/mm and δ0 = 10 mm a deflection of 12 mm carries 1.34 V instead of 1.14
V.
"""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.effects._effect import Effect, Parameter


def _spring(f: float, delta: float, rate: float, z: Any, oz: int, p: Any, o: int) -> float:
    return f + p[o] * (delta - min(max(delta, -p[o + 1]), p[o + 1]))


EFFECT = Effect(
    id="coil_bind",
    where=("spring",),
    equation="F = kb·(δ - clip(δ, ±δ0))",
    parameters=(
        Parameter("kb", "V/mm", 0.0, 0.0, 1e2, "additional stiffness", (0.05, 0.3)),
        Parameter("d0", "mm", 10.0, 0.1, 200.0, "deflection δ0 at which coils touch", (5.0, 10.0, 15.0), role="shape"),
    ),
    hooks={"spring": _spring},
    tells_itself_by="only near 3 Hz, where deflections are large",
    looks_like=("hardening_spring",),
    separating_experiment="sines at resonance of several amplitudes: below δ0 nothing changes",
    reference="S. W. Shaw, P. J. Holmes, A periodically forced piecewise linear oscillator, J. Sound Vib. 90(1), 1983",
)
