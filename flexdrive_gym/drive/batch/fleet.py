"""Many drives in one compiled call: the kernels behind the single and the batched environment.

Nothing is integrated here: :mod:`~flexdrive_gym.drive.batch.lanes` does that, :mod:`~flexdrive_gym.drive.sensing` the rest of a
control period, and :mod:`~flexdrive_gym.drive.layout` says where everything is.
"""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.batch.lanes import TABLE_COLUMNS, integrate_each, integrate_lanes
from flexdrive_gym.drive.batch.series import respond
from flexdrive_gym.drive.compilation import (
    flags_at,
    floats_at,
    inlined,
    integers_at,
    kernel,
    kernel_holding_lock,
    naturals_at,
    pointer,
    shifted,
    singles_at,
)
from flexdrive_gym.drive.effects import N_BASE_PARAMETERS, WORKSPACE
from flexdrive_gym.drive.forces import W2, rate_1, rate_2, readings
from flexdrive_gym.drive.layout import (
    A_ACTIONS,
    A_BEGIN,
    A_BOUND,
    A_CLOCK,
    A_ENTRIES,
    A_FACTOR,
    A_HIGHEST,
    A_INVERSE,
    A_LANES,
    A_LINE,
    A_LOOKUP,
    A_LOWEST,
    A_MEMORY,
    A_NOMINAL,
    A_OBSERVATION,
    A_P,
    A_PICKS,
    A_RECORD,
    A_REWARD,
    A_SCALE,
    A_SEEDS,
    A_SHOWN,
    A_STATE,
    A_TABLES,
    A_TASK,
    A_TERMINATED,
    A_TOLD,
    A_TRUNCATED,
    A_WHICH,
    A_WORK,
    COMMAND,
    DECAY_1,
    DECAY_2,
    DRAWN,
    E_RESPONSE,
    ENDED,
    ENTRIES,
    ERROR,
    GATHERED,
    GROUP,
    HIGH,
    HORIZON,
    JOINT,
    LANES,
    LATE,
    LEAPS,
    LOW,
    NOISE,
    ONE_BY_ONE,
    PARAMETER_ROWS,
    PERIOD,
    PREVIEWS,
    READ_1,
    READ_2,
    REFERENCE,
    REFERENCES,
    REFUSED,
    RESPONSE,
    RESPONSES,
    ROW,
    SAMPLES,
    SEEN,
    SENSING,
    SHORT,
    SPEED_1,
    SPEED_2,
    STATE_ROWS,
    SUBSTEPS,
    TELLS,
    TOLD_ROWS,
    V1,
    V2,
    WORK_ROWS,
    X1,
    X2,
    padded,
    stride,
    strip_of,
)
from flexdrive_gym.drive.observation import observe
from flexdrive_gym.drive.piece import tabulate
from flexdrive_gym.drive.sample import CUTOFF_1, CUTOFF_2, MEMORY, clear, decay
from flexdrive_gym.drive.sensing import (
    act,
    conclude,
    delay_readings,
    draw_noise,
    judge,
    look_up,
    next_normal,
    next_random,
    sense_and_judge,
    sense_each,
    tell,
    tick,
)


@inlined
def _look_up(j: int, n: int, block: Any, reference: Any) -> None:
    look_up(
        n,
        block[PREVIEWS] + 1,
        shifted(integers_at(block[A_CLOCK]), j),
        shifted(integers_at(block[A_BEGIN]), j),
        floats_at(block[A_LOOKUP]),
        singles_at(block[A_LOOKUP]),
        reference,
        singles_at(block[A_SHOWN]),
    )


@inlined
def _observe(j: int, n: int, block: Any, seen: Any, state: Any, now: Any) -> None:
    observe(
        n,
        block[SENSING],
        block[PREVIEWS],
        floats_at(block[A_SCALE]),
        floats_at(block[A_BOUND]),
        seen,
        state,
        now,
        singles_at(block[A_SHOWN]),
        singles_at(block[A_ENTRIES]),
        shifted(singles_at(block[A_OBSERVATION]), j * block[ENTRIES]),
    )


@inlined
def _record(block: Any) -> None:
    """Write down all that is known of the only drive, in the order of the environment's ``info``."""
    state, told, record = floats_at(block[A_STATE]), floats_at(block[A_TOLD]), floats_at(block[A_RECORD])
    for k in range(STATE_ROWS):
        record[k] = state[k * ROW]
    for k in range(TOLD_ROWS):
        record[STATE_ROWS + k] = told[k * ROW]


