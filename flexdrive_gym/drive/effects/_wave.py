"""What repeats with position: one wave, by its two amplitudes and its period."""

from __future__ import annotations

import numpy as np

from flexdrive_gym.drive.compilation import inlined
from flexdrive_gym.drive.simd.pack import sine_and_cosine


@inlined
def wave(x: float, a_sin: float, a_cos: float, period: float) -> float:
    """Return the wave at position x [mm], in the unit of its amplitudes."""
    phase = 2.0 * np.pi * x / period
    # a search looks at one amplitude at a time, and either function takes its time
    if a_cos == 0.0:
        return a_sin * np.sin(phase)
    if a_sin == 0.0:
        return a_cos * np.cos(phase)
    sine, cosine = sine_and_cosine(phase)
    return a_sin * sine + a_cos * cosine
