"""The arrays of many drives in one task, and the calls that advance and reset them."""

from __future__ import annotations

import sys
from collections import deque
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from itertools import pairwise
from math import ceil, isfinite, sqrt
from sys import getrefcount
from typing import Any

import numpy as np
import numpy.typing as npt

from flexdrive_gym.drive import layout, parameters
from flexdrive_gym.drive.batch import fleet as kernels
from flexdrive_gym.drive.batch import lanes, series
from flexdrive_gym.drive.compilation import entry
from flexdrive_gym.drive.effects import N_BASE_PARAMETERS, WORKSPACE
from flexdrive_gym.drive.sample import MEMORY
from flexdrive_gym.recording import BoolArray, FloatArray
from flexdrive_gym.task import ERROR_SCALE_MM, SENSINGS, Task

LEAST_PER_THREAD = 8192
SHARES = 4
INFO = ("x1", "v1", "x2", "v2", "read_x1", "read_x2", "read_v1", "read_v2", "u", "xr", "e")
TERMS = ("tracking", "effort", "rate", "failure")
# rows of the state in the order of INFO and TERMS
KEYS = (*INFO, *(f"reward_{name}" for name in TERMS))
OUTPUTS = ("observation", "reward", "terminated", "truncated")
MOST_SPARE = 4
# a count that nothing has
NEVER = -1
# what a fleet's future depends on, beside its task
KEPT = ("actions", "state", "clock", "seeds", "p", "begin", "memory", "tables", "lanes", "told", "line")


@cache
def counts_references() -> bool:
    """Whether this interpreter counts every reference at once, so that what nobody refers to may be used again.

    CPython does, with its global lock; without it, or in another interpreter, nothing is used again, which takes time but is
    never wrong. ``tests/environment/test_kept.py`` holds the environments to it by every route that was thought of.
    """
    if sys.implementation.name != "cpython" or not getattr(sys, "_is_gil_enabled", lambda: True)():
        return False
    array, info = np.zeros(2), dict.fromkeys(KEYS)
    counts, kept = [(getrefcount(array), getrefcount(info))], []
    for keep in (lambda x: x, lambda x: (x,), lambda x: x.data if x.__class__ is np.ndarray else {0: x}):
        kept.append((keep(array), keep(info)))
        counts.append((getrefcount(array), getrefcount(info)))
    return all(after > before for pair, then in pairwise(counts) for before, after in zip(pair, then, strict=True))


class Outputs:
    """What one step writes, and the blocks (one per share of the work) that send the kernels there.

    Attributes
    ----------
    observation, reward, terminated, truncated : ndarray, shapes (n, entries), (n,), (n,), (n,)
        The observation's shape may be (entries,) for a fleet of one.
    record : ndarray, shape (keys,)
        Of a fleet of one: all that is known after a step, in the order of :data:`KEYS`.
    """

    __slots__ = ("addresses", "blocks", "ended", "observation", "record", "reward", "terminated", "truncated")

    def __init__(self, shape: tuple[int, ...], n: int, parts: list[npt.NDArray[np.int64]]) -> None:
        # of the shape that is handed out: a view would not be told when a view of it is made
        self.observation = np.zeros(shape, dtype=np.float32)
        self.reward, self.record = np.zeros(n), np.zeros(len(KEYS))
        self.terminated, self.truncated = np.zeros(n, dtype=np.bool_), np.zeros(n, dtype=np.bool_)
        self.blocks = [block.copy() for block in parts]
        for name in (*OUTPUTS, "record"):
            address = getattr(self, name).ctypes.data
            for block in self.blocks:
                block[layout.PLACE[name]] = address
        self.addresses = [block.ctypes.data for block in self.blocks]
        # memoryviews read single numbers in a third of the time that array indexing takes
        self.ended: list[Any] = [memoryview(block[layout.ENDED :]) for block in self.blocks]  # type: ignore[arg-type]

    def references(self) -> int:
        """Return how often the arrays are referred to, by whoever got them and their views included."""
        return (
            getrefcount(self.observation)
            + getrefcount(self.reward)
            + getrefcount(self.terminated)
            + getrefcount(self.truncated)
        )


