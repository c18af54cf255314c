"""Where the kernels of a fleet find things: rows of the state, constants, the block a kernel is given, the lanes' work space.

A *fleet* keeps one column of ``state`` per drive. A kernel gets everything in one block of integers: sizes, then addresses
of arrays, so that a call has one argument. It works on :data:`LANES` drives at a time, in one flat array whose rows the
compiler sees never to overlap, which is what lets it do several drives in one instruction.
"""

from __future__ import annotations

from typing import Any

from flexdrive_gym.drive.compilation import inlined
from flexdrive_gym.drive.effects import N_BASE_PARAMETERS

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

# the block: range of drives, sizes, what a kernel reports (ENDED: how many episodes), then addresses
LOW, HIGH, DRIVES, SENSING, SUBSTEPS, LEAPS, MODELS, ENTRIES, PREVIEWS, SAMPLES, REFERENCES = range(11)
ONE_BY_ONE, DRAWN, JOINT, LATE, TELLS, ENDED = 11, 12, 13, 14, 15, 16
SIZES = 17

# one address each; :class:`~flexdrive_gym.fleet.Fleet` makes and holds the arrays
ARRAYS = (
    "actions", "task", "state", "clock", "row", "seeds", "p", "decays", "tables", "memory", "scratch", "references",
    "ahead", "scale", "bound", "work", "picks", "observation", "reward", "terminated", "truncated", "nominal", "which",
    "inverse", "lowest", "highest", "factor", "line",
)  # fmt: skip
PLACE = {name: SIZES + i for i, name in enumerate(ARRAYS)}
BLOCK = SIZES + len(ARRAYS)
(
    A_ACTIONS, A_TASK, A_STATE, A_CLOCK, A_ROW, A_SEEDS, A_P, A_DECAYS, A_TABLES, A_MEMORY, A_SCRATCH, A_REFERENCES,
    A_AHEAD, A_SCALE, A_BOUND, A_WORK, A_PICKS, A_OBSERVATION, A_REWARD, A_TERMINATED, A_TRUNCATED, A_NOMINAL, A_WHICH,
    A_INVERSE, A_LOWEST, A_HIGHEST, A_FACTOR, A_LINE,
) = range(SIZES, BLOCK)  # fmt: skip

# Rows of the lanes' work space after those of ``state``: noise, decay of the velocity filters, whether the lane needs
# more than the first piece, parameters.
NOISES = STATE_ROWS * LANES
DECAYS = NOISES + 2 * LANES
OPEN = DECAYS + 2 * LANES
PARAMETERS = OPEN + LANES
# The same for drives with an event, moved together: state, command, time left, released carts, whether a search is due.
E_X1, E_V1, E_X2, E_V2, E_U, E_LEFT, E_FREE_1, E_FREE_2, E_UNSURE = (
    PARAMETERS + (N_BASE_PARAMETERS + i) * LANES for i in range(9)
)
E_PARAMETERS = E_UNSURE + LANES
LANES_WORK = E_PARAMETERS + N_BASE_PARAMETERS * LANES


def _row_function(name: str, start: int, entries: int) -> Any:
    # a tuple of one lane's entries: its length is part of its type, so it must be written out
    body = ", ".join(f"work[{start + k * LANES} + i]" for k in range(entries))
    names: dict[str, Any] = {}
    exec(compile(f"def {name}(work, i):\n    return ({body},)\n", f"<{name}>", "exec"), names)  # noqa: S102
    return inlined(names[name])


parameters_of = _row_function("parameters_of", PARAMETERS, N_BASE_PARAMETERS)
parameters_in_event = _row_function("parameters_in_event", E_PARAMETERS, N_BASE_PARAMETERS)
