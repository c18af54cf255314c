"""Data sets of a drive in which nothing is left out: its own step under unknown forces, variability and encoder counts."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from scipy.signal import lfilter

from flexdrive_gym.recording import FloatArray
from identification.mismatch.fitting.bench import Bench, SingleArray, Values
from identification.mismatch.noise.estimate import Noise
from identification.mismatch.noise.friction import moving
from identification.mismatch.noise.nuisance import Direction, drawn

# draws simulated by one thread at a time
_GROUP = 20


class Simulator:
    """Makes data sets of a drive in which nothing is left out.

    Parameters
    ----------
    bench
        The recordings: commands, instants, and along which way.
    values
        The drive.
    noise
        Unknown forces, and how large run-to-run variability is.
    found
        Run-to-run variability.
    """

    def __init__(self, bench: Bench, values: Values, noise: Noise, found: Sequence[Direction]) -> None:
        self.bench, self.values, self.noise, self.found = bench, values, noise, found
        self._here = bench.residual(values, [np.zeros((2, len(run.u))) for run in bench.runs])
        forces = [d.force for d in found if d.force is not None]
        self._pushing = [i for i, d in enumerate(found) if d.force is not None]
        self._moved = [(i, d.change) for i, d in enumerate(found) if d.force is None]
        self._shapes = [
            np.array([force(r) for force in forces], dtype=np.float32).reshape(len(forces), 2 * len(run.u))
            for r, run in enumerate(bench.runs)
        ]
        # what disturbs a cart is friction for the most part: at rest it holds, as the recordings show
        self._moves = [
            np.array([moving(x, run.sample_time, positions=True) != 0.0 for x in run.track], dtype=np.float32)
            for run in bench.runs
        ]

    def rows(self, draws: range, seed: Sequence[int]) -> SingleArray:
        """Return the rows of draws against the drive itself, shape (N, draws)."""
        groups = [draws[i : i + _GROUP] for i in range(0, len(draws), _GROUP)]
        return np.column_stack(list(self.bench.pool.map(partial(self._group, seed), groups)))

    def _group(self, seed: Sequence[int], draws: range) -> SingleArray:
        runs = range(len(self.bench.runs))
        rngs = [np.random.default_rng([*seed, draw]) for draw in draws]
        amplitudes = [drawn(self.found, self.noise.scale, len(runs), 1, rng)[0] for rng in rngs]
        # one product for all draws of a group
        pushes = [np.array([a[r, self._pushing] for a in amplitudes], np.float32) @ self._shapes[r] for r in runs]
        made = [
            self._one(rng, a, [p[i] for p in pushes]) for i, (rng, a) in enumerate(zip(rngs, amplitudes, strict=True))
        ]
        return np.column_stack(made).astype(np.float32)

    def _one(self, rng: np.random.Generator, amplitude: FloatArray, push: list[SingleArray]) -> FloatArray:
        bench = self.bench
        total = [
            (_forces(self.noise, r, rng) * self._moves[r] + push[r].reshape(2, -1)).astype(np.float64)
            for r in range(len(bench.runs))
        ]
        rows = self._here - bench.residual(self.values, total) + _rounding(bench, rng)
        for i, change in self._moved:
            for r, own in enumerate(bench.rows):
                rows[own] += change[own] * amplitude[r, i]
        return np.asarray(rows * bench.valid)


def _forces(noise: Noise, r: int, rng: np.random.Generator) -> SingleArray:
    """Return unknown forces on both carts, constant within the time of a row, shape (2, n) [V]."""
    run, own = noise.bench.runs[r], float(noise.own[r])
    h, n = run.block * run.sample_time, -(-len(run.u) // run.block)
    keep = float(np.exp(-h / noise.forces.time_s))
    white, drive = rng.standard_normal((2, 2, n), dtype=np.float32)
    # stationary from the start
    drive[:, 1:] *= np.float32(np.sqrt(1.0 - keep**2))
    slow = lfilter(np.ones(1, np.float32), np.array([1.0, -keep], np.float32), drive)
    size = [own * np.array(s, dtype=np.float32)[:, None] for s in (noise.forces.white, noise.forces.slow)]
    force = np.float32(1.0 / np.sqrt(h)) * size[0] * white + size[1] * slow
    return np.repeat(force, run.block, axis=1)[:, : len(run.u)]


def _rounding(bench: Bench, rng: np.random.Generator) -> FloatArray:
    """Return what encoder counts add to the rows."""
    found = np.zeros(len(bench.valid))
    for p in bench.pieces:
        run = bench.runs[p.recording]
        size = float(np.sqrt(bench.rounding[run.name][p.cart]))
        n = p.rows.stop - p.rows.start
        error = size * np.sqrt(3.0) * rng.uniform(-1.0, 1.0, n + 1)
        found[p.rows] = error[1:] if run.positions else np.diff(error) / (run.block * run.sample_time)
    return found
