"""What surrounds the physics of a control period: command, encoders, reward, observation; up to LANES drives at a time."""

from __future__ import annotations

from typing import Any

import numpy as np

from flexdrive_gym.drive.compilation import inlined, shifted
from flexdrive_gym.drive.effects import WORKSPACE
from flexdrive_gym.drive.forces import W2, limited, rate_1, rate_2, readings
from flexdrive_gym.drive.layout import (
    COMMAND,
    DECAY_1,
    DECAY_2,
    EFFORT,
    ERROR,
    ERROR_SCALE,
    FAILURE,
    HORIZON,
    NOISE,
    NOISE_1,
    NOISE_2,
    OPEN,
    PERIOD,
    RATE,
    READ_1,
    READ_2,
    REFERENCE,
    ROW,
    SEEN,
    SPEED_1,
    SPEED_2,
    STROKE,
    TRACKING,
    TRAVEL,
    V1,
    V2,
    VOLTAGE,
    WEIGHT_EFFORT,
    WEIGHT_FAILURE,
    WEIGHT_RATE,
    WEIGHT_TRACKING,
    X1,
    X2,
    parameters_of,
    stride,
)
from flexdrive_gym.drive.sample import velocity

# the largest error that is charged
_FAR_MM = 1e4


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
def next_normal(seeds: Any, j: int) -> Any:
    """Return the next standard normal number of drive j's own stream (Box and Muller)."""
    u = 1.0 - next_random(seeds, j)
    return np.sqrt(-2.0 * np.log(u)) * np.cos(2.0 * np.pi * next_random(seeds, j))


@inlined
def act(n: int, actions: Any, task: Any, q: Any, state: Any, work: Any) -> None:
    """Limit the commands and charge their change."""
    voltage, weight, per_volt = task[VOLTAGE], task[WEIGHT_RATE], 1.0 / task[VOLTAGE]
    for i in range(n):
        old = state[COMMAND + i]
        new = limited(min(max(actions[i], -1.0), 1.0) * voltage, parameters_of(q, i))
        change = (new - old) * per_volt
        work[RATE + i] = -weight * change * change
        state[COMMAND + i] = new


@inlined
def draw_noise(low: int, n: int, task: Any, seeds: Any, work: Any) -> None:
    """Draw the noise of both encoders."""
    for i in range(n):
        work[NOISE_1 + i] = task[NOISE] * next_normal(seeds, low + i)
        work[NOISE_2 + i] = task[NOISE] * next_normal(seeds, low + i)


@inlined
def _differentiate(i: int, r1: float, r2: float, per_second: float, z: Any, p: Any, q: Any, state: Any) -> None:
    """Make velocities from new readings, of which there are so many per second, and keep both."""
    raw_1 = rate_1((r1 - state[READ_1 + i]) * per_second, z, p)
    raw_2 = rate_2((r2 - state[READ_2 + i]) * per_second, z, p)
    state[SPEED_1 + i] = velocity(raw_1, state[SPEED_1 + i], q[DECAY_1 + i])
    state[SPEED_2 + i] = velocity(raw_2, state[SPEED_2 + i], q[DECAY_2 + i])
    state[READ_1 + i] = r1
    state[READ_2 + i] = r2


@inlined
def sense_each(
    low: int, n: int, shared: bool, period: float, clock: Any, p: Any, z: Any, q: Any, state: Any, work: Any
) -> None:
    """Read the encoders of drives with further effects."""
    per_second = 1.0 / period
    for i in range(n):
        j = low + i
        mine, space = shifted(p, (0 if shared else j) * stride(z)), shifted(z, j * WORKSPACE)
        t = (clock[j] + 1) * period
        r1, r2 = readings(state[X1 + i], state[V1 + i], state[X2 + i], state[V2 + i], t, period, space, mine)
        _differentiate(i, r1 + work[NOISE_1 + i], r2 + work[NOISE_2 + i], per_second, space, mine, q, state)


@inlined
def delay_readings(low: int, n: int, late: int, clock: Any, line: Any, state: Any, work: Any) -> None:
    """Show the readings of ``late`` control periods ago; ``line`` is a ring of them per drive."""
    for i in range(n):
        j = low + i
        slot = shifted(line, (j * late + clock[j] % late) * 4)
        for k in range(4):
            work[SEEN + k * ROW + i] = slot[k]
            slot[k] = state[READ_1 + k * ROW + i]


@inlined
def tick(n: int, task: Any, clock: Any) -> None:
    """Advance the clocks; they stop one period after the time limit, where the reference ends."""
    last = int(task[HORIZON]) + 1
    for i in range(n):
        clock[i] = min(clock[i] + 1, last)


