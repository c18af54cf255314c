"""What repeats with position: one wave, by its two amplitudes and its period."""

from __future__ import annotations

import numpy as np

from flexdrive_gym.drive.compilation import inlined
from flexdrive_gym.drive.simd.functions import sine_and_cosine


@inlined
def wave(x: float, a_sin: float, a_cos: float, period: float) -> float:
    """Return the wave at position x [mm], in the unit of its amplitudes."""
    sine, cosine = sine_and_cosine(x * (2.0 * np.pi / period))
    return a_sin * sine + a_cos * cosine
