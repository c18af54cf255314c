r"""Coils that touch, or an end stop: beyond ±δ0 the spring is stiffer by kb.

Coils touch one after another, and a contact is a point first, so its stiffness grows with the way b beyond δ0,

.. math:: F = k_b b \left(|b|/\delta_0\right)^n ,

with n = 0 where all is there at once and n = ½ for the contact of two balls (H. Hertz, 1881). Worked check: with k = 0.095 V/mm,
kb = 0.1 V/mm and δ0 = 10 mm a deflection of 12 mm carries 1.34 V instead of 1.14 V; with n = ½ 1.23 V.
"""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.effects._effect import Effect, Parameter


def _spring(f: float, delta: float, rate: float, z: Any, oz: int, p: Any, o: int) -> float:
    beyond = delta - min(max(delta, -p[o + 1]), p[o + 1])
    if p[o + 2] == 0.0:
        return f + p[o] * beyond
    return f + p[o] * beyond * (abs(beyond) / p[o + 1]) ** p[o + 2]


EFFECT = Effect(
    id="coil_bind",
    where=("spring",),
    equation="F = kb·b·(|b|/δ0)^n, b = δ - clip(δ, ±δ0)",
    parameters=(
        Parameter("kb", "V/mm", 0.0, 0.0, 1e2, "additional stiffness", (0.05, 0.3)),
        Parameter("d0", "mm", 10.0, 0.1, 200.0, "deflection δ0 at which coils touch", (5.0, 10.0, 15.0), role="shape"),
        Parameter("n", "1", 0.0, 0.0, 2.0, "growth of the contact's stiffness with the way", (0.5,), finer=True),
    ),
    hooks={"spring": _spring},
    tells_itself_by="only near 3 Hz, where deflections are large",
    looks_like=("hardening_spring",),
    separating_experiment="sines at resonance of several amplitudes: below δ0 nothing changes",
    reference="S. W. Shaw, P. J. Holmes, A periodically forced piecewise linear oscillator, J. Sound Vib. 90(1), 1983",
)
