"""Many drives in one compiled call: the kernels behind the single and the batched environment.

Nothing is integrated here: :mod:`~flexdrive_gym.drive.lanes` does that, :mod:`~flexdrive_gym.drive.sensing` the rest of a
control period, and :mod:`~flexdrive_gym.drive.layout` says where everything is.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from flexdrive_gym.drive.compilation import (
    flags_at,
    floats_at,
    inlined,
    integers_at,
    kernel,
    naturals_at,
    pointer,
    shifted,
    singles_at,
)
from flexdrive_gym.drive.effects import N_PARAMETERS, N_STATES
from flexdrive_gym.drive.forces import W2, readings
from flexdrive_gym.drive.lanes import TABLE_COLUMNS, integrate_each, integrate_lanes, load_own, load_shared
from flexdrive_gym.drive.layout import (
    A_ACTIONS,
    A_AHEAD,
    A_BOUND,
    A_CLOCK,
    A_DECAYS,
    A_FACTOR,
    A_HIGHEST,
    A_INVERSE,
    A_LINE,
    A_LOWEST,
    A_MEMORY,
    A_NOMINAL,
    A_OBSERVATION,
    A_P,
    A_PICKS,
    A_REFERENCES,
    A_REWARD,
    A_ROW,
    A_SCALE,
    A_SCRATCH,
    A_SEEDS,
    A_STATE,
    A_TABLES,
    A_TASK,
    A_TERMINATED,
    A_TRUNCATED,
    A_WHICH,
    A_WORK,
    CARRIED,
    COMMAND,
    DRAWN,
    DRIVES,
    EFFORT,
    ENDED,
    ENTRIES,
    ERROR,
    FAILURE,
    HIGH,
    HORIZON,
    JOINT,
    LANES,
    LATE,
    LEAPS,
    LOW,
    MODELS,
    NOISE,
    NOISES,
    ONE_BY_ONE,
    OPEN,
    PERIOD,
    PREVIEWS,
    RATE,
    READ_1,
    READ_2,
    REFERENCE,
    REFERENCES,
    SAMPLES,
    SENSING,
    SPEED_1,
    SPEED_2,
    STATE_ROWS,
    SUBSTEPS,
    TELLS,
    TRACKING,
)
from flexdrive_gym.drive.sample import CUTOFF_1, CUTOFF_2, MEMORY, decay
from flexdrive_gym.drive.sensing import act, delay_readings, draw_noise, judge, next_normal, next_random, observe, sense
from flexdrive_gym.drive.step import tabulate


@inlined
def _refer(begin: int, n: int, horizon: int, samples: int, clock: Any, row: Any, references: Any, work: Any) -> None:
    """Advance the clocks and look the reference up; it ends one period after the time limit."""
    for i in range(n):
        now = min(clock[begin + i] + 1, horizon + 1)
        clock[begin + i] = now
        work[REFERENCE * LANES + i] = references[row[begin + i] * samples + now]


@inlined
def _conclude(
    begin: int, n: int, horizon: float, clock: Any, reward: Any, terminated: Any, truncated: Any, work: Any
) -> int:
    """Sum the reward up and say whose episode ends and how; return how many do."""
    ended = 0
    for i in range(n):
        lost = work[OPEN + i] > 0.0
        over = clock[begin + i] >= horizon
        terminated[begin + i] = 1 if lost else 0
        truncated[begin + i] = 1 if over and not lost else 0
        ended += 1 if lost or over else 0
    for i in range(n):
        reward[begin + i] = (
            work[TRACKING * LANES + i] + work[EFFORT * LANES + i] + work[RATE * LANES + i] + work[FAILURE * LANES + i]
        )
    return ended


@inlined
def _observe_lanes(begin: int, n: int, block: Any, clock: Any, row: Any, references: Any, work: Any) -> None:
    ahead, scale = integers_at(block[A_AHEAD]), floats_at(block[A_SCALE])
    bound, observation = floats_at(block[A_BOUND]), singles_at(block[A_OBSERVATION])
    sensing, previews, samples, entries = block[SENSING], block[PREVIEWS], block[SAMPLES], block[ENTRIES]
    for i in range(n):
        j = begin + i
        observe(
            work[READ_1 * LANES + i],
            work[READ_2 * LANES + i],
            work[SPEED_1 * LANES + i],
            work[SPEED_2 * LANES + i],
            work[COMMAND * LANES + i],
            clock[j],
            sensing,
            previews,
            shifted(references, row[j] * samples),
            ahead,
            scale,
            bound,
            shifted(observation, j * entries),
        )


@kernel
def step_fleet(address: int, z: Any) -> None:
    """Advance drives by one control period and observe them.

    Parameters
    ----------
    address
        Of a block of integers: which drives, sizes and the addresses of arrays; see :mod:`~flexdrive_gym.drive.layout`.
        Whoever calls holds the block and the arrays.
    z : ndarray, shape (n, states), or None
        Additional states where some drive has effects beyond the base.
    """
    block = integers_at(address)
    low, high, drives, shared = block[LOW], block[HIGH], block[DRIVES], block[MODELS] == 1
    task, state, actions = floats_at(block[A_TASK]), floats_at(block[A_STATE]), floats_at(block[A_ACTIONS])
    clock, row, seeds = integers_at(block[A_CLOCK]), integers_at(block[A_ROW]), naturals_at(block[A_SEEDS])
    p, decays, work = floats_at(block[A_P]), floats_at(block[A_DECAYS]), floats_at(block[A_WORK])
    scratch, references, picks = (
        floats_at(block[A_SCRATCH]),
        floats_at(block[A_REFERENCES]),
        integers_at(block[A_PICKS]),
    )
    extra, late, substeps, leaps = pointer(z), block[LATE], block[SUBSTEPS], block[LEAPS]
    period, noise = task[PERIOD], task[NOISE]
    told = STATE_ROWS if block[TELLS] == 1 else CARRIED
    most, ended = min(LANES, high - low), 0
    if shared:
        load_shared(most, p, decays, work)
    for i in range(most):
        work[NOISES + i] = 0.0
        work[NOISES + LANES + i] = 0.0
    for begin in range(low, high, LANES):
        n = min(LANES, high - begin)
        if not shared:
            load_own(begin, n, p, decays, work)
        for k in range(CARRIED):
            column = shifted(state, k * drives + begin)
            for i in range(n):
                work[k * LANES + i] = column[i]
        act(n, shifted(actions, begin), task, work)
        if z is None and block[ONE_BY_ONE] == 0:
            integrate_lanes(n, leaps, period / leaps, (substeps + leaps - 1) // leaps, shared, picks, work)
        else:
            tables, memory = floats_at(block[A_TABLES]), floats_at(block[A_MEMORY])
            integrate_each(begin, n, period, substeps, shared, clock, p, tables, memory, extra, scratch, work)
        if noise > 0.0:
            draw_noise(begin, n, noise, seeds, work)
        sense(begin, n, shared, period, clock, p, extra, scratch, work)
        _refer(begin, n, int(task[HORIZON]), block[SAMPLES], clock, row, references, work)
        judge(n, task, work)
        for k in range(told):
            column = shifted(state, k * drives + begin)
            for i in range(n):
                column[i] = work[k * LANES + i]
        if late > 0:
            delay_readings(begin, n, late, clock, floats_at(block[A_LINE]), work)
        ended += _conclude(
            begin,
            n,
            task[HORIZON],
            clock,
            floats_at(block[A_REWARD]),
            flags_at(block[A_TERMINATED]),
            flags_at(block[A_TRUNCATED]),
            work,
        )
        _observe_lanes(begin, n, block, clock, row, references, work)
    block[ENDED] = ended


@inlined
def _draw_parameters(j: int, q: Any, block: Any, seeds: Any) -> None:
    """Draw the randomised parameters: uniform between bounds, or jointly normal by a Cholesky factor, within them."""
    n, joint = block[DRAWN], block[JOINT] == 1
    nominal, which, inverse = (
        floats_at(block[A_NOMINAL]),
        integers_at(block[A_WHICH]),
        integers_at(block[A_INVERSE]),
    )
    low, high = floats_at(block[A_LOWEST]), floats_at(block[A_HIGHEST])
    factor, normal = floats_at(block[A_FACTOR]), floats_at(block[A_WORK])
    for i in range(n):
        normal[i] = next_normal(seeds, j) if joint else next_random(seeds, j)
    for i in range(n):
        value = nominal[i]
        if joint:
            for k in range(i + 1):
                value += factor[i * n + k] * normal[k]
            value = min(max(value, low[i]), high[i])
        else:
            value = low[i] + (high[i] - low[i]) * normal[i]
        q[which[i]] = 1.0 / value if inverse[i] == 1 else value


@inlined
def _fill_line(j: int, late: int, r1: float, r2: float, v1: float, v2: float, line: Any) -> None:
    for k in range(late):
        slot = shifted(line, (j * late + k) * 4)
        slot[0] = r1
        slot[1] = r2
        slot[2] = v1
        slot[3] = v2


@kernel
def reset_fleet(address: int, mask: Any, start: Any, z: Any) -> None:
    """Start a new episode of the masked drives: draw parameters and reference, at ``start``.

    ``mask`` (n,) is bool, ``start`` (4,) is x1, v1, x2, v2; the rest is as in :func:`step_fleet`.
    """
    block = integers_at(address)
    drives, shared, samples = block[DRIVES], block[MODELS] == 1, block[SAMPLES]
    task, state = floats_at(block[A_TASK]), floats_at(block[A_STATE])
    clock, row, seeds = integers_at(block[A_CLOCK]), integers_at(block[A_ROW]), naturals_at(block[A_SEEDS])
    p, decays, memory = floats_at(block[A_P]), floats_at(block[A_DECAYS]), floats_at(block[A_MEMORY])
    references, reward = floats_at(block[A_REFERENCES]), floats_at(block[A_REWARD])
    terminated, truncated = flags_at(block[A_TERMINATED]), flags_at(block[A_TRUNCATED])
    period = task[PERIOD]
    scratch, extra = floats_at(block[A_SCRATCH]), pointer(z)
    space = None if z is None else scratch
    for j in range(block[LOW], block[HIGH]):
        if not mask[j]:
            continue
        model = 0 if shared else j
        q = shifted(p, model * N_PARAMETERS)
        if block[DRAWN] > 0:
            _draw_parameters(j, q, block, seeds)
        decays[2 * model] = decay(q[CUTOFF_1], period)
        decays[2 * model + 1] = decay(q[CUTOFF_2], period)
        if block[REFERENCES] > 1:
            row[j] = int(next_random(seeds, j) * block[REFERENCES])
        clock[j] = 0
        reward[j], terminated[j], truncated[j] = 0.0, 0, 0
        for k in range(STATE_ROWS):
            state[k * drives + j] = start[k] if k < 4 else 0.0
        if block[ONE_BY_ONE] == 1:
            tabulate(
                period / block[SUBSTEPS], shifted(floats_at(block[A_TABLES]), model * TABLE_COLUMNS), space, q
            )
            for k in range(MEMORY):
                memory[j * MEMORY + k] = 0.0
        if z is not None:
            for k in range(N_STATES):
                extra[j * N_STATES + k] = 0.0
        r1, r2 = readings(start[0], start[2], 0.0, space, q)
        _fill_line(j, block[LATE], r1, r2, start[1], start[3], floats_at(block[A_LINE]))
        state[READ_1 * drives + j] = r1
        state[READ_2 * drives + j] = r2
        state[SPEED_1 * drives + j] = start[1]
        state[SPEED_2 * drives + j] = start[3]
        state[REFERENCE * drives + j] = references[row[j] * samples]
        state[ERROR * drives + j] = references[row[j] * samples] - (start[2] if q[W2] > 0.0 else start[0])
        observe(
            r1,
            r2,
            start[1],
            start[3],
            0.0,
            0,
            block[SENSING],
            block[PREVIEWS],
            shifted(references, row[j] * samples),
            integers_at(block[A_AHEAD]),
            floats_at(block[A_SCALE]),
            floats_at(block[A_BOUND]),
            shifted(singles_at(block[A_OBSERVATION]), j * block[ENTRIES]),
        )