@inlined
def _step_group(begin: int, n: int, block: Any, z: Any) -> int:
    """Advance n drives from ``begin`` on, all in one group; return how many episodes end."""
    shared, task, work = block[DRAWN] == 0, floats_at(block[A_TASK]), floats_at(block[A_WORK])
    strip = begin // LANES
    state = shifted(floats_at(block[A_STATE]), strip * STATE_ROWS * ROW)
    q = shifted(floats_at(block[A_LANES]), (0 if shared else strip) * PARAMETER_ROWS * ROW)
    for low in range(0, n, LANES):
        lanes, own = min(LANES, n - low), shifted(work, strip_of(low, WORK_ROWS))
        rows = shifted(q, 0 if shared else strip_of(low, PARAMETER_ROWS))
        actions = shifted(floats_at(block[A_ACTIONS]), begin + low)
        act(lanes, actions, task, rows, shifted(state, strip_of(low, STATE_ROWS)), own)
        if task[NOISE] > 0.0:
            draw_noise(begin + low, lanes, task, naturals_at(block[A_SEEDS]), own)
    _integrate(begin, n, shared, block, q, state, work, z)
    ended = 0
    for low in range(0, n, LANES):
        rows = shifted(q, 0 if shared else strip_of(low, PARAMETER_ROWS))
        here, own = shifted(state, strip_of(low, STATE_ROWS)), shifted(work, strip_of(low, WORK_ROWS))
        ended += _finish_strip(begin + low, min(LANES, n - low), shared, block, rows, here, own, z)
    return ended


@inlined
def _integrate(begin: int, n: int, shared: bool, block: Any, q: Any, state: Any, work: Any, z: Any) -> None:
    """Advance the physics of a group's n drives from ``begin`` on by one control period."""
    period, substeps, leaps = floats_at(block[A_TASK])[PERIOD], block[SUBSTEPS], block[LEAPS]
    if z is None and block[ONE_BY_ONE] == 0:
        parts = (substeps + leaps - 1) // leaps
        picks, short = integers_at(block[A_PICKS]), block[SHORT] == 1
        integrate_lanes(n, leaps, period / leaps, parts, short, shared, q, picks, state, work)
    else:
        clocks, p = integers_at(block[A_CLOCK]), floats_at(block[A_P])
        tables, memory = floats_at(block[A_TABLES]), floats_at(block[A_MEMORY])
        integrate_each(begin, n, period, substeps, shared, clocks, p, tables, memory, z, state)


