r"""An encoder wheel that is not centred: its reading wobbles once per turn, on the way P.

.. math:: y \leftarrow y + a_s \sin(2\pi x_2/P) + a_c \cos(2\pi x_2/P) .

Worked check: at a constant speed v the velocity reading wobbles by the fraction :math:`2\pi a/P`: 3 % for a = 0.1 mm
and P = 20 mm.
"""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.effects._effect import Effect, Parameter
from flexdrive_gym.drive.effects._wave import wave


def _reading(y: float, x: float, v: float, t: float, h: float, z: Any, oz: int, p: Any, o: int) -> float:
    if p[o] == 0.0 and p[o + 1] == 0.0:
        return y
    return y + wave(x, p[o], p[o + 1], p[o + 2])


EFFECT = Effect(
    id="encoder_eccentricity",
    where=("encoder_2",),
    equation="y ← y + a_sin·sin(2πx2/P) + a_cos·cos(2πx2/P)",
    parameters=(
        Parameter("a_sin", "mm", 0.0, -50.0, 50.0, "sine part", (0.3, -0.3)),
        Parameter("a_cos", "mm", 0.0, -50.0, 50.0, "cosine part", (0.3, -0.3)),
        Parameter("P", "mm", 20.0, 0.5, 500.0, "way of a turn", (10.0, 20.0, 50.0, 100.0), role="shape"),
    ),
    hooks={"reading": _reading},
    tells_itself_by="line in the spatial spectrum of the reading",
    looks_like=("cogging",),
    separating_experiment="constant speeds: the wobble of v2 grows with the speed, that of a force falls",
    reference="J. R. R. Mayer, High-resolution of rotary encoder analog quadrature signals, IEEE TIM 43(3), 1994",
    order=3,
)