@inlined
def look_up(n: int, width: int, clock: Any, begin: Any, exact: Any, rounded: Any, reference: Any, shown: Any) -> None:
    """Look reference and preview up: copy a row of the table per drive.

    ``exact`` and ``rounded`` point to the table, whose rows are a double and ``width`` singles. The singles go to ``shown``
    drive by drive, in one piece: the processor finishes one store to another place per cycle.
    """
    if width == 4:
        for i in range(n):
            at = 3 * (begin[i] + clock[i])
            reference[i] = exact[at]
            here, there = shifted(rounded, 2 * at + 2), shifted(shown, 4 * i)
            there[0], there[1], there[2], there[3] = here[0], here[1], here[2], here[3]
    else:
        for i in range(n):
            at = (1 + (width + 1) // 2) * (begin[i] + clock[i])
            reference[i] = exact[at]
            for k in range(width):
                shown[width * i + k] = rounded[2 * at + 2 + k]


@inlined
def _scales(task: Any) -> tuple[float, float, float, float, float, float, float]:
    """Return what :func:`_judged` reads of the task, before the loop: within it the compiler would gather lane by lane."""
    return (
        task[TRAVEL],
        task[STROKE],
        1.0 / task[ERROR_SCALE],
        1.0 / task[VOLTAGE],
        -task[WEIGHT_TRACKING],
        -task[WEIGHT_EFFORT],
        -task[WEIGHT_FAILURE],
    )


@inlined
def _judged(i: int, scales: Any, q: Any, state: Any, work: Any) -> tuple[float, float, float, float, float]:
    """Compare the controlled cart (cart 2, or the only one) with the reference; charge error, effort and failure.

    Returns error, the three terms and by how much a limit is exceeded.
    """
    travel, stroke, per_mm, per_volt, tracking, effort, failure = scales
    x1, x2 = state[X1 + i], state[X2 + i]
    two = q[W2 * ROW + i] > 0.0
    error = work[REFERENCE + i] - (x2 if two else x1)
    # a drive that has run away may be past all numbers
    e, u = (error if abs(error) < _FAR_MM else _FAR_MM) * per_mm, state[COMMAND + i] * per_volt
    reach = max(abs(x1), abs(x2)) - travel
    beyond = max(reach, abs(x1 - x2) - stroke) if two else reach
    # nan is beyond every limit
    return error, tracking * e * e, effort * u * u, 0.0 if beyond <= 0.0 else failure, beyond


@inlined
def _judge(i: int, scales: Any, q: Any, state: Any, reward: Any, work: Any) -> None:
    _error, tracking, effort, failure, beyond = _judged(i, scales, q, state, work)
    reward[i] = tracking + effort + work[RATE + i] + failure
    work[OPEN + i] = beyond


@inlined
def judge(n: int, task: Any, q: Any, state: Any, reward: Any, work: Any) -> None:
    """Sum the reward up."""
    scales = _scales(task)
    for i in range(n):
        _judge(i, scales, q, state, reward, work)


@inlined
def sense_and_judge(n: int, task: Any, q: Any, state: Any, reward: Any, work: Any) -> None:
    """Read the encoders of drives with base effects, and do what :func:`judge` does: divisions take their time meanwhile."""
    scales, period = _scales(task), task[PERIOD]
    per_second = 1.0 / period
    for i in range(n):
        p = parameters_of(q, i)
        r1, r2 = readings(state[X1 + i], state[V1 + i], state[X2 + i], state[V2 + i], 0.0, period, None, p)
        _differentiate(i, r1 + work[NOISE_1 + i], r2 + work[NOISE_2 + i], per_second, None, p, q, state)
        _judge(i, scales, q, state, reward, work)


@inlined
def tell(n: int, task: Any, q: Any, state: Any, told: Any, work: Any) -> None:
    """Write down what :func:`judge` found, term by term."""
    scales = _scales(task)
    for i in range(n):
        error, tracking, effort, failure, _beyond = _judged(i, scales, q, state, work)
        told[REFERENCE + i] = work[REFERENCE + i]
        told[ERROR + i] = error
        told[TRACKING + i] = tracking
        told[EFFORT + i] = effort
        told[RATE + i] = work[RATE + i]
        told[FAILURE + i] = failure


@inlined
def conclude(n: int, horizon: float, clock: Any, terminated: Any, truncated: Any, work: Any) -> int:
    """Say whose episode ends and how; return how many do."""
    ended = 0
    for i in range(n):
        lost, over = not work[OPEN + i] <= 0.0, clock[i] >= horizon
        terminated[i] = lost
        truncated[i] = over & (not lost)
        ended += lost | over
    return ended
