"""Forces as free functions of what was measured: candidates like the others, but without a name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from flexdrive_gym.recording import FloatArray
from identification.diagnosis.bench import Bench, Values, free
from identification.replay.output_error import simulate_run

# knots of a free function: a bend in each half and one in the middle
KNOTS = 7
# share of samples beyond the outer knots: a spline says nothing where nobody was
_TAIL = 1.0


@dataclass(frozen=True, eq=False)
class Shape:
    """A force on one cart, or between both, as a piecewise linear function of one variable.

    Attributes
    ----------
    where
        ``cart_1``, ``cart_2`` or ``spring``.
    variable
        In words.
    at : ndarray, shape (KNOTS,)
        Knots in the variable's unit.
    forces
        Functions from a recording's number to the force of one knot, ndarray, shape (2, n).
    size
        Force at which its change is taken [V].
    """

    where: str
    variable: str
    at: FloatArray
    forces: tuple[Callable[[int], FloatArray], ...]
    size: float

    @property
    def id(self) -> str:
        """What it is called where candidates are listed."""
        return f"free function of {self.variable}"

    @property
    def name(self) -> tuple[str, str]:
        """What it is called by, and where it acts."""
        return self.id, self.where


def shapes(bench: Bench, values: Values, size: float) -> list[Shape]:
    """Return the free functions that the recordings can tell: of velocity, command and time on each cart, of the deflection.

    Their variables are those of the simulation. A force that followed the measured motion would drag the simulation along with
    it, as an observer does, and explain whatever was measured.
    """
    found = []
    signals = _signals(bench, values)
    for variable, rows in signals.items():
        both = np.concatenate(rows)
        low, high = np.percentile(both, [_TAIL, 100.0 - _TAIL])
        if not high > low:
            continue
        at = np.linspace(low, high, KNOTS)
        places = ["spring"] if variable == "deflection" else [f"cart_{c + 1}" for c in range(bench.carts)]
        for where in places:
            if not variable.startswith("velocity") or variable.endswith(where[-1]):
                forces = tuple(partial(_hat, rows, at, k, where) for k in range(KNOTS))
                found.append(Shape(where, variable, at, forces, size))
    return found


def _signals(bench: Bench, values: Values) -> dict[str, list[FloatArray]]:
    found: dict[str, list[FloatArray]] = {"command": [run.u for run in bench.runs]}
    found["time"] = [run.sample_time * np.arange(len(run.u), dtype=np.float64) for run in bench.runs]
    motion = [simulate_run(values, replace(free(run), positions=True)) for run in bench.runs]
    for c in range(bench.carts):
        found[f"velocity {c + 1}"] = [
            np.asarray(np.gradient(x[c], run.sample_time), dtype=np.float64)
            for x, run in zip(motion, bench.runs, strict=True)
        ]
    if bench.carts == 2:
        found["deflection"] = [x[0] - x[1] for x in motion]
    return found


def _hat(rows: list[FloatArray], at: FloatArray, k: int, where: str, r: int) -> FloatArray:
    # beyond the outer knots the function is constant
    x = np.clip(rows[r], at[0], at[-1])
    height = np.maximum(0.0, 1.0 - np.abs(x - at[k]) / (at[1] - at[0]))
    force = np.zeros((2, len(x)))
    if where == "spring":
        force[0], force[1] = -height, height
    else:
        force[int(where[-1]) - 1] = height
    return force
