"""Which recordings repeat one experiment: they err alike, so they are one unit of validation.

A model that lacks something errs in the same way whenever the same is done. Predicting one replicate from the others
tests run-to-run variability, and no physics.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from flexdrive_gym.recording import FloatArray, Recording

IntArray = npt.NDArray[np.int64]
# commands that differ by less of their rms say the same; amplitudes and frequencies of experiments are set in steps of
# ten per cent
_ALIKE = 0.07
# samples at which commands are compared
_SAMPLES = 400
# fewer experiments than this each tell something that no other does, and none can be predicted from the rest: every
# recording is a unit then
FEWEST = 8


def experiments(recordings: Sequence[Recording]) -> IntArray:
    """Return the experiment of every recording, numbered from 0, shape (R,); every recording for itself where they are few."""
    units: list[int] = []
    seen: list[FloatArray] = []
    for recording in recordings:
        own = _command(recording)
        near = [i for i, other in enumerate(seen) if _differ(own, other) < _ALIKE]
        if not near:
            seen.append(own)
        units.append(near[0] if near else len(seen) - 1)
    if len(seen) < FEWEST:
        return np.arange(len(recordings), dtype=np.int64)
    return np.array(units, dtype=np.int64)


def _command(recording: Recording) -> FloatArray:
    u = recording.u if recording.xr is None else recording.xr
    moving = np.flatnonzero(u != u[0])
    part = u[max(int(moving[0]) - 1, 0) :] if len(moving) else u
    at = np.arange(0, min(len(part), 2000), max(1, len(u) // _SAMPLES))
    return np.asarray(part[at], dtype=np.float64)


def _differ(a: FloatArray, b: FloatArray) -> float:
    n = min(len(a), len(b))
    scale = float(np.sqrt(np.mean(a[:n] ** 2) + np.mean(b[:n] ** 2))) / np.sqrt(2.0)
    return float(np.sqrt(np.mean((a[:n] - b[:n]) ** 2)) / max(scale, 1e-300))
