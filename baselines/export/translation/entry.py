"""Where the exported step is entered: one sample of the rig, as :mod:`flexdrive_gym.drive.kernels` goes from one to the next."""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.forces import limited
from flexdrive_gym.drive.sample import advance, clear, measure, power_up


def first_sample(
    x1: float, v1: float, x2: float, v2: float, sample_time: float, memory: Any, z: Any, p: Any
) -> tuple[float, float, float, float]:
    """Begin a run in a state; return what the encoders report: x1, x2, v1, v2."""
    clear(v1, v2, memory, z, p)
    r1, r2, q1, q2 = power_up(x1, v1, x2, v2, sample_time, memory, z, p)
    return r1, r2, q1, q2


def one_sample(
    step: Any,
    x1: float,
    v1: float,
    x2: float,
    v2: float,
    command: float,
    t: float,
    sample_time: float,
    substeps: int,
    memory: Any,
    z: Any,
    p: Any,
) -> tuple[float, float, float, float, float, float, float, float]:
    """Advance by one sample under a held command; return the states x1, v1, x2, v2 and the readings x1, x2, v1, v2."""
    u = limited(command, p)
    x1, v1, x2, v2 = advance(step, x1, v1, x2, v2, u, t, sample_time, substeps, None, memory, z, p)
    r1, r2, q1, q2 = measure(x1, v1, x2, v2, t + sample_time, sample_time, memory, z, p)
    return x1, v1, x2, v2, r1, r2, q1, q2
