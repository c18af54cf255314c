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

import numpy as np
from scipy.optimize import least_squares

from baselines.public_data.benchmark import Benchmark
from flexdrive_gym.recording import FloatArray, Recording
from identification.initial_state import with_start
from identification.mismatch.fitting.fit import Coordinates, resolved
from identification.replay.output_error import Run, prepare_measured, simulate_run

Values = Mapping[str, float]
# of positions over which a velocity is taken [s]
_DIFFERENCE_S = 0.01
# errors beyond this many spreads of the output say only that a drive has run away
_RUNAWAY = 20.0
# of a coordinate: an optimiser within bounds begins inside of them
_INSIDE = 1e-6
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
    error = piece.measured - simulated(values, piece) if resolved(values) else np.full(len(run.u), limit)
    error = np.clip(error, -limit, limit)
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
        space = Coordinates(keys, now)

        def errors(
            z: FloatArray, space: Coordinates = space, here: Values = now, placed: Sequence[Piece] = placed
        ) -> FloatArray:
            drive = space.to(z, here)
            return np.concatenate([residual(drive, p, benchmark) for p in placed])

        found = least_squares(
            errors,
            np.clip(space.of(now), space.low + _INSIDE, space.high - _INSIDE),
            bounds=(space.low, space.high),
            x_scale=1.0,
            diff_step=np.full(len(keys), 1e-4),
            max_nfev=evaluations,
            ftol=1e-6,
            xtol=1e-6,
            gtol=1e-9,
        )
        now = space.to(found.x, now)
        cost = 2.0 * float(found.cost) / max(1, len(found.fun))
    return now, cost
