r"""Shapes without a name, along the track: a force that is any function of the place, though every run began anywhere.

Encoders count from where a run began, so the profile :math:`h` of a force that stands on the track (a magnet, a stop, a dent)
meets recording r moved by an unknown :math:`s_r`. With hat functions between knots along the way of each recording, :math:`B_r`
their comparable sensitivities, and :math:`\varepsilon` the residual,

.. math:: \min_{h, s} \; \Bigl\| \varepsilon + \sum_r B_r\, h(\cdot + s_r) \Bigr\|^2 + \rho\, \|h\|^2

is solved by turns: the profile for all moves, each move for the profile of the *other* recordings. A name for something that
repeats along the track, or pulls towards a place, explains a part of any such force; how much the profile of the others explains
of a recording tells whether that name is only the nearest one. Rough tracks have profiles, too, and moves are free: what chance
reaches is found by doing the same with every null draw.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from flexdrive_gym.recording import FloatArray
from identification.mismatch.candidates import Candidate
from identification.mismatch.chance import Chance
from identification.mismatch.refit import Fit
from identification.mismatch.screening import Screened, orthonormal
from identification.mismatch.shapes import ALONG_TRACK, Shape
from identification.mismatch.workbench import Columns, Workbench

# every track has hills: what explains less than this share of the squared error is no more than that
PLAIN = 0.15
# knots along the widest way of a recording, and how far recordings are moved over one another at most
KNOTS, MOVES = 48, 24
_SIZE_V = 0.05
# of the mean square of the sensitivities
_RIDGE = 0.01
_TURNS = 5
_USUAL = 1e-3


@dataclass(frozen=True, eq=False)
class _Laid:
    """Recordings that can be laid over one another.

    Attributes
    ----------
    squares, fitted : list of ndarray, shapes (K, K) and (K, m)
        :math:`B_r^T B_r`, and :math:`B_r^T Q` with orthonormal directions Q that a refit of the drive takes out.
    moves
        How many knots they may be moved at most.
    """

    squares: list[FloatArray]
    fitted: list[FloatArray]
    moves: int

    @property
    def ridge(self) -> float:
        return _RIDGE * float(np.trace(sum(self.squares))) / len(self.squares[0])

    def profile(self, scores: Sequence[FloatArray], moved: Sequence[int | None], but: int | None = None) -> FloatArray:
        """Return the profile of all recordings that have a move, or all but one, shape (K + 2 moves,)."""
        laid = [None if r == but else move for r, move in enumerate(moved)]
        right = np.zeros(len(scores[0]) + 2 * self.moves)
        for score, move in zip(scores, laid, strict=True):
            if move is not None:
                right[move : move + len(score)] -= score
        return np.asarray(np.linalg.solve(self._normal(laid), right), dtype=np.float64)

    def band(self, left: Sequence[FloatArray], moved: Sequence[int]) -> FloatArray:
        """Return the standard error of the profile over the recordings, from the scores of what it leaves."""
        each = np.zeros((len(left), len(left[0]) + 2 * self.moves))
        for row, score, move in zip(each, left, moved, strict=True):
            row[move : move + len(score)] = score
        return np.asarray(np.sqrt(np.sum(np.linalg.solve(self._normal(moved), each.T) ** 2, axis=1)))

    def _normal(self, moved: Sequence[int | None]) -> FloatArray:
        K = len(self.squares[0])
        normal = self.ridge * np.eye(K + 2 * self.moves)
        hidden = np.zeros((len(normal), self.fitted[0].shape[1]))
        for r, move in enumerate(moved):
            if move is not None:
                here = slice(move, move + K)
                normal[here, here] += self.squares[r]
                hidden[here] += self.fitted[r]
        return np.asarray(normal - hidden @ hidden.T)

    def best_move(self, profile: FloatArray, score: FloatArray, r: int) -> tuple[int, float]:
        """Return where a profile explains most of a recording, and how much of its square."""
        pieces = np.lib.stride_tricks.sliding_window_view(profile, len(score))
        gained = -2.0 * pieces @ score - np.einsum("ij,ij->i", pieces @ self.squares[r], pieces)
        best = int(np.argmax(gained))
        return best, float(gained[best])

    def lay(self, scores: Sequence[FloatArray]) -> tuple[float, list[int]]:
        r"""Return what the profiles of the others explain of every recording's square, in all, and the moves.

        Parameters
        ----------
        scores
            :math:`B_r^T \varepsilon_r`, shape (K,).
        """
        eye = self.ridge * np.eye(len(scores[0]))
        own = [float(s @ np.linalg.solve(G + eye, s)) for s, G in zip(scores, self.squares, strict=True)]
        order = [int(r) for r in np.argsort(own)[::-1]]
        first: list[int | None] = [None] * len(scores)
        first[order[0]] = self.moves
        for r in order[1:]:
            first[r] = self.best_move(self.profile(scores, first), scores[r], r)[0]
        moved = [m if m is not None else self.moves for m in first]
        for _ in range(_TURNS):
            before = list(moved)
            for r in order:
                moved[r] = self.best_move(self.profile(scores, moved, r), scores[r], r)[0]
            if moved == before:
                break
        gained = [self.best_move(self.profile(scores, moved, r), s, r)[1] for r, s in enumerate(scores)]
        return sum(gained), moved


def along_track(bench: Workbench, model: Fit, null: FloatArray | Columns) -> list[Shape]:
    """Return the force along the track of every cart as a free function of the place, with its false-alarm probability.

    What is not plain has probability 1.

    Parameters
    ----------
    null
        Raw residuals of null draws, shape (N, draws).
    """
    present = orthonormal(model.jacobian)
    e = model.residual - present @ (present.T @ model.residual)
    square = float(e @ e)
    carts = range(len(bench.runs[0].keep))
    rows = [bench.rows.of(r) for r in range(len(bench.runs))]
    knots, columns, laid, found = [], [], [], []
    for c in carts:
        knots.append(_knots(bench, c))
        B = bench.comparable(
            bench.pushed(model.values, [partial(_hat, bench, c, knots[c], k) for k in range(KNOTS)], _SIZE_V)
        )
        moves = 0 if bench.parts else MOVES
        columns.append(B)
        laid.append(_Laid([B[i].T @ B[i] for i in rows], [B[i].T @ present[i] for i in rows], moves))
        found.append(laid[c].lay([B[i].T @ e[i] for i in rows]))
    gains = [gained / square for gained, _ in found]
    odds = [1.0] * len(gains)
    if max(gains) >= PLAIN:
        luck = _chance(bench, columns, laid, null, present)
        # asked beside all shapes of other variables: of two such questions one is answered by chance twice as often
        odds = [min(1.0, 2.0 * luck.probability(_name(c), [g])) if g >= PLAIN else 1.0 for c, g in enumerate(gains)]
    return [_shape(bench, c, knots[c], columns[c], laid[c], e, present, gains[c], found[c][1], odds[c]) for c in carts]


def _name(c: int) -> tuple[str, str]:
    return f"shape of {ALONG_TRACK}", f"cart_{c + 1}"


def _knots(bench: Workbench, c: int) -> FloatArray:
    return np.linspace(
        min(float(run.track[c].min()) for run in bench.runs),
        max(float(run.track[c].max()) for run in bench.runs),
        KNOTS,
    )


def _hat(bench: Workbench, c: int, knots: FloatArray, k: int) -> list[FloatArray]:
    unit, pushes = np.zeros(KNOTS), []
    unit[k] = 1.0
    for run in bench.runs:
        push = np.zeros((2, len(run.u)))
        push[c] = np.interp(run.track[c], knots, unit)
        pushes.append(push)
    return pushes


def _chance(
    bench: Workbench,
    columns: Sequence[FloatArray],
    laid: Sequence[_Laid],
    null: FloatArray | Columns,
    present: FloatArray,
) -> Chance:
    """Lay the recordings of every null draw over one another in the same way."""
    draws = bench.comparable(null.astype(np.float64))
    draws -= present @ (present.T @ draws)
    squares = np.sum(draws**2, axis=0)
    rows = [bench.rows.of(r) for r in range(len(bench.runs))]
    scores = [[B[i].T @ draws[i] for i in rows] for B in columns]

    def one(d: int) -> list[float]:
        return [lay.lay([s[:, d] for s in own])[0] for lay, own in zip(laid, scores, strict=True)]

    gains = np.array(list(bench.pool.map(one, range(draws.shape[1])))) / squares[:, None]
    gains = np.maximum(gains, 0.0)[:, :, None]
    luckiest = np.sort(gains, axis=0)[-max(len(gains) // 10, 1) :].mean(axis=0)
    return Chance(tuple(_name(c) for c in range(len(laid))), gains, np.maximum(luckiest, _USUAL))


def _shape(
    bench: Workbench,
    c: int,
    knots: FloatArray,
    B: FloatArray,
    laid: _Laid,
    e: FloatArray,
    present: FloatArray,
    predicted: float,
    moved: list[int],
    probability: float,
) -> Shape:
    rows = [bench.rows.of(r) for r in range(len(bench.runs))]
    profile = laid.profile([B[i].T @ e[i] for i in rows], moved)
    change = np.concatenate([B[i] @ profile[m : m + KNOTS] for i, m in zip(rows, moved, strict=True)])
    change -= present @ (present.T @ change)
    size = float(np.linalg.norm(change))
    unit = change[:, None] / max(size, 1e-300)
    band = laid.band([B[i].T @ (e + change)[i] for i in rows], moved)
    name, where = _name(c)
    gain = 1.0 - float(np.sum((e + change) ** 2) / np.sum(e**2))
    # along the track of the recording that says most; the others are laid over it
    step = knots[1] - knots[0]
    whole = knots[0] + step * (np.arange(len(profile)) - laid.moves)
    return Shape(
        where,
        ALONG_TRACK,
        whole,
        profile,
        band,
        gain,
        predicted,
        Screened(
            Candidate(name, where, (), ()), gain, (size,), 0.0, unit.astype(np.float32), unit[:, :0].astype(np.float32)
        ),
        probability,
    )
