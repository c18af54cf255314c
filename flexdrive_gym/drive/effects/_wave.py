"""What repeats with position: one wave, by its two amplitudes and its period."""

from __future__ import annotations

import numpy as np

from flexdrive_gym.drive.compilation import inlined


@inlined
def wave(x: float, a_sin: float, a_cos: float, period: float) -> float:
    """Return the wave at position x [mm], in the unit of its amplitudes."""
    phase = 2.0 * np.pi * x / period
    value = a_sin * np.sin(phase)
    # a search that does not know where a run began has one amplitude, and a cosine takes its time
    return value if a_cos == 0.0 else value + a_cos * np.cos(phase)
