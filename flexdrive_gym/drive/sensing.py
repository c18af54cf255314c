"""What surrounds the physics of a control period: command, encoders, reward, observation; up to LANES drives at a time."""

from __future__ import annotations

from typing import Any

import numpy as np

from flexdrive_gym.drive.compilation import inlined, shifted
from flexdrive_gym.drive.effects import N_PARAMETERS
from flexdrive_gym.drive.forces import W2, limited, readings
from flexdrive_gym.drive.layout import (
    COMMAND,
    DECAYS,
    EFFORT,
    ERROR,
    ERROR_SCALE,
    FAILURE,
    LANES,
    NOISES,
    OPEN,
    PARAMETERS,
    RATE,
    READ_1,
    READ_2,
    REFERENCE,
    SPEED_1,
    SPEED_2,
    STROKE,
    TRACKING,
    TRAVEL,
    VOLTAGE,
    WEIGHT_EFFORT,
    WEIGHT_FAILURE,
    WEIGHT_RATE,
    WEIGHT_TRACKING,
    X1,
    X2,
    parameters_of,
)
from flexdrive_gym.drive.sample import velocity


@inlined
def next_random(seeds: Any, j: int) -> float:
    """Return the next uniform number in [0, 1) of drive j's own stream (SplitMix64; Steele, Lea, Flood 2014)."""
    s = seeds[j] + np.uint64(0x9E3779B97F4A7C15)
    seeds[j] = s
    s = (s ^ (s >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    s = (s ^ (s >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    s = s ^ (s >> np.uint64(31))
    return np.float64(s >> np.uint64(11)) * (1.0 / 9007199254740992.0)


@inlined
def next_normal(seeds: Any, j: int) -> float:
    """Return the next standard normal number of drive j's own stream (Box and Muller)."""
    u = 1.0 - next_random(seeds, j)
    return np.sqrt(-2.0 * np.log(u)) * np.cos(2.0 * np.pi * next_random(seeds, j))


@inlined
def act(n: int, actions: Any, task: Any, work: Any) -> None:
    """Limit the commands and charge their change."""
    voltage, weight, per_volt = task[VOLTAGE], task[WEIGHT_RATE], 1.0 / task[VOLTAGE]
    for i in range(n):
        old = work[COMMAND * LANES + i]
        new = limited(min(max(actions[i], -1.0), 1.0) * voltage, parameters_of(work, i))
        change = (new - old) * per_volt
        work[RATE * LANES + i] = -weight * change * change
        work[COMMAND * LANES + i] = new


@inlined
def draw_noise(low: int, n: int, noise: float, seeds: Any, work: Any) -> None:
    """Draw the noise of both encoders."""
    for i in range(n):
        work[NOISES + i] = noise * next_normal(seeds, low + i)
        work[NOISES + LANES + i] = noise * next_normal(seeds, low + i)


@inlined
def _differentiate(i: int, r1: float, r2: float, period: float, work: Any) -> None:
    """Make velocities from new readings and keep both."""
    work[SPEED_1 * LANES + i] = velocity(
        r1, work[READ_1 * LANES + i], work[SPEED_1 * LANES + i], work[DECAYS + i], period
    )
    work[SPEED_2 * LANES + i] = velocity(
        r2, work[READ_2 * LANES + i], work[SPEED_2 * LANES + i], work[DECAYS + LANES + i], period
    )
    work[READ_1 * LANES + i] = r1
    work[READ_2 * LANES + i] = r2


@inlined
def sense(low: int, n: int, shared: bool, period: float, clock: Any, p: Any, z: Any, scratch: Any, work: Any) -> None:
    """Read the encoders."""
    for i in range(n):
        x1, x2 = work[X1 * LANES + i], work[X2 * LANES + i]
        if z is None:
            r1, r2 = readings(x1, x2, 0.0, None, parameters_of(work, i))
        else:
            j = low + i
            q = shifted(p, (0 if shared else j) * N_PARAMETERS)
            r1, r2 = readings(x1, x2, (clock[j] + 1) * period, scratch, q)
        _differentiate(i, r1 + work[NOISES + i], r2 + work[NOISES + LANES + i], period, work)


@inlined
def delay_readings(low: int, n: int, late: int, clock: Any, line: Any, work: Any) -> None:
    """Swap the readings for those of ``late`` control periods ago; ``line`` is a ring of them per drive."""
    for i in range(n):
        j = low + i
        slot = shifted(line, (j * late + clock[j] % late) * 4)
        for k in range(4):
            now = work[(READ_1 + k) * LANES + i]
            work[(READ_1 + k) * LANES + i] = slot[k]
            slot[k] = now


@inlined
def judge(n: int, task: Any, work: Any) -> None:
    """Compare the controlled cart (cart 2, or the only one) with the reference; charge error, effort and failure."""
    per_error, per_volt, travel, stroke = 1.0 / task[ERROR_SCALE], 1.0 / task[VOLTAGE], task[TRAVEL], task[STROKE]
    tracking, effort, failure = task[WEIGHT_TRACKING], task[WEIGHT_EFFORT], task[WEIGHT_FAILURE]
    for i in range(n):
        x1, x2 = work[X1 * LANES + i], work[X2 * LANES + i]
        two = work[PARAMETERS + W2 * LANES + i] > 0.0
        error = work[REFERENCE * LANES + i] - (x2 if two else x1)
        e, u = error * per_error, work[COMMAND * LANES + i] * per_volt
        reach = max(abs(x1), abs(x2)) - travel
        stretch = abs(x1 - x2) - stroke if two else -1.0
        work[ERROR * LANES + i] = error
        work[TRACKING * LANES + i] = -tracking * e * e
        work[EFFORT * LANES + i] = -effort * u * u
        work[FAILURE * LANES + i] = -failure if max(reach, stretch) > 0.0 else 0.0
        work[OPEN + i] = max(reach, stretch)


@inlined
def _entry(value: float, scale: Any, bound: Any, k: int) -> float:
    return min(max(value * scale[k], -bound[k]), bound[k])


@inlined
def observe(
    read_1: float,
    read_2: float,
    speed_1: float,
    speed_2: float,
    command: float,
    clock: int,
    sensing: int,
    previews: int,
    reference: Any,
    ahead: Any,
    scale: Any,
    bound: Any,
    out: Any,
) -> None:
    """Write one drive's observation: position and velocity of the chosen encoder(s), error, reference, command, preview."""
    k = 0
    if sensing != 2:
        out[0] = _entry(read_1, scale, bound, 0)
        out[1] = _entry(speed_1, scale, bound, 1)
        k = 2
    if sensing != 1:
        out[k] = _entry(read_2, scale, bound, k)
        out[k + 1] = _entry(speed_2, scale, bound, k + 1)
        k += 2
    now = reference[clock]
    out[k] = _entry(now - (read_1 if sensing == 1 else read_2), scale, bound, k)
    out[k + 1] = _entry(now, scale, bound, k + 1)
    out[k + 2] = _entry(command, scale, bound, k + 2)
    k += 3
    for i in range(previews):
        out[k + i] = _entry(reference[clock + ahead[i]], scale, bound, k + i)
