r"""The noise of a data set: unknown forces, encoder counts, and what differs from run to run.

The rows of recording r are, around the simulation of a drive that lacks nothing, the response to forces that nobody knows
(:mod:`identification.mismatch.noise.whiten`), scaled by :math:`\lambda_r`, and to amplitudes :math:`a_r \sim N(0, S)` of
everything that
differs between runs (:mod:`identification.mismatch.noise.nuisance`). A row is whitened by the innovations' filter F and then
by what the amplitudes leave,

.. math:: W_r = (I - U(1 - (1 + \lambda^2)^{-1/2}) U^T) F_r, \qquad F_r D_r S^{1/2} = U \lambda V^T .

What nobody has named yet is no noise. Base parameters and all candidates change the rows by :math:`C b` in all recordings
alike, with :math:`b \sim N(0, I)` in units of what each may well be. So b and the amplitudes are told together (C. R. Henderson,
Biometrics 31, 1975), and the noise is that of what both leave.

Five parameters are of the whole data set: intensities of white and of slow forces on each cart, and the slow ones'
correlation time. They
and :math:`S` maximise the likelihood of the residual. A recording has its own :math:`\lambda_r`, half of which is its
own and half the data set's: each has a vote, however small its motion, and none is given up for a quiet one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.optimize import minimize

from flexdrive_gym.recording import BoolArray, FloatArray
from identification.mismatch.fitting.bench import Bench, Columns, Rows, SingleArray, Values
from identification.mismatch.fitting.experiments import IntArray
from identification.mismatch.noise.friction import dry_level
from identification.mismatch.noise.nuisance import Direction
from identification.mismatch.noise.told import Told, inverse, scales
from identification.mismatch.noise.whiten import Filter, transitions
from identification.replay.lanes import Across

# intensity of white forces [s^½], standard deviation of slow ones [1], relative to dry friction, and their time [s],
# where a search begins; it ends anywhere within a factor of fifty, for which the prior below asks no more than a few units of
# log-likelihood
WHITE, SLOW, TIME_S = 0.01, 0.1, 0.3
# share of the command that unknown forces may have: more is something left out; white ones as their mean over so many seconds
_MOST_OF_COMMAND, _MEAN_S = 0.1, 0.05
# slow forces over those that a search begins with, from which on they may be something left out: where they are not, asking
# costs time alone, for the more probable account is kept
_UNUSUAL = 2.0
# between a block and a run [s]
_TIMES_S = (0.005, 10.0)
# share of the command that dry friction has at least, where the search begins, and at most: forces as large as they may be are
# unusual on a rig whose friction holds it most of the time, too
_LEAST_LEVEL, _MOST_LEVEL = 0.02, _MOST_OF_COMMAND / (SLOW * _UNUSUAL)
# standard deviation of the logarithms of these over rigs
_BETWEEN_RIGS = 2.0
# most evaluations of the likelihood per search, and the last radius of its trust region in logarithms: two per cent of an
# intensity, which the likelihood hardly resolves
_EVALUATIONS, _RESOLVED = 120, 0.02
# share of the unknown forces in recordings of a cart that hardly moves
_STILL = 1e-3
# first radius of the first search, and of the second, which begins where the first ended
_RADIUS = 1.0, 0.25
# steps of expectation maximisation
_MAXIMISATIONS = 6
# singular values under which a direction is lost in the noise
_SEEN = 0.1


@dataclass(frozen=True)
class Forces:
    """Unknown forces of a data set.

    Attributes
    ----------
    white, slow
        Per cart: intensity [V √s] and standard deviation [V].
    time_s
        Correlation time of the slow ones.
    """

    white: tuple[float, float]
    slow: tuple[float, float]
    time_s: float

    @classmethod
    def of(cls, theta: FloatArray, level: float, command: float) -> Forces:
        """Return the forces from logarithms relative to the start of a search.

        Parameters
        ----------
        level, command
            Dry friction, and the rms command [V]. What is a larger share of the command is no noise.
        """
        most = _MOST_OF_COMMAND * command
        w = np.minimum(WHITE * level * np.exp(np.minimum(theta[:2], 50.0)), most * np.sqrt(_MEAN_S))
        s = np.minimum(SLOW * level * np.exp(np.minimum(theta[2:4], 50.0)), most)
        t = np.clip(TIME_S * np.exp(np.clip(theta[4], -50.0, 50.0)), *_TIMES_S)
        return cls((float(w[0]), float(w[1])), (float(s[0]), float(s[1])), float(t))

    def theta(self, level: float) -> FloatArray:
        """Return the logarithms relative to the start of a search."""
        relative = [
            *np.array(self.white) / (WHITE * level),
            *np.array(self.slow) / (SLOW * level),
            self.time_s / TIME_S,
        ]
        return np.log(np.maximum(relative, 1e-12))


@dataclass(frozen=True, eq=False)
class Noise:
    """Noise of a data set around one drive.

    Attributes
    ----------
    bench
        The recordings.
    values
        Drive that the linear response is taken of.
    forces
        Unknown forces.
    own : ndarray, shape (R,)
        Scale of every recording's forces.
    rests : list of ndarray of int, shape (blocks,)
        Which carts rest in every block, as in :attr:`~identification.mismatch.fitting.bench.Bench.resting`: those that rest in
        the simulation of the drive, too.
    scale
        Group of run-to-run variability to its standard deviation over the prior one.
    modes : list of ndarray of float32, shape (rows of a recording, m)
        Directions that are damped, per recording; empty without variability.
    weights : ndarray, shape (N,), or None
        Of rows whitened by the filter: below 1 where noise acts on friction and scatters them more widely than the
        filter expects.
    spread : list of ndarray of float32, shape (rows of a recording, m)
        Directions that are damped further, because simulations of this noise scatter more widely in them than its linear
        model expects.
    cost
        Of the residual that it was estimated from: the negative logarithm of its probability density, but for a constant.
    """

    bench: Bench
    values: Values
    forces: Forces
    own: FloatArray
    rests: Sequence[IntArray]
    scale: Mapping[str, float] = field(default_factory=dict)
    modes: Sequence[SingleArray] = ()
    weights: FloatArray | None = None
    spread: Sequence[SingleArray] = ()
    cost: float = 0.0
    _made: dict[int, Filter] = field(default_factory=dict, init=False, repr=False)

    @cached_property
    def _transitions(self) -> dict[float, tuple[FloatArray, FloatArray]]:
        """Return transition and covariance over each step that recordings have."""
        q, s = np.array(self.forces.white), np.array(self.forces.slow)
        steps = {run.block * run.sample_time for run in self.bench.runs}
        return {h: transitions(self.values, h, q, s, self.forces.time_s) for h in steps}

    def _filter(self, r: int) -> Filter:
        """Return the filter of a recording, made when it is asked for first."""
        if r not in self._made:
            bench, run = self.bench, self.bench.runs[r]
            # what is compared by position hardly moves: friction holds it against forces that nobody knows
            own = _STILL if run.positions else float(self.own[r])
            step = run.block * run.sample_time
            A, Q = self._transitions[step]
            rho = bench.rounding[run.name]
            start = np.array([rho[0], 0.0, rho[-1], 0.0, *(own * np.array(self.forces.slow)) ** 2, 0.0, 0.0])
            valid = bench.valid[bench.rows[r]].reshape(len(run.keep), -1)
            step = 0.0 if run.positions else step
            self._made[r] = Filter.of(A, own**2 * Q, self.rests[r], start, rho, valid, step)
        return self._made[r]

    def logarithm(self, which: BoolArray) -> float:
        """Return the sum of the logarithms of the innovations' variances in some rows, shape (N,)."""
        variance = np.concatenate([self._filter(r).variance.ravel() for r in range(len(self.bench.runs))])
        return float(np.log(variance[which]).sum())

    def innovations(self, x: Rows, across: Across = map) -> Rows:
        """Return rows whitened by the filter alone, shape (N,) or (N, k), in their precision."""
        return self._each(x, self._filtered, across)

    def white(self, x: Rows, across: Across = map) -> Rows:
        """Return whitened rows of raw ones, shape (N,) or (N, k), in their precision.

        Parameters
        ----------
        across
            Maps over recordings: ``map``, or that of a pool whose threads are free.
        """
        return self._each(x, self._damped, across)

    def _each(self, x: Rows, one: Callable[[int, Rows], Rows], across: Across) -> Rows:
        columns = x[:, None] if x.ndim == 1 else x
        out = np.empty(columns.shape, columns.dtype)

        def fill(r: int) -> None:
            rows = self.bench.rows[r]
            out[rows] = one(r, columns[rows])

        list(across(fill, range(len(self.bench.rows))))
        return out[:, 0] if x.ndim == 1 else out

    def _filtered(self, r: int, x: Rows) -> Rows:
        own = self._filter(r)
        y = own.white(x.reshape(*own.valid.shape, x.shape[1])).reshape(x.shape)
        if self.weights is not None:
            y *= self.weights[self.bench.rows[r], None]
        return y

    def _damped(self, r: int, x: Rows) -> Rows:
        y = self._filtered(r, x)
        for U in (modes[r] for modes in (self.modes, self.spread) if modes and modes[r].size):
            # what is taken off needs no more than single precision, which is half the memory to go through
            y -= U @ (U.T @ y.astype(np.float32, copy=False))
        return y


