"""Forces as free functions of what was measured: candidates like the others, but without a name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from flexdrive_gym.recording import FloatArray
from identification.mismatch.fitting.bench import Bench, Values, free
from identification.mismatch.noise.friction import moving
from identification.replay.output_error import simulate_run

# what a force follows, in words, and its unit
FOLLOWS = {
    "deflection": ("the deflection of the spring", "mm"),
    "command": ("the command", "V"),
    "time": ("time", "s"),
    **{f"velocity {c}": (f"the velocity of cart {c}", "mm/s") for c in (1, 2)},
    **{f"acceleration {c}": (f"the acceleration of cart {c}", "mm/s²") for c in (1, 2)},
    **{f"place {c}": (f"the place of cart {c} along the track", "mm") for c in (1, 2)},
    **{f"time since cart {c} reversed": (f"the time since cart {c} reversed, against its motion", "s") for c in (1, 2)},
    **{f"size of the command, as friction {c}": ("the size of the command, against the motion", "V") for c in (1, 2)},
}
_FREE = "free function of "
# knots of a free function: a bend in each half and one in the middle
KNOTS = 7
# share of samples beyond the outer knots: a spline says nothing where nobody was
_TAIL = 1.0
# friction that remembers a reversal has forgotten it after this [s]
_LATE_S = 0.5


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
        return _FREE + self.variable

    @property
    def name(self) -> tuple[str, str]:
        """What it is called by, and where it acts."""
        return self.id, self.where


def followed(id_: str) -> str | None:
    """Return in words what a force without a name follows; ``None`` for the id of anything else."""
    variable = id_.removeprefix(_FREE)
    return None if variable == id_ else FOLLOWS[variable][0]


def shapes(bench: Bench, values: Values, size: float) -> list[Shape]:
    """Return the free functions that the recordings can tell.

    Forces on each cart as functions of command, time, place, its velocity and the other cart's acceleration; friction of each
    cart as functions of the command's size and of the time since the cart reversed; the spring's force as a function of its
    deflection. Their variables are those of the simulation. A force that followed the measured motion would drag the simulation
    along with it, as an observer does, and explain whatever was measured.
    """
    found = []
    for signal in _signals(bench, values):
        both = np.concatenate(signal.rows)
        low, high = np.percentile(both, [_TAIL, 100.0 - _TAIL])
        if not high > low:
            continue
        at = np.linspace(low, high, KNOTS)
        for where in signal.places:
            forces = tuple(partial(_hat, signal, at, k, where) for k in range(KNOTS))
            found.append(Shape(where, signal.variable, at, forces, size))
    return found


@dataclass(frozen=True, eq=False)
class _Signal:
    """A variable of the simulation, where its functions act, and what they are multiplied by."""

    variable: str
    rows: list[FloatArray]
    places: tuple[str, ...]
    against: list[FloatArray] | None = None


def _signals(bench: Bench, values: Values) -> list[_Signal]:
    carts = tuple(f"cart_{c + 1}" for c in range(bench.carts))
    times = [run.sample_time * np.arange(len(run.u), dtype=np.float64) for run in bench.runs]
    found = [_Signal("command", [run.u for run in bench.runs], carts), _Signal("time", times, carts)]
    motion = [simulate_run(values, replace(free(run), positions=True)) for run in bench.runs]
    for c, cart in enumerate(carts):
        x = [y[c] for y in motion]
        speed = [
            np.asarray(np.gradient(y, run.sample_time), dtype=np.float64) for y, run in zip(x, bench.runs, strict=True)
        ]
        found += [_Signal(f"velocity {c + 1}", speed, (cart,)), _Signal(f"place {c + 1}", x, (cart,))]
        if bench.carts == 2:
            # of its own acceleration a mass is the force
            rate = [np.asarray(np.gradient(v, run.sample_time)) for v, run in zip(speed, bench.runs, strict=True)]
            found.append(_Signal(f"acceleration {c + 1}", rate, (carts[1 - c],)))
        against = [-moving(y, run.sample_time, positions=True) for y, run in zip(x, bench.runs, strict=True)]
        since = [
            np.minimum(_since_change(s), _LATE_S / run.sample_time) * run.sample_time
            for s, run in zip(against, bench.runs, strict=True)
        ]
        found.append(_Signal(f"time since cart {c + 1} reversed", since, (cart,), against))
        found.append(
            _Signal(
                f"size of the command, as friction {c + 1}", [np.abs(run.u) for run in bench.runs], (cart,), against
            )
        )
    if bench.carts == 2:
        found.append(_Signal("deflection", [x[0] - x[1] for x in motion], ("spring",)))
    return found


def _since_change(direction: FloatArray) -> FloatArray:
    """Return the samples since the direction last changed."""
    at = np.arange(len(direction))
    changed = np.concatenate([[True], direction[1:] != direction[:-1]])
    return np.asarray(at - np.maximum.accumulate(np.where(changed, at, 0)), dtype=np.float64)


def _hat(signal: _Signal, at: FloatArray, k: int, where: str, r: int) -> FloatArray:
    # beyond the outer knots the function is constant
    x = np.clip(signal.rows[r], at[0], at[-1])
    height = np.maximum(0.0, 1.0 - np.abs(x - at[k]) / (at[1] - at[0]))
    if signal.against is not None:
        height = height * signal.against[r]
    force = np.zeros((2, len(x)))
    if where == "spring":
        force[0], force[1] = -height, height
    else:
        force[int(where[-1]) - 1] = height
    return force
