r"""Validation by leaving out blocks, and the average of structures that predicts them best.

Every recording is cut into as many contiguous blocks. Block j of *every* recording is left out at once, a structure is fitted to
the rest, and simulates the block freely by the benchmark's own rule, its start state found from the block's first samples. The
weights of the average are those of stacking (D. H. Wolpert, Stacked generalization, Neural Networks 5, 1992; L. Breiman,
Stacked regressions, Machine Learning 24, 1996): not negative, their sum 1, the least squared error of the blocks, each block
scaled to its own spread. The error of the average in block j is told with weights from the other blocks alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from itertools import pairwise

import numpy as np
from scipy.optimize import nnls

from baselines.public_data.benchmark import Benchmark, piece
from baselines.public_data.fitting import Piece, piece_of, simulated, started
from baselines.public_data.structures import Structure
from flexdrive_gym.recording import FloatArray, Recording

# weight of the demand that weights sum to 1, and of the pull towards equal ones, in squared errors of the blocks
_SUM, _EQUAL = 1e3, 1.0
# steps of a fit that begins where all blocks ended
_STEPS = 15


def cut(recording: Recording, blocks: int) -> list[tuple[int, int]]:
    """Return where the blocks of a recording begin and end."""
    edges = np.linspace(0, recording.n, blocks + 1).astype(int)
    return [(int(a), int(b)) for a, b in pairwise(edges)]


def block_errors(
    structures: Sequence[Structure],
    recordings: Sequence[Recording],
    benchmark: Benchmark,
    pool: Executor,
    say: Callable[[str], None],
) -> list[list[list[FloatArray]]]:
    """Return the free-simulation errors of structures in blocks they were not fitted to.

    Returns
    -------
    list
        ``errors[structure][block][recording]``, ndarray, shape (samples after the window,) [engine's units].
    """
    errors: list[list[list[FloatArray]]] = [[] for _ in structures]
    for j in range(benchmark.blocks):
        rest, left = [], []
        for r in recordings:
            begin, end = cut(r, benchmark.blocks)[j]
            left.append(piece_of(piece(r, begin, end, r.name)))
            rest += [
                piece_of(piece(r, a, b, r.name))
                for a, b in ((0, begin), (end, r.n))
                if b - a > 2 * benchmark.rule.window
            ]
        say(f"leaving out block {j + 1} of {benchmark.blocks}")
        fits = list(pool.map(lambda s, rest=rest: s.fitted(rest, benchmark, evaluations=_STEPS), structures))
        for i, fit in enumerate(fits):
            errors[i].append([_error(fit, p, benchmark) for p in left])
    return errors


def _error(structure: Structure, left: Piece, benchmark: Benchmark) -> FloatArray:
    p = started(structure.values, left, benchmark)
    return np.asarray((p.measured - simulated(structure.values, p))[benchmark.rule.window :])


def weights(errors: Sequence[Sequence[Sequence[FloatArray]]], leave_out: int | None = None) -> FloatArray:
    """Return the weights of the average, ndarray, shape (structures,); ``leave_out`` is a block that they may not see."""
    blocks = [j for j in range(len(errors[0])) if j != leave_out]
    columns = []
    for i in range(len(errors)):
        parts = []
        for j in blocks:
            for r in range(len(errors[0][j])):
                scale = min(float(np.sqrt(np.sum(e[j][r] ** 2))) for e in errors)
                parts.append(errors[i][j][r] / max(scale, 1e-12))
        columns.append(np.concatenate(parts))
    E = np.column_stack(columns)
    n = E.shape[1]
    best = float(np.min(np.sum(E**2, axis=0)))
    pull = np.sqrt(_EQUAL * best / n)
    A = np.vstack([E, _SUM * np.sqrt(best) * np.ones((1, n)), pull * np.eye(n)])
    b = np.concatenate([np.zeros(len(E)), [_SUM * np.sqrt(best)], np.full(n, pull / n)])
    w, _ = nnls(A, b)
    return np.asarray(w / np.sum(w))


def averaged(errors: Sequence[Sequence[Sequence[FloatArray]]]) -> list[list[FloatArray]]:
    """Return the errors of the average in every block, with weights from the other blocks, ``[block][recording]``."""
    found = []
    for j in range(len(errors[0])):
        w = weights(errors, leave_out=j)
        found.append([np.tensordot(w, [e[j][r] for e in errors], 1) for r in range(len(errors[0][j]))])
    return found
