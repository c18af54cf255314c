"""Encoder counts: a position is known to one quantum."""

from __future__ import annotations

from typing import Any

import numpy as np

from flexdrive_gym.drive.effects._effect import Effect, Parameter


def _reading(y: float, x: float, v: float, t: float, h: float, z: Any, oz: int, p: Any, o: int) -> float:
    q = p[o]
    if q == 0.0:
        return y
    return q * np.floor(y / q + 0.5)


EFFECT = Effect(
    id="encoder_quantisation",
    where=("encoder_1", "encoder_2"),
    equation="x ← q·round(x/q)",
    parameters=(Parameter("quantum", "mm", 0.0, 0.0, 10.0, "length of one count", (0.0046592,)),),
    hooks={"reading": _reading},
    tells_itself_by="raw-difference velocities on a grid of q/Ts",
    reference="0.0046592 mm on the handout's rig",
    base=True,
    order=9,
)
