"""Encoders that fail: frozen for a while, or losing counts, as they are seen in a student's recordings."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from baselines.rig_simulator.kernel import SAMPLE_S, FloatArray
from baselines.rig_simulator.truth import Fault

SHORTEST_S, LONGEST_S = 0.02, 0.4
# a fault that hides less travel than this is none
MOVING_MM_S = 30.0


def place_faults(speeds: Mapping[str, FloatArray], count: int, rng: np.random.Generator) -> tuple[Fault, ...]:
    """Place faults in open-loop recordings, where the cart moves.

    Parameters
    ----------
    speeds
        Recording to velocities [mm/s], shape (2, n).
    count
        How many.
    rng
        Source of randomness.
    """
    names = sorted(speeds)
    faults: list[Fault] = []
    for _ in range(1000 * count):
        if len(faults) == count:
            break
        name, cart = names[int(rng.integers(len(names)))], int(rng.integers(2))
        length = int(1e3 * np.exp(rng.uniform(np.log(SHORTEST_S), np.log(LONGEST_S))))
        v = speeds[name][cart]
        first = int(rng.integers(200, len(v) - length - 200))
        inside = np.abs(v[first : first + length])
        if inside.mean() < MOVING_MM_S or inside[:10].mean() < MOVING_MM_S:
            continue
        if any(f.recording == name for f in faults):
            continue
        how = "lost" if rng.random() < 0.25 else "frozen"
        start, end = first * SAMPLE_S, (first + length) * SAMPLE_S
        faults.append(Fault(name, f"encoder_{cart + 1}", round(start, 3), round(end, 3), how))
    return tuple(faults)


def broken(counts: FloatArray, fault: Fault, rng: np.random.Generator) -> FloatArray:
    """Return counts, shape (2, n), with a fault inside."""
    row = int(fault.where[-1]) - 1
    first, last = round(fault.start_s / SAMPLE_S), round(fault.end_s / SAMPLE_S)
    result = counts.copy()
    steps = np.diff(counts[row], prepend=0.0)
    inside = slice(first, last)
    if fault.how == "lost":
        # most pulses are missed, in bursts
        steps[inside] *= np.repeat(rng.random((last - first) // 4 + 1) < 0.25, 4)[: last - first]
    else:
        steps[inside] = 0.0
    result[row] = np.cumsum(steps)
    return result
