"""An encoder whose counts are not the length they are taken for: a wheel worn, a belt of another pitch.

Second in an encoder's order: play, scale, eccentricity, delay, counts. Worked check: s = 0.01 makes x2 grow by 1 %,
so v2/v1 tends to 1.01 at low frequency. The same on encoder 1 cannot be told from a scaled drive, so it is not in the
catalogue.
"""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.effects._effect import Effect, Parameter


def _reading(y: float, x: float, v: float, t: float, h: float, z: Any, oz: int, p: Any, o: int) -> float:
    return y * (1.0 + p[o])


EFFECT = Effect(
    id="encoder_scale",
    where=("encoder_2",),
    equation="y ← (1 + s)·y",
    parameters=(Parameter("s", "1", 0.0, -0.5, 0.5, "relative error of the scale", (0.01, -0.01)),),
    hooks={"reading": _reading},
    tells_itself_by="v2/v1 at zero frequency",
    looks_like=(),
    separating_experiment="slow constant speed",
    reference="J. Borenstein, L. Feng, Measurement and correction of systematic odometry errors, IEEE TRA 12(6), 1996",
    order=2,
)