def first_noise(bench: Bench, values: Values) -> Noise:
    """Return the noise before anything is known of it."""
    forces = Forces.of(np.zeros(5), *_level(bench, values))
    return Noise(bench, dict(values), forces, np.ones(len(bench.runs)), bench.resting_with(values))


def of_most(noise: Noise) -> FloatArray:
    """Return unknown forces as shares of the largest that they may be, white and slow ones, shape (2, carts)."""
    bench, own = noise.bench, noise.forces
    most = Forces.of(np.full(5, np.inf), *_level(bench, noise.values))
    return np.asarray(np.array([own.white, own.slow]) / np.array([most.white, most.slow]))[:, : bench.carts]


def with_usual_forces(noise: Noise) -> Noise | None:
    """Return the noise with slow forces as a search for them begins; ``None`` where they are not much larger.

    Forces that are unusually large are something left out, or hide it.
    """
    bench, forces = noise.bench, noise.forces
    slow = Forces.of(np.zeros(5), *_level(bench, noise.values)).slow
    if max(forces.slow[: bench.carts]) < _UNUSUAL * slow[0]:
        return None
    return replace(noise, forces=replace(forces, slow=slow))


def estimate(
    bench: Bench,
    values: Values,
    residual: FloatArray,
    found: Sequence[Direction],
    near: Noise | None = None,
    common: SingleArray | None = None,
) -> Noise:
    """Return the noise that a residual shows.

    Parameters
    ----------
    values
        Drive around which rows respond to forces.
    residual
        Its raw rows.
    found
        Run-to-run variability around it.
    near
        Noise of a residual like this one, from which the search begins.
    common : ndarray of float32, shape (N, k)
        Raw changes of rows that all recordings may share, of amplitudes N(0, 1): parameters, and everything that could be
        named. Noise is what these do not explain.

    Raises
    ------
    ValueError
        If no likelihood can be computed: whatever followed from that would be meaningless.
    """
    level = _level(bench, values)
    noise = first_noise(bench, values)
    if near is not None:
        noise = replace(noise, forces=near.forces, own=near.own)
    if not found:
        return _likeliest(bench, noise, residual, level, _RADIUS[0])
    common = np.empty((len(residual), 0), np.float32) if common is None else common
    D = np.column_stack([(d.change * d.size).astype(np.float32) for d in found])
    columns = np.column_stack([D, common, residual.astype(np.float32)])

    def told(noise: Noise, scale: Mapping[str, float]) -> Told:
        return Told.of(noise.innovations(columns, bench.pool.map), bench.rows, found, scale, bench.pool.map)

    # expectation maximisation shrinks slowly what was large around another drive: it begins from the prior
    scale = {d.group: 1.0 for d in found}
    rest = told(noise, scale).left(bench, D, common, residual) if common.shape[1] else residual
    for radius in _RADIUS:
        if near is None or rest is not residual:
            noise = _likeliest(bench, noise, rest, level, radius)
        now = told(noise, scale)
        for _ in range(_MAXIMISATIONS):
            scale = scales(now.amplitude, now.variance, found)
            now = now.with_scale(found, scale)
        # what differs from run to run is no force that nobody knows
        rest = now.left(bench, D, common, residual)
    modes, logarithm = damped_modes(bench, now.directions, found, scale)
    noise = replace(noise, scale=scale, modes=modes)
    e = noise.white(residual - common @ now.common.astype(np.float32), bench.pool.map)
    return replace(noise, cost=float(0.5 * (e @ e) + 0.5 * (noise.logarithm(bench.valid) + logarithm)))


