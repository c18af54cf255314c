"""The arrays of many drives in one task, and the calls that advance and reset them."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from flexdrive_gym.drive import fleet as kernels
from flexdrive_gym.drive import parameters
from flexdrive_gym.drive.effects import N_BASE_PARAMETERS, WORKSPACE
from flexdrive_gym.drive.sample import MEMORY
from flexdrive_gym.recording import BoolArray
from flexdrive_gym.task import ERROR_SCALE_MM, SENSINGS, Task

LEAST_PER_THREAD = 2048
INFO = ("x1", "v1", "x2", "v2", "read_x1", "read_x2", "read_v1", "read_v2", "u", "xr", "e")
TERMS = ("tracking", "effort", "rate", "failure")
# rows of the state in the order of INFO and TERMS
KEYS = (*INFO, *(f"reward_{name}" for name in TERMS))


class Fleet:
    """n drives of one task.

    Parameters
    ----------
    task
        What they do.
    n
        How many.
    threads
        Threads that share the work of a step; used only where every one has at least 2,048 drives, because handing out
        work takes longer than advancing fewer. The result does not depend on it.

    Attributes
    ----------
    actions : ndarray, shape (n,)
        To be set before :meth:`step`.
    observation, reward, terminated, truncated : ndarray, shapes (n, entries), (n,), (n,), (n,)
        Written by :meth:`step` and :meth:`reset`; reused, so copy what is kept.
    state : ndarray, shape (rows, n)
        In the order of :data:`KEYS`.
    """

    def __init__(self, task: Task, n: int, threads: int = 1) -> None:
        self.task, self.n = task, n
        drawn = task.randomisation
        self.models = n if drawn.names else 1
        rig = task.rig
        full = parameters.workspace(rig.values) is not None or any(not _is_base(name) for name in drawn.names)
        delayed = rig["input_delay.tau"] > 0.0 or "input_delay.tau" in drawn.names
        one_by_one = full or delayed
        entries = task.names()
        bound = np.array([b for _name, _unit, b in entries])
        constants = np.zeros(kernels.TASK_ENTRIES)
        constants[: 7] = (
            task.control_period, task.travel_limit, task.stroke_limit,
            *(task.weights[name] for name in TERMS),
        )  # fmt: skip
        constants[7:] = ERROR_SCALE_MM, task.voltage, task.horizon, task.noise
        self.actions = np.zeros(n)
        self.state = np.zeros((kernels.STATE_ROWS, n))
        self.clock = np.zeros(n, dtype=np.int64)
        self.seeds = np.zeros(n, dtype=np.uint64)
        vector = rig.vector()
        self.p = np.tile(vector if full else vector[:N_BASE_PARAMETERS], (self.models, 1))
        self.z = np.zeros((n, WORKSPACE)) if full else None
        self.observation = np.zeros((n, len(entries)), dtype=np.float32)
        self.reward = np.zeros(n)
        self.terminated, self.truncated = np.zeros(n, dtype=np.bool_), np.zeros(n, dtype=np.bool_)
        self.bound = (np.ones(len(entries)) if task.normalise else bound).astype(np.float32)
        self.arrays: dict[str, npt.NDArray[Any]] = {
            "actions": self.actions,
            "task": constants,
            "state": self.state,
            "clock": self.clock,
            "row": np.zeros(n, dtype=np.int64),
            "seeds": self.seeds,
            "p": self.p,
            "tables": np.zeros((self.models, kernels.TABLE_COLUMNS)),
            "memory": np.zeros((n if one_by_one else 0, MEMORY)),
            "references": task.references,
            "ahead": task.ahead,
            "scale": 1.0 / bound if task.normalise else np.ones(len(entries)),
            # the space's bounds are single precision: clip to what they are
            "bound": self.bound.astype(np.float64),
            "work": np.zeros(max(kernels.LANES_WORK, len(drawn.names))),
            "observation": self.observation,
            "reward": self.reward,
            "terminated": self.terminated,
            "truncated": self.truncated,
            "nominal": np.array([rig[name] for name in drawn.names]),
            "which": np.array([parameters.index(name) for name in drawn.names], dtype=np.int64),
            "inverse": np.array([name in parameters.MASS_PARAMETERS for name in drawn.names], dtype=np.int64),
            "lowest": drawn.low,
            "highest": drawn.high,
            "factor": drawn.factor,
            "line": np.zeros((n, task.late, 4)),
        }
        self.addresses = np.array([self.arrays[name].ctypes.data for name in kernels.ARRAYS], dtype=np.int64)
        sizes = {
            kernels.DRIVES: n,
            kernels.SENSING: SENSINGS[task.sensing],
            kernels.SUBSTEPS: task.substeps,
            kernels.MODELS: self.models,
            kernels.ENTRIES: len(entries),
            kernels.PREVIEWS: len(task.ahead),
            kernels.SAMPLES: task.references.shape[1],
            kernels.REFERENCES: task.references.shape[0],
            kernels.ONE_BY_ONE: int(one_by_one),
            kernels.DRAWN: len(drawn.names),
            kernels.JOINT: int(drawn.factor.size > 0),
            kernels.LATE: task.late,
        }
        self.sizes = np.array([sizes[i] for i in range(kernels.SIZES)], dtype=np.int64)
        self._everyone = np.ones(n, dtype=np.bool_)
        self._parts = self._divide(max(1, min(threads, n // LEAST_PER_THREAD)))
        self._pool = ThreadPoolExecutor(len(self._parts)) if len(self._parts) > 1 else None

    def seed(self, seeds: npt.ArrayLike, mask: BoolArray | None = None) -> None:
        """Give every (masked) drive a random stream of its own; ``seeds`` are integers, shape (n,)."""
        values = np.asarray(seeds, dtype=np.int64).astype(np.uint64)
        # neighbouring seeds shall not have neighbouring streams
        mixed = values * np.uint64(0xD1342543DE82EF95) + np.uint64(0x2545F4914F6CDD1D)
        where = self._everyone if mask is None else mask
        self.seeds[where] = mixed[where]

    def reset(self, mask: BoolArray | None = None, start: npt.ArrayLike = (0.0, 0.0, 0.0, 0.0)) -> None:
        """Start new episodes of the (masked) drives at x1, v1, x2, v2."""
        begin = np.array(start, dtype=np.float64)
        if begin.shape != (4,) or not np.all(np.isfinite(begin)):
            raise ValueError(f"state: must be four finite numbers x1, v1, x2, v2; got {start!r}.")
        where = self._everyone if mask is None else mask
        kernels.reset_fleet(0, self.n, where, begin, self.sizes, self.addresses, self.z)

    def step(self) -> None:
        """Advance all drives by one control period under ``actions``."""
        if self._pool is None:
            kernels.step_fleet(0, self.n, self.sizes, self.addresses, self.z)
            return
        jobs = [
            self._pool.submit(kernels.step_fleet, low, high, self.sizes, addresses, self.z)
            for low, high, addresses, _held in self._parts
        ]
        for job in jobs:
            job.result()

    def _divide(self, parts: int) -> list[tuple[int, int, npt.NDArray[np.int64], Any]]:
        """Return a range of drives per thread, with work space of its own."""
        edges = np.linspace(0, self.n, parts + 1).astype(int)
        result = []
        for low, high in pairwise(edges):
            own = np.zeros_like(self.arrays["work"])
            addresses = self.addresses.copy()
            addresses[kernels.ARRAYS.index("work")] = own.ctypes.data
            result.append((int(low), int(high), addresses, own))
        return result


def _is_base(name: str) -> bool:
    return parameters.workspace({name: 1.0}) is None