class Fleet:
    """n drives of one task.

    Parameters
    ----------
    task
        What they do.
    n
        How many.
    threads
        Threads that share the work of a step; used only where each would have at least 8,192 drives, because handing out
        work takes longer than advancing fewer. The result does not depend on it.
    tells
        Whether :meth:`step` keeps reference, error and the reward's terms of :meth:`state` up to date, which takes time.

    Attributes
    ----------
    actions : ndarray, shape (n,)
        To be set before :meth:`step`.
    outputs : Outputs
        Observation, reward and the flags that the last :meth:`step` or :meth:`reset` wrote. A step never writes into
        arrays that somebody still refers to.
    ended : int
        How many episodes ended in the last step.
    """

    def __init__(self, task: Task, n: int, threads: int = 1, *, tells: bool = True) -> None:
        self.task, self.n = task, n
        drawn, rig, entries = task.randomisation, task.rig, task.names()
        full = parameters.workspace(rig.values) is not None or any(not _is_base(name) for name in drawn.names)
        delayed = rig["input_delay.tau"] > 0.0 or "input_delay.tau" in drawn.names
        self.one_by_one = full or delayed
        limits = np.array([b for _name, _unit, b in entries])
        self.bound = (np.ones(len(entries)) if task.normalise else limits).astype(np.float32)
        self.z = np.zeros((n, WORKSPACE)) if full else None
        self.arrays = self._arrays(full, 1.0 / limits if task.normalise else np.ones(len(entries)))
        self.actions, self.clock, self.seeds, self.p, self._state, self._told = (
            self.arrays[name] for name in ("actions", "clock", "seeds", "p", "state", "told")
        )
        sizes = self._sizes(tells=tells)
        self._everyone = np.arange(n)
        useful = max(1, min(threads, n // LEAST_PER_THREAD))
        self._parts, self._work = self._divide(sizes, useful * SHARES if useful > 1 else 1)
        self._helpers = useful - 1
        self._pool = ThreadPoolExecutor(self._helpers) if self._helpers else None
        self.ended = 0
        self.outputs = self.new_outputs()
        for address in self.outputs.addresses:
            kernels.prepare_fleet(address)
        self._unreferenced = self.outputs.references() if counts_references() else NEVER
        self._spare = [self.outputs]
        self.kernel = entry(kernels.step_single if n == 1 else kernels.step_fleet, 0, self.z)

    def seed(self, seeds: npt.ArrayLike, mask: BoolArray | None = None) -> None:
        """Give every (masked) drive a random stream of its own; ``seeds`` are integers, shape (n,)."""
        values = np.asarray(seeds, dtype=np.int64).astype(np.uint64)
        # neighbouring seeds shall not have neighbouring streams
        mixed = values * np.uint64(0xD1342543DE82EF95) + np.uint64(0x2545F4914F6CDD1D)
        where = self._everyone if mask is None else mask
        self.seeds[where] = mixed[where]

    def reset(self, which: npt.NDArray[np.int64] | None = None, start: npt.ArrayLike = (0.0, 0.0, 0.0, 0.0)) -> None:
        """Start new episodes of the drives with these numbers, or of all, at x1, v1, x2, v2; writes into :attr:`outputs`."""
        begin = np.array(start, dtype=np.float64)
        if begin.shape != (4,) or not np.all(np.isfinite(begin)):
            raise ValueError(f"state: must be four finite numbers x1, v1, x2, v2; got {start!r}.")
        for address in self.outputs.addresses:
            kernels.reset_fleet(address, self._everyone if which is None else which, begin, self.z)

    def step(self) -> Outputs:
        """Advance all drives by one control period under ``actions``; return :attr:`outputs`, others than before.

        Raises
        ------
        ValueError
            If an action is no finite number; no drive was advanced then.
        """
        out = self._unused()
        if self._pool is None:
            self.kernel(out.addresses[0], self.z)
            self.ended = out.ended[0][0]
            if self.ended < 0:
                self.refuse()
            self.outputs = out
            return out
        # shares of the work are refused one by one, and none shall be done without the others
        if not isfinite(np.add.reduce(self.actions)) and not np.isfinite(self.actions).all():
            self.refuse()
        self.outputs = out
        # every thread takes shares until none is left, so that one that is late or never scheduled costs little
        shares = deque(out.addresses)
        jobs = [self._pool.submit(self._take, shares) for _ in range(self._helpers)]
        self._take(shares)
        for job in jobs:
            if not job.cancel():
                job.result()
        self.ended = sum(view[0] for view in out.ended)
        return out

    def refuse(self) -> None:
        """Raise what says which action is no finite number."""
        self.ended = 0
        odd = np.flatnonzero(~np.isfinite(self.actions))
        first = self.actions[odd[0]]
        which = "" if self.n == 1 else f" for drive {odd[0]}" + (f" and {odd.size - 1} more" if odd.size > 1 else "")
        raise ValueError(
            f"action: must be a finite number, command over the voltage limit; got {first}{which}. No drive was advanced; look "
            "for the nan in what gave the action."
        )

    def drawn(self) -> dict[str, FloatArray]:
        """Return the drawn parameters of the present episodes by name, shape (n,) each; empty without randomisation."""
        names, which = self.task.randomisation.names, self.arrays["which"]
        values = {name: self.p[:, i] for name, i in zip(names, which, strict=True)}
        # a vector of parameters holds inverse masses
        return {n: 1.0 / v if n in parameters.MASS_PARAMETERS else v.copy() for n, v in values.items()}

    def _take(self, shares: deque[int]) -> None:
        while shares:
            try:
                address = shares.popleft()
            except IndexError:
                return  # another thread was faster
            self.kernel(address, self.z)

    def renew(self) -> None:
        """Go on in arrays that nobody refers to, with the same contents."""
        old, self.outputs = self.outputs, self._unused()
        for name in OUTPUTS:
            getattr(self.outputs, name)[...] = getattr(old, name)

    def state(self) -> dict[str, FloatArray]:
        """Return what is known of the drives: :data:`KEYS` to arrays, shape (n,)."""
        rows = [self._state[:, k] for k in range(layout.STATE_ROWS)] + [
            self._told[:, k] for k in range(layout.TOLD_ROWS)
        ]
        return {key: row[:, : layout.LANES].reshape(-1)[: self.n].copy() for key, row in zip(KEYS, rows, strict=True)}

    def keep(self) -> dict[str, npt.NDArray[Any]]:
        """Return copies of all that the future depends on, for :meth:`restore`."""
        kept = {name: self.arrays[name].copy() for name in KEPT}
        return kept if self.z is None else kept | {"z": self.z.copy()}

    def restore(self, kept: dict[str, npt.NDArray[Any]]) -> None:
        """Go on where a fleet of the same task and size was when :meth:`keep` was called."""
        for name in KEPT:
            self.arrays[name][...] = kept[name]
        if self.z is not None:
            self.z[...] = kept["z"]

    def new_outputs(self, *, flat: bool = False) -> Outputs:
        """Return outputs of this fleet that were never used; ``flat``: of a fleet of one, without its axis."""
        entries = len(self.bound)
        return Outputs((entries,) if flat else (self.n, entries), self.n, self._parts)

    def _unused(self) -> Outputs:
        """Return outputs that nobody refers to: used ones if they were dropped, else new ones."""
        for out in self._spare:
            if out.references() == self._unreferenced:
                return out
        fresh = self.new_outputs()
        # whoever keeps what it gets will not give it back: forget the oldest
        self._spare = [fresh, *self._spare[: MOST_SPARE - 1]]
        return fresh

    def _arrays(self, full: bool, scale: FloatArray) -> dict[str, npt.NDArray[Any]]:
        """Return what the kernels read and write, beside outputs and work spaces, by the names of the layout."""
        task, n, drawn, rig = self.task, self.n, self.task.randomisation, self.task.rig
        models, strips, alone = n if drawn.names else 1, ceil(n / layout.LANES), n if self.one_by_one else 0
        # the space's bounds are single precision: clip to what they are
        bound, vector = self.bound.astype(np.float64), rig.vector()
        return {
            "actions": np.zeros(n),
            "task": _constants(task),
            "state": np.zeros((strips, layout.STATE_ROWS, layout.ROW)),
            "told": np.zeros((strips, layout.TOLD_ROWS, layout.ROW)),
            "clock": np.zeros(n, dtype=np.int64),
            "begin": np.zeros(n, dtype=np.int64),
            "seeds": np.zeros(n, dtype=np.uint64),
            "p": np.tile(vector if full else vector[:N_BASE_PARAMETERS], (models, 1)),
            "lanes": np.zeros((strips if drawn.names else 1, layout.PARAMETER_ROWS, layout.ROW)),
            "tables": np.zeros((min(alone, models), lanes.TABLE_COLUMNS)),
            "memory": np.zeros((alone, MEMORY)),
            "lookup": _lookup(task, scale, bound),
            "scale": scale,
            "bound": bound,
            "nominal": np.array([rig[name] for name in drawn.names]),
            "which": np.array([parameters.index(name) for name in drawn.names], dtype=np.int64),
            "inverse": np.array([name in parameters.MASS_PARAMETERS for name in drawn.names], dtype=np.int64),
            "lowest": drawn.low,
            "highest": drawn.high,
            "factor": drawn.factor,
            "line": np.zeros((n, task.late, 4)),
        }

    def _sizes(self, *, tells: bool) -> dict[int, int]:
        """Return the block's entries that all shares of the work have in common."""
        task, drawn = self.task, self.task.randomisation
        number, short = leaps(task)
        return {
            layout.DRIVES: self.n,
            layout.SENSING: SENSINGS[task.sensing],
            layout.SUBSTEPS: task.substeps,
            layout.LEAPS: number,
            layout.SHORT: int(short),
            layout.ENTRIES: len(self.bound),
            layout.PREVIEWS: len(task.preview_periods),
            layout.SAMPLES: self.arrays["lookup"].shape[1],
            layout.REFERENCES: task.references.shape[0],
            layout.ONE_BY_ONE: int(self.one_by_one),
            layout.DRAWN: len(drawn.names),
            layout.JOINT: int(drawn.factor.size > 0),
            layout.LATE: task.late,
            layout.TELLS: int(tells),
        }

    def _divide(self, sizes: dict[int, int], parts: int) -> tuple[list[npt.NDArray[np.int64]], list[Any]]:
        """Return a block per share of the work, and the work spaces that belong to them."""
        edges = np.linspace(0, ceil(self.n / layout.LANES), parts + 1).astype(int) * layout.LANES
        blocks, held = [], []
        for low, high in pairwise(edges):
            own: dict[str, npt.NDArray[Any]] = {
                "work": np.zeros(max(layout.LANES_WORK, sizes[layout.DRAWN])),
                "picks": np.zeros(layout.GATHERED, dtype=np.int64),
                "shown": np.zeros((layout.LANES, sizes[layout.PREVIEWS] + 1), dtype=np.float32),
                "entries": np.zeros((len(self.bound), layout.ROW), dtype=np.float32),
            }
            block = np.zeros(layout.BLOCK, dtype=np.int64)
            for i, value in {**sizes, layout.LOW: int(low), layout.HIGH: min(int(high), self.n)}.items():
                block[i] = value
            for name, array in {**self.arrays, **own}.items():
                block[layout.PLACE[name]] = array.ctypes.data
            blocks.append(block)
            held.append(own)
        return blocks, held


def leaps(task: Task) -> tuple[int, bool]:
    """Return in how many leaps a control period is advanced, and whether short series do, for every drive that is drawn."""
    low = {name: task.rig[name] for name in ("m1", "m2", "b1", "b2", "k", "C")}
    high = dict(low)
    drawn = task.randomisation
    for name, least, most in zip(drawn.names, drawn.low, drawn.high, strict=True):
        low[name], high[name] = least, most
    w1, w2 = 1.0 / low["m1"], 1.0 / low["m2"]
    rate = sqrt(high["k"] * (w1 + w2)) + high["b1"] * w1 + high["b2"] * w2 + high["C"] * (w1 + w2)
    reach = rate * task.control_period
    return max(1, ceil(reach / series.REACH - 1e-9)), reach <= series.SHORT_REACH


def _constants(task: Task) -> FloatArray:
    weights = (task.weights[name] for name in TERMS)
    return np.array([
        task.control_period, task.travel_limit, task.stroke_limit, *weights,
        ERROR_SCALE_MM, task.voltage, task.horizon, task.noise,
    ])  # fmt: skip


def _lookup(task: Task, scale: FloatArray, bound: FloatArray) -> npt.NDArray[Any]:
    """Return a row per reference and instant: its value, then value and preview as the observation shows them.

    All that a drive looks up in a step is then in one place.
    """
    instants = (0, *task.preview_periods)
    row = np.dtype([("exact", np.float64), ("shown", np.float32, (len(instants),))], align=True)
    samples = task.horizon + 2
    table = np.zeros((len(task.references), samples), dtype=row)
    table["exact"] = task.references[:, :samples]
    # entries are error, reference, command, preview at the end
    places = (-2 - len(task.preview_periods), *range(-len(task.preview_periods), 0))
    for k, (later, place) in enumerate(zip(instants, places, strict=True)):
        values = task.references[:, later : later + samples] * scale[place]
        table["shown"][:, :, k] = np.clip(values, -bound[place], bound[place])
    return table


def _is_base(name: str) -> bool:
    return parameters.workspace({name: 1.0}) is None