def unexplained(noise: Noise, residual: FloatArray, common: SingleArray) -> FloatArray:
    """Return the raw residual without what changes explain that all recordings share, shape (N,)."""
    if not common.shape[1]:
        return residual
    C, e = noise.white(common, noise.bench.pool.map), noise.white(residual)
    bench = noise.bench
    information = bench.products(C, across=bench.pool.map).sum(axis=0)
    own = inverse(information + np.eye(len(information))) @ bench.products(C, e[:, None]).sum(axis=0)[:, 0]
    return np.asarray(residual - common @ own.astype(np.float32))


def damped(noise: Noise, found: Sequence[Direction]) -> Noise:
    """Return the noise with other run-to-run variability."""
    plain = replace(noise, modes=())
    if not found:
        return plain
    white = plain.innovations(np.column_stack([d.change * d.size for d in found]), noise.bench.pool.map)
    return replace(plain, modes=damped_modes(noise.bench, white, found, noise.scale)[0])


def _level(bench: Bench, values: Values) -> tuple[float, float]:
    """Return the mean dry friction of the carts, and the rms command [V]."""
    command = float(np.sqrt(np.mean(np.concatenate([run.u for run in bench.runs]) ** 2)))
    dry = float(np.mean([dry_level(values, c) for c in range(bench.carts)]))
    return float(np.clip(dry, _LEAST_LEVEL * command, _MOST_LEVEL * command)), command


