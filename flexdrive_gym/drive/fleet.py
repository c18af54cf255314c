"""Many drives in one compiled call: the kernel behind the single and the batched environment.

A *fleet* keeps one column of ``state`` per drive. Its physics is :mod:`flexdrive_gym.drive.step`; nothing is integrated
here. Drives whose carts both slide through a whole step are advanced side by side by the step's table, which the compiler
vectorises; a drive whose friction changes direction, sticks or tears loose within the step goes through the step's events.
Vector and scalar arithmetic round alike, so a drive behaves the same to the last bit whether it is alone or one of
thousands.

The kernels get the addresses of a :class:`Fleet`'s arrays in one array, so that a call for a single drive is cheap.
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
from flexdrive_gym.drive.effects import N_BASE_PARAMETERS, N_PARAMETERS, WORKSPACE
from flexdrive_gym.drive.forces import W2, level_1, level_2, limited, margin_2, rate_1, rate_2, readings
from flexdrive_gym.drive.sample import CUTOFF_1, CUTOFF_2, MEMORY, advance, clear, decay, velocity
from flexdrive_gym.drive.step import TABLE, leap, step_through_events, tabulate

LANES = 64

# rows of ``state``; those up to COMMAND carry a drive from one control period to the next, the others tell about the last
X1, V1, X2, V2 = 0, 1, 2, 3
READ_1, READ_2, SPEED_1, SPEED_2, COMMAND = 4, 5, 6, 7, 8
REFERENCE, ERROR, TRACKING, EFFORT, RATE, FAILURE = 9, 10, 11, 12, 13, 14
CARRIED, STATE_ROWS = 9, 15

# entries of ``task``, the constants of an environment
PERIOD, TRAVEL, STROKE, WEIGHT_TRACKING, WEIGHT_EFFORT, WEIGHT_RATE, WEIGHT_FAILURE = 0, 1, 2, 3, 4, 5, 6
ERROR_SCALE, VOLTAGE, HORIZON, NOISE = 7, 8, 9, 10
TASK_ENTRIES = 11

# entries of ``sizes``
DRIVES, SENSING, SUBSTEPS, MODELS, ENTRIES, PREVIEWS, SAMPLES, REFERENCES, ONE_BY_ONE, DRAWN, JOINT, LATE = range(12)
SIZES = 12

# entries of ``addresses``, one array each; :class:`~flexdrive_gym.fleet.Fleet` makes and holds them
ARRAYS = (
    "actions",
    "task",
    "state",
    "clock",
    "row",
    "seeds",
    "p",
    "tables",
    "memory",
    "references",
    "ahead",
    "scale",
    "bound",
    "work",
    "observation",
    "reward",
    "terminated",
    "truncated",
    "nominal",
    "which",
    "inverse",
    "lowest",
    "highest",
    "factor",
    "line",
)
_PLACE = {name: i for i, name in enumerate(ARRAYS)}
A_ACTIONS = _PLACE["actions"]
A_TASK = _PLACE["task"]
A_STATE = _PLACE["state"]
A_CLOCK = _PLACE["clock"]
A_ROW = _PLACE["row"]
A_SEEDS = _PLACE["seeds"]
A_P = _PLACE["p"]
A_TABLES = _PLACE["tables"]
A_MEMORY = _PLACE["memory"]
A_REFERENCES = _PLACE["references"]
A_AHEAD = _PLACE["ahead"]
A_SCALE = _PLACE["scale"]
A_BOUND = _PLACE["bound"]
A_WORK = _PLACE["work"]
A_OBSERVATION = _PLACE["observation"]
A_REWARD = _PLACE["reward"]
A_TERMINATED = _PLACE["terminated"]
A_TRUNCATED = _PLACE["truncated"]
A_NOMINAL = _PLACE["nominal"]
A_WHICH = _PLACE["which"]
A_INVERSE = _PLACE["inverse"]
A_LOWEST = _PLACE["lowest"]
A_HIGHEST = _PLACE["highest"]
A_FACTOR = _PLACE["factor"]
A_LINE = _PLACE["line"]

# columns of ``tables``: the step's table, what the velocity filters keep, work space
DECAY_1, DECAY_2 = TABLE + N_BASE_PARAMETERS, TABLE + N_BASE_PARAMETERS + 1
TABLE_COLUMNS = TABLE + N_BASE_PARAMETERS + 2

# Rows of the lanes' work space, one flat array: the compiler sees that its rows never overlap and vectorises. The first
# rows are those of ``state``.
_TRIAL = STATE_ROWS * LANES
_EVENT = _TRIAL + 4 * LANES
_NOISE = _EVENT + LANES
_DECAY = _NOISE + 2 * LANES
_PARAMETERS = _DECAY + 2 * LANES
_TABLE = _PARAMETERS + N_BASE_PARAMETERS * LANES
# entries of the step's table: for both carts sliding, and for cart 1 sliding while cart 2 sticks (x1 and v1 only)
_SLIDING, _HELD, _HELD_BEGINS = 20, 10, 40
_TABLE_HELD = _TABLE + _SLIDING * LANES
LANES_WORK = _TABLE_HELD + _HELD * LANES


def _row_function(name: str, start: int, entries: int) -> Any:
    # a tuple of one lane's entries: its length is part of its type, so it must be written out
    body = ", ".join(f"work[{start + k * LANES} + i]" for k in range(entries))
    names: dict[str, Any] = {}
    exec(compile(f"def {name}(work, i):\n    return ({body},)\n", f"<{name}>", "exec"), names)  # noqa: S102
    return inlined(names[name])


_parameters_of = _row_function("_parameters_of", _PARAMETERS, N_BASE_PARAMETERS)
_table_of = _row_function("_table_of", _TABLE, _SLIDING)
_held_table_of = _row_function("_held_table_of", _TABLE_HELD, _HELD)


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
def _stride(z: Any) -> int:
    """Return how many parameters are kept per drive: those of the base effects come first, and often suffice."""
    if z is None:
        return N_BASE_PARAMETERS
    return N_PARAMETERS


@inlined
def _load_drives(low: int, n: int, shared: bool, p: Any, tables: Any, z: Any, work: Any) -> None:
    """Spread parameters and tables over the lanes."""
    for i in range(n):
        j = 0 if shared else low + i
        q, table = shifted(p, j * _stride(z)), shifted(tables, j * TABLE_COLUMNS)
        for k in range(N_BASE_PARAMETERS):
            work[_PARAMETERS + k * LANES + i] = q[k]
        for k in range(_SLIDING):
            work[_TABLE + k * LANES + i] = table[k]
        for k in range(_HELD):
            work[_TABLE_HELD + k * LANES + i] = table[_HELD_BEGINS + k]
        work[_DECAY + i] = table[DECAY_1]
        work[_DECAY + LANES + i] = table[DECAY_2]


@inlined
def _act(n: int, actions: Any, task: Any, work: Any) -> None:
    """Limit the commands and charge their change."""
    voltage, weight, per_volt = task[VOLTAGE], task[WEIGHT_RATE], 1.0 / task[VOLTAGE]
    for i in range(n):
        old = work[COMMAND * LANES + i]
        new = limited(min(max(actions[i], -1.0), 1.0) * voltage, _parameters_of(work, i))
        change = (new - old) * per_volt
        work[RATE * LANES + i] = -weight * change * change
        work[COMMAND * LANES + i] = new


@inlined
def _integrate_lanes(low: int, n: int, substeps: int, h: float, shared: bool, p: Any, tables: Any, work: Any) -> None:
    """Integrate n drives side by side; n is at most LANES.

    Both ways a drive spends whole steps in are advanced by table: both carts sliding, or cart 2 held by its friction.
    """
    for _ in range(substeps):
        for i in range(n):
            x1, v1 = work[X1 * LANES + i], work[V1 * LANES + i]
            x2, v2 = work[X2 * LANES + i], work[V2 * LANES + i]
            q = _parameters_of(work, i)
            s1, s2 = (1.0 if v1 > 0.0 else -1.0), (1.0 if v2 > 0.0 else -1.0)
            f1 = work[COMMAND * LANES + i] - s1 * level_1(x1, v1, s1, 0.0, 0.0, None, 0, q)
            f2 = -s2 * level_2(x2, v2, s2, 0.0, 0.0, None, 0, q)
            y1, w1, y2, w2 = leap(0, x1, v1, x2, v2, f1, f2, _table_of(work, i))
            held = _held_table_of(work, i)
            d = x1 - x2
            h1 = x1 + (held[0] * d + held[1] * v1 + held[3] * f1)
            u1 = held[5] * d + held[6] * v1 + held[8] * f1
            before, _s = margin_2(x1, x2, v1, 0.0, None, 0, q)
            after, _s = margin_2(h1, x2, u1, 0.0, None, 0, q)
            sticks = v2 == 0.0 and before <= 0.0
            y1, w1 = (h1 if sticks else y1), (u1 if sticks else w1)
            work[_TRIAL + i] = y1
            work[_TRIAL + LANES + i] = w1
            work[_TRIAL + 2 * LANES + i] = x2 if sticks else y2
            work[_TRIAL + 3 * LANES + i] = 0.0 if sticks else w2
            # not positive: a cart tears loose, comes back through zero, or cart 1 is at rest
            work[_EVENT + i] = min(v1 * w1, (1.0 if after <= 0.0 else -1.0) if sticks else v2 * w2)
        for i in range(n):
            if not work[_EVENT + i] > 0.0:
                j = 0 if shared else low + i
                y1, w1, y2, w2 = step_through_events(
                    work[X1 * LANES + i],
                    work[V1 * LANES + i],
                    work[X2 * LANES + i],
                    work[V2 * LANES + i],
                    work[COMMAND * LANES + i],
                    0.0,
                    h,
                    shifted(tables, j * TABLE_COLUMNS),
                    None,
                    shifted(p, j * N_BASE_PARAMETERS),
                )
                work[_TRIAL + i] = y1
                work[_TRIAL + LANES + i] = w1
                work[_TRIAL + 2 * LANES + i] = y2
                work[_TRIAL + 3 * LANES + i] = w2
        for k in range(4):
            for i in range(n):
                work[k * LANES + i] = work[_TRIAL + k * LANES + i]


@inlined
def _integrate_each(
    low: int,
    n: int,
    period: float,
    substeps: int,
    shared: bool,
    clock: Any,
    p: Any,
    tables: Any,
    memory: Any,
    z: Any,
    work: Any,
) -> None:
    """Integrate n drives one by one: some delay their command, or have effects beyond the base."""
    for i in range(n):
        j = low + i
        row = 0 if shared else j
        x1, v1, x2, v2 = advance(
            work[X1 * LANES + i],
            work[V1 * LANES + i],
            work[X2 * LANES + i],
            work[V2 * LANES + i],
            work[COMMAND * LANES + i],
            clock[j] * period,
            period,
            substeps,
            shifted(tables, row * TABLE_COLUMNS),
            shifted(memory, j * MEMORY),
            shifted(z, j * WORKSPACE),
            shifted(p, row * _stride(z)),
        )
        work[X1 * LANES + i] = x1
        work[V1 * LANES + i] = v1
        work[X2 * LANES + i] = x2
        work[V2 * LANES + i] = v2


@inlined
def _draw_noise(low: int, n: int, noise: float, seeds: Any, work: Any) -> None:
    for i in range(n):
        work[_NOISE + i] = noise * next_normal(seeds, low + i)
        work[_NOISE + LANES + i] = noise * next_normal(seeds, low + i)


@inlined
def _differentiate(i: int, r1: float, r2: float, period: float, z: Any, p: Any, work: Any) -> None:
    """Make velocities from new readings and keep both."""
    raw_1 = rate_1((r1 - work[READ_1 * LANES + i]) / period, z, p)
    raw_2 = rate_2((r2 - work[READ_2 * LANES + i]) / period, z, p)
    work[SPEED_1 * LANES + i] = velocity(raw_1, work[SPEED_1 * LANES + i], work[_DECAY + i])
    work[SPEED_2 * LANES + i] = velocity(raw_2, work[SPEED_2 * LANES + i], work[_DECAY + LANES + i])
    work[READ_1 * LANES + i] = r1
    work[READ_2 * LANES + i] = r2


@inlined
def _sense(low: int, n: int, shared: bool, period: float, clock: Any, p: Any, z: Any, work: Any) -> None:
    """Read the encoders."""
    for i in range(n):
        x1, v1 = work[X1 * LANES + i], work[V1 * LANES + i]
        x2, v2 = work[X2 * LANES + i], work[V2 * LANES + i]
        n1, n2 = work[_NOISE + i], work[_NOISE + LANES + i]
        if z is None:
            q = _parameters_of(work, i)
            r1, r2 = readings(x1, v1, x2, v2, 0.0, period, None, q)
            _differentiate(i, r1 + n1, r2 + n2, period, None, q, work)
        else:
            j = low + i
            parameters, space = shifted(p, (0 if shared else j) * _stride(z)), shifted(z, j * WORKSPACE)
            r1, r2 = readings(x1, v1, x2, v2, (clock[j] + 1) * period, period, space, parameters)
            _differentiate(i, r1 + n1, r2 + n2, period, space, parameters, work)


@inlined
def _delay_readings(low: int, n: int, late: int, clock: Any, line: Any, work: Any) -> None:
    """Swap the readings for those of ``late`` control periods ago; ``line`` is a ring of them per drive."""
    for i in range(n):
        j = low + i
        slot = shifted(line, (j * late + clock[j] % late) * 4)
        for k in range(4):
            now = work[(READ_1 + k) * LANES + i]
            work[(READ_1 + k) * LANES + i] = slot[k]
            slot[k] = now


@inlined
def _judge(n: int, task: Any, work: Any) -> None:
    """Compare the controlled cart (cart 2, or the only one) with the reference; charge error, effort and failure."""
    per_error, per_volt, travel, stroke = 1.0 / task[ERROR_SCALE], 1.0 / task[VOLTAGE], task[TRAVEL], task[STROKE]
    tracking, effort, failure = task[WEIGHT_TRACKING], task[WEIGHT_EFFORT], task[WEIGHT_FAILURE]
    for i in range(n):
        x1, x2 = work[X1 * LANES + i], work[X2 * LANES + i]
        two = work[_PARAMETERS + W2 * LANES + i] > 0.0
        error = work[REFERENCE * LANES + i] - (x2 if two else x1)
        e, u = error * per_error, work[COMMAND * LANES + i] * per_volt
        reach = max(abs(x1), abs(x2)) - travel
        stretch = abs(x1 - x2) - stroke if two else -1.0
        work[ERROR * LANES + i] = error
        work[TRACKING * LANES + i] = -tracking * e * e
        work[EFFORT * LANES + i] = -effort * u * u
        work[FAILURE * LANES + i] = -failure if max(reach, stretch) > 0.0 else 0.0
        work[_EVENT + i] = max(reach, stretch)


@inlined
def _entry(value: float, scale: Any, bound: Any, k: int) -> float:
    return min(max(value * scale[k], -bound[k]), bound[k])


@inlined
def _observe(
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


@kernel
def step_fleet(low: int, high: int, sizes: Any, addresses: Any, z: Any) -> None:
    """Advance drives ``low`` … ``high - 1`` by one control period and observe them.

    Parameters
    ----------
    sizes : ndarray of int, shape (SIZES,)
        Numbers of things; see the constants above.
    addresses : ndarray of int, shape (len(ARRAYS),)
        Of the arrays of a :class:`~flexdrive_gym.fleet.Fleet`, which holds them.
    z : ndarray, shape (n, WORKSPACE), or None
        Workspaces of the drives where some has effects beyond the base.
    """
    drives, shared = sizes[DRIVES], sizes[MODELS] == 1
    sensing, substeps, entries = sizes[SENSING], sizes[SUBSTEPS], sizes[ENTRIES]
    samples, previews = sizes[SAMPLES], sizes[PREVIEWS]
    task, state, actions = floats_at(addresses[A_TASK]), floats_at(addresses[A_STATE]), floats_at(addresses[A_ACTIONS])
    clock, row, seeds = (
        integers_at(addresses[A_CLOCK]),
        integers_at(addresses[A_ROW]),
        naturals_at(addresses[A_SEEDS]),
    )
    p, tables, memory = floats_at(addresses[A_P]), floats_at(addresses[A_TABLES]), floats_at(addresses[A_MEMORY])
    references = floats_at(addresses[A_REFERENCES])
    ahead, scale, bound = (
        integers_at(addresses[A_AHEAD]),
        floats_at(addresses[A_SCALE]),
        floats_at(addresses[A_BOUND]),
    )
    work, observation = floats_at(addresses[A_WORK]), singles_at(addresses[A_OBSERVATION])
    reward = floats_at(addresses[A_REWARD])
    terminated, truncated = flags_at(addresses[A_TERMINATED]), flags_at(addresses[A_TRUNCATED])
    extra, late = pointer(z), sizes[LATE]

    period, noise, horizon = task[PERIOD], task[NOISE], task[HORIZON]
    if shared:
        _load_drives(0, min(LANES, high - low), shared, p, tables, extra, work)
    for i in range(min(LANES, high - low)):
        work[_NOISE + i] = 0.0
        work[_NOISE + LANES + i] = 0.0
    for begin in range(low, high, LANES):
        n = min(LANES, high - begin)
        if not shared:
            _load_drives(begin, n, shared, p, tables, extra, work)
        for k in range(CARRIED):
            column = shifted(state, k * drives + begin)
            for i in range(n):
                work[k * LANES + i] = column[i]
        _act(n, shifted(actions, begin), task, work)
        # told apart by z first: the compiler then leaves the side-by-side code out where it cannot be needed
        if z is not None:
            _integrate_each(begin, n, period, substeps, shared, clock, p, tables, memory, extra, work)
        elif sizes[ONE_BY_ONE] == 0:
            _integrate_lanes(begin, n, substeps, period / substeps, shared, p, tables, work)
        else:
            _integrate_each(begin, n, period, substeps, shared, clock, p, tables, memory, extra, work)
        if noise > 0.0:
            _draw_noise(begin, n, noise, seeds, work)
        _sense(begin, n, shared, period, clock, p, extra, work)
        for i in range(n):
            now = clock[begin + i] + 1
            clock[begin + i] = now
            work[REFERENCE * LANES + i] = references[row[begin + i] * samples + now]
        _judge(n, task, work)
        for k in range(STATE_ROWS):
            column = shifted(state, k * drives + begin)
            for i in range(n):
                column[i] = work[k * LANES + i]
        if late > 0:
            _delay_readings(begin, n, late, clock, floats_at(addresses[A_LINE]), work)
        for i in range(n):
            j = begin + i
            lost = work[_EVENT + i] > 0.0
            terminated[j] = 1 if lost else 0
            truncated[j] = 1 if clock[j] >= horizon and not lost else 0
            reward[j] = (
                work[TRACKING * LANES + i]
                + work[EFFORT * LANES + i]
                + work[RATE * LANES + i]
                + work[FAILURE * LANES + i]
            )
            _observe(
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


@inlined
def _draw_parameters(
    j: int,
    n: int,
    joint: bool,
    q: Any,
    seeds: Any,
    nominal: Any,
    which: Any,
    inverse: Any,
    low: Any,
    high: Any,
    factor: Any,
    normal: Any,
) -> None:
    """Draw the randomised parameters: uniform between bounds, or jointly normal by a Cholesky factor, within them."""
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


@kernel
def reset_fleet(low: int, high: int, mask: Any, start: Any, sizes: Any, addresses: Any, z: Any) -> None:
    """Start a new episode of the masked drives among ``low`` … ``high - 1``: draw parameters and reference, at ``start``.

    ``mask`` (n,) is bool, ``start`` (4,) is x1, v1, x2, v2; the rest is as in :func:`step_fleet`.
    """
    drives, shared = sizes[DRIVES], sizes[MODELS] == 1
    task, state = floats_at(addresses[A_TASK]), floats_at(addresses[A_STATE])
    clock, row, seeds = (
        integers_at(addresses[A_CLOCK]),
        integers_at(addresses[A_ROW]),
        naturals_at(addresses[A_SEEDS]),
    )
    p, tables, memory = floats_at(addresses[A_P]), floats_at(addresses[A_TABLES]), floats_at(addresses[A_MEMORY])
    references, reward = floats_at(addresses[A_REFERENCES]), floats_at(addresses[A_REWARD])
    terminated, truncated = flags_at(addresses[A_TERMINATED]), flags_at(addresses[A_TRUNCATED])
    period, substeps, samples = task[PERIOD], sizes[SUBSTEPS], sizes[SAMPLES]
    extra = pointer(z)
    for j in range(low, high):
        if not mask[j]:
            continue
        model = 0 if shared else j
        q, table, space = (
            shifted(p, model * _stride(extra)),
            shifted(tables, model * TABLE_COLUMNS),
            shifted(extra, j * WORKSPACE),
        )
        if sizes[DRAWN] > 0:
            _draw_parameters(
                j,
                sizes[DRAWN],
                sizes[JOINT] == 1,
                q,
                seeds,
                floats_at(addresses[A_NOMINAL]),
                integers_at(addresses[A_WHICH]),
                integers_at(addresses[A_INVERSE]),
                floats_at(addresses[A_LOWEST]),
                floats_at(addresses[A_HIGHEST]),
                floats_at(addresses[A_FACTOR]),
                floats_at(addresses[A_WORK]),
            )
        tabulate(period / substeps, table, space, q)
        table[DECAY_1] = decay(q[CUTOFF_1], period)
        table[DECAY_2] = decay(q[CUTOFF_2], period)
        if sizes[REFERENCES] > 1:
            row[j] = int(next_random(seeds, j) * sizes[REFERENCES])
        clock[j] = 0
        reward[j], terminated[j], truncated[j] = 0.0, 0, 0
        for k in range(STATE_ROWS):
            state[k * drives + j] = start[k] if k < 4 else 0.0
        if sizes[ONE_BY_ONE] == 1:
            clear(start[1], start[3], shifted(memory, j * MEMORY), space, q)
        r1, r2 = readings(start[0], start[1], start[2], start[3], 0.0, period, space, q)
        q1, q2 = rate_1(start[1], space, q), rate_2(start[3], space, q)
        line = floats_at(addresses[A_LINE])
        for k in range(sizes[LATE]):
            slot = shifted(line, (j * sizes[LATE] + k) * 4)
            slot[0] = r1
            slot[1] = r2
            slot[2] = q1
            slot[3] = q2
        state[READ_1 * drives + j] = r1
        state[READ_2 * drives + j] = r2
        state[SPEED_1 * drives + j] = q1
        state[SPEED_2 * drives + j] = q2
        state[REFERENCE * drives + j] = references[row[j] * samples]
        state[ERROR * drives + j] = references[row[j] * samples] - (start[2] if q[W2] > 0.0 else start[0])
        _observe(
            r1,
            r2,
            q1,
            q2,
            0.0,
            0,
            sizes[SENSING],
            sizes[PREVIEWS],
            shifted(references, row[j] * samples),
            integers_at(addresses[A_AHEAD]),
            floats_at(addresses[A_SCALE]),
            floats_at(addresses[A_BOUND]),
            shifted(singles_at(addresses[A_OBSERVATION]), j * sizes[ENTRIES]),
        )