@inlined
def _finish_strip(begin: int, n: int, shared: bool, block: Any, q: Any, state: Any, work: Any, z: Any) -> int:
    """Do what comes after the physics for n drives from ``begin`` on, all in one strip; return how many episodes end."""
    late, task = block[LATE], floats_at(block[A_TASK])
    period = task[PERIOD]
    clocks, p = integers_at(block[A_CLOCK]), floats_at(block[A_P])
    clock = shifted(clocks, begin)
    reward = shifted(floats_at(block[A_REWARD]), begin)
    if z is not None:
        sense_each(begin, n, shared, period, clocks, p, z, q, state, work)
    tick(n, task, clock)
    _look_up(begin, n, block, work)
    if z is None:
        sense_and_judge(n, task, q, state, reward, work)
    else:
        judge(n, task, q, state, reward, work)
    if block[TELLS] == 1:
        tell(n, task, q, state, shifted(floats_at(block[A_TOLD]), begin // LANES * TOLD_ROWS * ROW), work)
    terminated, truncated = flags_at(block[A_TERMINATED]), flags_at(block[A_TRUNCATED])
    ended = conclude(n, task[HORIZON], clock, shifted(terminated, begin), shifted(truncated, begin), work)
    if late > 0:
        delay_readings(begin, n, late, clocks, floats_at(block[A_LINE]), state, work)
    seen = shifted(work, SEEN) if late > 0 else shifted(state, READ_1)
    _observe(begin, n, block, seen, state, work)
    return ended


@inlined
def _refused(block: Any) -> int:
    """Return 1 if an action of the block's drives is no finite number, else 0; asked before any drive is advanced."""
    actions, odd = shifted(floats_at(block[A_ACTIONS]), block[LOW]), 0
    for i in range(block[HIGH] - block[LOW]):
        odd += actions[i] - actions[i] != 0.0  # neither infinity nor what is no number leaves 0
    return min(odd, 1)


@kernel
def step_fleet(address: int, z: Any) -> None:
    """Advance drives by one control period and observe them; none if an action is no finite number.

    Parameters
    ----------
    address
        Of a block of integers: which drives, sizes and the addresses of arrays; see :mod:`~flexdrive_gym.drive.layout`.
        Whoever calls holds the block and the arrays.
    z : ndarray, shape (n, WORKSPACE), or None
        Workspaces of the drives where some has effects beyond the base.
    """
    block = integers_at(address)
    # not left early: that would keep the compiler from what it does to the loop
    refused = _refused(block)
    ended, high = REFUSED * refused, block[HIGH] - refused * (block[HIGH] - block[LOW])
    for begin in range(block[LOW], high, GROUP * LANES):
        ended += _step_group(begin, min(GROUP * LANES, high - begin), block, pointer(z))
    block[ENDED] = ended


@kernel_holding_lock
def step_single(address: int, z: Any) -> None:
    """Do what :func:`step_fleet` does for a fleet of one, and record it: loops over one drive are none.

    Releasing the interpreter's lock would take a tenth of the step.
    """
    block = integers_at(address)
    action = floats_at(block[A_ACTIONS])[0]
    if action - action == 0.0:
        block[ENDED] = _step_group(0, 1, block, pointer(z))
        _record(block)
    else:
        block[ENDED] = REFUSED


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
def prepare_fleet(address: int) -> None:
    """Set up what the parameters decide that all drives share; to be called once for every block."""
    block = integers_at(address)
    if block[DRAWN] == 0:
        _prepare(0, True, block, floats_at(block[A_P]))
        rows, work = floats_at(block[A_LANES]), floats_at(block[A_WORK])
        for k in range(RESPONSES):
            for e in range(padded(min(block[HIGH] - block[LOW], GROUP * LANES))):
                work[E_RESPONSE + k * GATHERED + e] = rows[RESPONSE + k * ROW]


@kernel
def reset_fleet(address: int, which: Any, start: Any, z: Any) -> None:
    """Start a new episode of some drives: draw parameters and reference, at ``start``.

    ``which`` are their numbers, of which those in the block's range count; ``start`` (4,) is x1, v1, x2, v2; the rest is as
    in :func:`step_fleet`.
    """
    block = integers_at(address)
    shared = block[DRAWN] == 0
    clock, begin, seeds = integers_at(block[A_CLOCK]), integers_at(block[A_BEGIN]), naturals_at(block[A_SEEDS])
    reward = floats_at(block[A_REWARD])
    terminated, truncated = flags_at(block[A_TERMINATED]), flags_at(block[A_TRUNCATED])
    extra, line = pointer(z), floats_at(block[A_LINE])
    for j in which:
        if not block[LOW] <= j < block[HIGH]:
            continue
        q = shifted(floats_at(block[A_P]), (0 if shared else j) * stride(extra))
        space = shifted(extra, j * WORKSPACE)
        if block[DRAWN] > 0:
            _draw_parameters(j, q, block, seeds)
        if block[REFERENCES] > 1:
            begin[j] = int(next_random(seeds, j) * block[REFERENCES]) * block[SAMPLES]
        clock[j] = 0
        reward[j], terminated[j], truncated[j] = 0.0, 0, 0
        if not shared:
            _prepare(j, False, block, q)
        if block[ONE_BY_ONE] == 1:
            clear(start[1], start[3], shifted(floats_at(block[A_MEMORY]), j * MEMORY), space, q)
        period = floats_at(block[A_TASK])[PERIOD]
        r1, r2 = readings(start[0], start[1], start[2], start[3], 0.0, period, space, q)
        q1, q2 = rate_1(start[1], space, q), rate_2(start[3], space, q)
        _fill_line(j, block[LATE], r1, r2, q1, q2, line)
        strip, i = j // LANES, j % LANES
        state = shifted(floats_at(block[A_STATE]), strip * STATE_ROWS * ROW + i)
        told = shifted(floats_at(block[A_TOLD]), strip * TOLD_ROWS * ROW + i)
        state[X1], state[V1], state[X2], state[V2] = start[0], start[1], start[2], start[3]
        state[READ_1], state[READ_2], state[SPEED_1], state[SPEED_2] = r1, r2, q1, q2
        state[COMMAND] = 0.0
        for k in range(TOLD_ROWS):
            told[k * ROW] = 0.0
        _look_up(j, 1, block, told)
        told[ERROR] = told[REFERENCE] - (start[2] if q[W2] > 0.0 else start[0])
        _observe(j, 1, block, shifted(state, READ_1), state, told)


@inlined
def _prepare(j: int, shared: bool, block: Any, q: Any) -> None:
    """Set up what a drive's parameters decide: the lanes' rows, or the step's table."""
    period = floats_at(block[A_TASK])[PERIOD]
    strip, first = (0 if shared else j // LANES), (0 if shared else j % LANES)
    rows = shifted(floats_at(block[A_LANES]), strip * PARAMETER_ROWS * ROW + first)
    for k in range(N_BASE_PARAMETERS):
        rows[k * ROW] = q[k]
    rows[DECAY_1], rows[DECAY_2] = decay(q[CUTOFF_1], period), decay(q[CUTOFF_2], period)
    respond(period / block[LEAPS], q, shifted(rows, RESPONSE), ROW)
    for lane in range(1, LANES if shared else 1):
        for k in range(PARAMETER_ROWS):
            rows[k * ROW + lane] = rows[k * ROW]
    if block[ONE_BY_ONE] == 1:
        table = shifted(floats_at(block[A_TABLES]), (0 if shared else j) * TABLE_COLUMNS)
        tabulate(period / block[SUBSTEPS], table, q)
