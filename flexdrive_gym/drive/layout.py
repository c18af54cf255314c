"""Where the kernels of a fleet find things: rows of the state, constants, the block a kernel is given, the lanes' work space.

A fleet keeps its drives in *strips* of :data:`LANES`, each with a row per quantity: rows of a strip are together in memory,
and the compiler sees that they never overlap, which is what lets it do several drives in one instruction. Lanes without a
drive, in the last strip, are zero and may be advanced like others.

A kernel gets everything in one block of integers, sizes and then addresses of arrays, so that a call has one argument.
"""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.compilation import inlined
from flexdrive_gym.drive.effects import N_BASE_PARAMETERS, N_PARAMETERS

LANES = 128
# from row to row: not a power of two, for such rows would share the same few places of the processor's cache
ROW = LANES + 8

# rows of ``state``, which carry a drive from one control period to the next
X1, V1, X2, V2, READ_1, READ_2, SPEED_1, SPEED_2, COMMAND = (i * ROW for i in range(9))
STATE_ROWS = 9
# rows of ``told``, which tell about the last period; they begin the work space
REFERENCE, ERROR, TRACKING, EFFORT, RATE, FAILURE = (i * ROW for i in range(6))
TOLD_ROWS = 6
# rows of ``lanes``: parameters, the decay of the velocity filters, responses (:func:`~flexdrive_gym.drive.batch.series.respond`)
DECAY_1, DECAY_2 = N_BASE_PARAMETERS * ROW, (N_BASE_PARAMETERS + 1) * ROW
RESPONSE = (N_BASE_PARAMETERS + 2) * ROW
RESPONSES = 9
PARAMETER_ROWS = N_BASE_PARAMETERS + 2 + RESPONSES

# entries of ``task``, the constants of an environment
PERIOD, TRAVEL, STROKE, WEIGHT_TRACKING, WEIGHT_EFFORT, WEIGHT_RATE, WEIGHT_FAILURE = 0, 1, 2, 3, 4, 5, 6
ERROR_SCALE, VOLTAGE, HORIZON, NOISE = 7, 8, 9, 10

# the block: range of drives, sizes, what a kernel reports (ENDED: how many episodes), then addresses
LOW, HIGH, DRIVES, SENSING, SUBSTEPS, LEAPS, ENTRIES, PREVIEWS, SAMPLES, REFERENCES = range(10)
ONE_BY_ONE, DRAWN, JOINT, LATE, TELLS, SHORT, ENDED = range(10, 17)
SIZES = 17
# what ENDED says of a step that was not made, because an action was no finite number
REFUSED = -1

# one address each; :class:`~flexdrive_gym.fleet.Fleet` makes and holds the arrays
ARRAYS = (
    "actions", "task", "state", "told", "clock", "begin", "seeds", "p", "lanes", "tables", "memory", "lookup",
    "scale", "bound", "work", "picks", "shown", "entries", "record", "observation", "reward", "terminated",
    "truncated", "nominal", "which", "inverse", "lowest", "highest", "factor", "line",
)  # fmt: skip
PLACE = {name: SIZES + i for i, name in enumerate(ARRAYS)}
BLOCK = SIZES + len(ARRAYS)
(
    A_ACTIONS, A_TASK, A_STATE, A_TOLD, A_CLOCK, A_BEGIN, A_SEEDS, A_P, A_LANES, A_TABLES, A_MEMORY, A_LOOKUP,
    A_SCALE, A_BOUND, A_WORK, A_PICKS, A_SHOWN, A_ENTRIES, A_RECORD, A_OBSERVATION, A_REWARD, A_TERMINATED,
    A_TRUNCATED, A_NOMINAL, A_WHICH, A_INVERSE, A_LOWEST, A_HIGHEST, A_FACTOR, A_LINE,
) = range(SIZES, BLOCK)  # fmt: skip

# Further rows of the work space: noise, whether a lane needs more than the first piece, readings that come late.
NOISE_1, NOISE_2, OPEN, SEEN = (i * ROW for i in (6, 7, 8, 9))
WORK_ROWS = 13
# Strips are advanced in groups, each with such rows. Of a whole group the drives with an event are moved together: fewer are
# few in a vector, and every round of events takes as long as its longest chain of operations.
GROUP = 8
GATHERED = GROUP * LANES + 8
# Their rows: state, command, share of the leap left, released carts, whether a search is due, responses.
E_X1, E_V1, E_X2, E_V2, E_U, E_LEFT, E_FREE_1, E_FREE_2, E_UNSURE, E_RESPONSE = (
    GROUP * WORK_ROWS * ROW + i * GATHERED for i in range(10)
)
LANES_WORK = E_RESPONSE + RESPONSES * GATHERED


def _entries_of(first: int, rows: int, row: int) -> Any:
    # a tuple of one lane's entries: its length is part of its type, so it must be written out
    body = ", ".join(f"q[{first + k * row} + i]" for k in range(rows))
    names: dict[str, Any] = {}
    exec(compile(f"def entries_of(q, i):\n    return ({body},)\n", "<entries_of>", "exec"), names)  # noqa: S102
    return inlined(names["entries_of"])


# of a lane's rows of ``lanes``, and of the work space's drives with an event
parameters_of = _entries_of(0, N_BASE_PARAMETERS, ROW)
responses_of, gathered_of = _entries_of(RESPONSE, RESPONSES, ROW), _entries_of(E_RESPONSE, RESPONSES, GATHERED)


@inlined
def strip_of(j: int, rows: int) -> int:
    """Return where a group's lane j is in rows that every strip has so many of."""
    return (j // LANES) * rows * ROW + j % LANES


@inlined
def stride(z: Any) -> int:
    """Return how many parameters are kept per drive: those of the base effects come first, and often suffice."""
    if z is None:
        return N_BASE_PARAMETERS
    return N_PARAMETERS


@inlined
def padded(n: int) -> int:
    """Return how many lanes to advance for n drives: whole vectors, unless there is one only."""
    return n if n < 2 else (n + 7) & ~7
