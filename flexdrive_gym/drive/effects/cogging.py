r"""Torque ripple of the motor, or the mesh of pinion and rack: a force that repeats along the way of cart 1.

.. math:: F = a_s \sin(2\pi x_1/P) + a_c \cos(2\pi x_1/P) ,

two amplitudes instead of one and a phase, so that a fit is linear in them. Worked check: it is conservative; over a
period P it takes and gives :math:`|a|\,P/\pi`.
"""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.effects._effect import Effect, Parameter
from flexdrive_gym.drive.effects._wave import wave


def _cart(f: float, x: float, v: float, s: float, dx: float, t: float, z: Any, oz: int, p: Any, o: int) -> float:
    if p[o] == 0.0 and p[o + 1] == 0.0:
        return f
    return f + wave(x, p[o], p[o + 1], p[o + 2])


EFFECT = Effect(
    id="cogging",
    where=("drivetrain",),
    equation="F = a_sin·sin(2πx1/P) + a_cos·cos(2πx1/P)",
    parameters=(
        Parameter("a_sin", "V", 0.0, -4.0, 4.0, "sine part", (0.08, -0.08)),
        Parameter("a_cos", "V", 0.0, -4.0, 4.0, "cosine part", (0.08, -0.08)),
        Parameter("P", "mm", 20.0, 0.5, 500.0, "period along the track", (5.0, 10.0, 20.0, 40.0), role="shape"),
    ),
    hooks={"cart:cart_1": _cart},  # type: ignore[dict-item]
    tells_itself_by="a line in the spatial spectrum of the missing force",
    looks_like=("position_friction", "encoder_eccentricity"),
    separating_experiment="slow constant speed both ways: cogging keeps its sign, friction changes it",
    reference="D. C. Hanselman, Brushless Permanent-Magnet Motor Design, 1994",
)
