r"""Coulomb friction that changes along the track: a tight spot, a bent rail, a worn belt.

.. math:: d(x) = d + a_s \sin(2\pi x/P) + a_c \cos(2\pi x/P) + g\,x ,

never below zero; the phase of the ripple is in its two amplitudes. x is counted from the run's zero, or from the
track's in an anchored replay. Worked check: with d = 0.357 V, :math:`a_s` = 0.05 V and P = 200 mm the level is 0.407
V at x = 50 mm.
"""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.effects._effect import Effect, Parameter
from flexdrive_gym.drive.effects._wave import wave


def _friction(d: float, x: float, v: float, s: float, fs: float, t: float, p: Any, o: int) -> float:
    if p[o] == 0.0 and p[o + 1] == 0.0 and p[o + 2] == 0.0:
        return d
    return d + wave(x, p[o], p[o + 1], p[o + 3]) + p[o + 2] * x


EFFECT = Effect(
    id="position_friction",
    where=("cart_1", "cart_2"),
    equation="d ← d + a_sin·sin(2πx/P) + a_cos·cos(2πx/P) + slope·x",
    parameters=(
        Parameter("a_sin", "V", 0.0, -4.0, 4.0, "sine part of the ripple", (0.05, -0.05)),
        Parameter("a_cos", "V", 0.0, -4.0, 4.0, "cosine part of the ripple", (0.05, -0.05)),
        Parameter("slope", "V/mm", 0.0, -0.1, 0.1, "trend along the track", (3e-4, -3e-4)),
        Parameter("P", "mm", 200.0, 20.0, 2000.0, "period along the track", (50.0, 100.0, 200.0, 400.0), role="shape"),
    ),
    hooks={"friction": _friction},
    tells_itself_by="friction changes along the track",
    looks_like=("cogging",),
    separating_experiment="the same drive from another start position",
    reference="B. Armstrong-Hélouvry, Control of Machines with Friction, 1991 (position-dependent friction)",
    order=2,
)