def _likeliest(bench: Bench, near: Noise, rest: FloatArray, level: tuple[float, float], radius: float) -> Noise:
    """Return the noise with the most likely unknown forces.

    By quadratic models in a trust region (T. M. Ragonneau, Z. Zhang, COBYQA, 2023): a simplex ends far from the optimum where
    a base model lacks much.

    Parameters
    ----------
    rest : ndarray, shape (N,)
        Raw residual without what differs from run to run.
    level
        Dry friction and command [V].
    radius
        First one of the trust region.
    """

    def noise(theta: FloatArray, own: FloatArray) -> Noise:
        return replace(near, forces=Forces.of(theta, *level), own=own)

    def cost(theta: FloatArray) -> float:
        trial = noise(theta, near.own)
        w = trial.innovations(rest, bench.pool.map)[bench.moves]
        return float(0.5 * (w @ w) + 0.5 * trial.logarithm(bench.moves) + 0.5 * np.sum((theta / _BETWEEN_RIGS) ** 2))

    options: Any = {"maxfev": _EVALUATIONS, "initial_tr_radius": radius, "final_tr_radius": _RESOLVED}
    found = minimize(cost, near.forces.theta(level[0]), method="COBYQA", options=options)
    if not np.isfinite(found.fun):
        drive = ", ".join(f"{n} = {v:.3g}" for n, v in near.values.items())
        raise ValueError(
            f"recordings: their likelihood must be a number; got {found.fun:g} around a drive with {drive}. See what "
            "their units are taken for: flexdrive check."
        )
    own = _own(bench, noise(np.asarray(found.x), np.ones(len(bench.runs))), rest)
    return replace(noise(np.asarray(found.x), own), cost=float(found.fun))


def _own(bench: Bench, noise: Noise, rest: FloatArray) -> FloatArray:
    """Return the scale of every recording's forces: half its own variance, half the data set's."""
    w = noise.innovations(rest)
    w = np.where(bench.moves, w, 0.0)
    count = np.array([max(int(bench.moves[rows].sum()), 1) for rows in bench.rows])
    square = np.array([float(w[rows] @ w[rows]) for rows in bench.rows]) / count
    share = bench.settings.own_share
    return np.asarray(np.sqrt(np.clip(share * square + (1.0 - share), 0.1, 10.0)))


def damped_modes(
    bench: Bench, white: Columns, found: Sequence[Direction], scale: Mapping[str, float]
) -> tuple[list[SingleArray], float]:
    """Return what is damped, per recording, and the sum of the logarithms of the variances in these directions.

    Parameters
    ----------
    white : ndarray, shape (N, k)
        The directions, of prior size, whitened by all else.
    """
    modes, logarithm = [], 0.0
    sizes = np.array([scale[d.group] for d in found])
    for rows in bench.rows:
        # of a tall matrix, by its products
        D = white[rows] * sizes
        square, V = np.linalg.eigh(D.T @ D)
        seen = square > _SEEN**2
        s = np.sqrt(square[seen])
        U = D @ V[:, seen] / s
        modes.append(np.asarray(U * np.sqrt(1.0 - 1.0 / np.sqrt(1.0 + s**2)), dtype=np.float32))
        logarithm += float(np.log1p(square[seen]).sum())
    return modes, logarithm
