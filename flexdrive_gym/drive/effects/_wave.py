"""What repeats with position: one wave, by its two amplitudes and its period."""

from __future__ import annotations

import numpy as np

from flexdrive_gym.drive.compilation import inlined


@inlined
def wave(x: float, a_sin: float, a_cos: float, period: float) -> float:
    """Return the wave at position x [mm], in the unit of its amplitudes."""
    phase = 2.0 * np.pi * x / period
    # a search looks at one amplitude at a time, and either function takes its time
    value = a_sin * np.sin(phase) if a_sin != 0.0 else 0.0
    return value if a_cos == 0.0 else value + a_cos * np.cos(phase)
