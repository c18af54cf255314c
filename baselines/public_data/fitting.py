r"""Fits by what a benchmark scores: a free simulation over a long horizon.

The rms of a position over half a minute is made by small errors of the mean force, which velocities hardly show, and what was
wrong early is in every later sample, which positions over-weigh. With :math:`T` the horizon, the residual is

.. math:: e_v + e_x / T , \qquad e_v[n] = (e_x[n] - e_x[n - d]) / (d h) ,

the first-order filter that turns a random walk of the position, as wandering friction makes it, into noise that is white above
:math:`1/T`. Outputs that do not drift (a speed, a mass on a spring) are compared as they are.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import isfinite

import numpy as np
from scipy.optimize import least_squares

from baselines.public_data.benchmark import Benchmark
from flexdrive_gym.drive.effects import LAYOUT
from flexdrive_gym.drive.parameters import parameter
from flexdrive_gym.recording import FloatArray, Recording
from identification.initial_state import with_start
from identification.replay.output_error import Run, prepare_measured, simulate_run

Values = Mapping[str, float]
# of positions over which a velocity is taken [s]
_DIFFERENCE_S = 0.01
# errors beyond this many spreads of the output say only that a drive has run away
_RUNAWAY = 20.0
# start states are found anew so often
_ROUNDS = 2


@dataclass(frozen=True, eq=False)
class Piece:
    """A stretch of a recording that starts in a state of its own."""

    run: Run
    channel: int
    spread: float

    @property
    def measured(self) -> FloatArray:
        """What was measured, ndarray, shape (n,) [engine's units]."""
        return self.run.measured[self.channel]


def piece_of(recording: Recording) -> Piece:
    """Return a recording, or a part of one, ready to be fitted."""
    run = prepare_measured(recording)
    channel = max(range(len(run.keep)), key=lambda c: int(run.keep[c].sum()))
    return Piece(run, channel, max(float(np.std(run.measured[channel])), 1e-9))


def started(values: Values, piece: Piece, benchmark: Benchmark) -> Piece:
    """Return a piece with the start state that its initialisation window tells."""
    return replace(piece, run=with_start(values, piece.run, benchmark.rule.window, moving=benchmark.topology.moving))


def simulated(values: Values, piece: Piece) -> FloatArray:
    """Return the simulated output of a piece from its start state, ndarray, shape (n,) [engine's units]."""
    return simulate_run(values, piece.run)[piece.channel]


def residual(values: Values, piece: Piece, benchmark: Benchmark) -> FloatArray:
    """Return what a fit makes small, window left out, samples of faults 0, in spreads of the output."""
    run, window = piece.run, benchmark.rule.window
    limit = _RUNAWAY * piece.spread
    error = np.clip(piece.measured - simulated(values, piece), -limit, limit)
    error = np.where(run.keep[piece.channel], error, 0.0)
    if benchmark.horizon is None:
        return np.asarray(error[window:] / piece.spread)
    d = max(1, round(_DIFFERENCE_S / run.sample_time))
    position = error[window::d]
    velocity = np.diff(position) / (d * run.sample_time)
    return np.asarray((velocity + position[1:] / benchmark.horizon) * benchmark.horizon / piece.spread)


def fit(
    values: Values, keys: Sequence[str], pieces: Sequence[Piece], benchmark: Benchmark, *, evaluations: int = 40
) -> tuple[dict[str, float], float]:
    """Fit parameters to pieces.

    Parameters
    ----------
    values
        Drive to start from; what is not in ``keys`` stays.
    keys
        Parameters that are free.
    pieces
        What to fit to.
    benchmark
        Its rule, horizon and topology.
    evaluations
        Most steps of the optimiser in each of the rounds.

    Returns
    -------
    values, cost
        The fitted drive, and its mean squared residual.
    """
    now = dict(values)
    cost = float("inf")
    for _ in range(_ROUNDS):
        placed = [started(now, p, benchmark) for p in pieces]
        space = _Space(keys, now)

        def errors(z: FloatArray, space: _Space = space, placed: Sequence[Piece] = placed) -> FloatArray:
            drive = space.drive(z)
            return np.concatenate([residual(drive, p, benchmark) for p in placed])

        begin = space.begin()
        found = least_squares(
            errors,
            begin,
            bounds=(space.low, space.high),
            x_scale=1.0,
            diff_step=np.full(len(keys), 1e-4),
            max_nfev=evaluations,
            ftol=1e-6,
            xtol=1e-6,
            gtol=1e-9,
        )
        now = space.drive(found.x)
        cost = 2.0 * float(found.cost) / max(1, len(found.fun))
    return now, cost


class _Space:
    """Parameters as the optimiser sees them: logarithms of what is positive, all else in typical sizes, within bounds."""

    def __init__(self, keys: Sequence[str], values: Values) -> None:
        self.keys, self.values = tuple(keys), dict(values)
        self.log = np.array([_logarithmic(key) for key in keys])
        self.scale = np.array([_typical(key, values) for key in keys])
        low = np.array([parameter(key).lower for key in keys])
        high = np.array([parameter(key).upper for key in keys])
        with np.errstate(divide="ignore", invalid="ignore"):
            self.low = np.where(self.log, np.log(np.maximum(low, 1e-12)), low / self.scale)
            self.high = np.where(self.log, np.log(high), high / self.scale)

    def begin(self) -> FloatArray:
        """Return the coordinates of the drive to start from, just within the bounds."""
        x = np.array([self.values.get(key, parameter(key).null) for key in self.keys])
        with np.errstate(divide="ignore", invalid="ignore"):
            z = np.where(self.log, np.log(np.maximum(x, 1e-12)), x / self.scale)
        margin = 1e-6
        return np.asarray(np.clip(z, self.low + margin, self.high - margin))

    def drive(self, z: FloatArray) -> dict[str, float]:
        """Return the drive at coordinates."""
        x = np.where(self.log, np.exp(np.where(self.log, z, 0.0)), z * self.scale)
        return {**self.values, **{key: float(v) for key, v in zip(self.keys, x, strict=True)}}


def _logarithmic(key: str) -> bool:
    if key in {"m1", "m2", "k"}:
        return True
    if key not in LAYOUT:
        return False
    q = LAYOUT[key].parameter
    return (q.role == "shape" and q.lower >= 0.0) or not isfinite(q.null)


def _typical(key: str, values: Values) -> float:
    starts = LAYOUT[key].parameter.starts if key in LAYOUT else ()
    return max(abs(values.get(key, 0.0)), abs(starts[0]) if starts else 0.0, 1e-6)
