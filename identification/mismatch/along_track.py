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
from identification.mismatch.shapes import ALONG_TRACK, Shape, hats
from identification.mismatch.workbench import Columns, Workbench

# every track has hills: what explains less than this share of the squared error is no more than that
PLAIN = 0.15
# knots along the widest way of a recording, and how far recordings are moved over one another at most
KNOTS, MOVES = 48, 24
_SIZE_V = 0.05
# of the mean square of the sensitivities
_RIDGE = 0.01
_TURNS = 5


@dataclass(frozen=True, eq=False)
class _Track:
    """The way of a cart in recordings that can be laid over one another.

    Attributes
    ----------
    cart
        0 or 1.
    knots : ndarray, shape (K,)
        Places from where each recording began [mm].
    columns, rows
        Comparable sensitivities to a force that is 1 at one knot, shape (N, K), and the rows of every recording.
    squares, fitted : list of ndarray, shapes (K, K) and (K, m)
        :math:`B_r^T B_r`, and :math:`B_r^T Q` with orthonormal directions Q that a refit of the drive takes out.
    moves
        How many knots they may be moved at most.
    """

    cart: int
    knots: FloatArray
    columns: FloatArray
    rows: list[slice]
    squares: list[FloatArray]
    fitted: list[FloatArray]
    moves: int

    @classmethod
    def of(cls, bench: Workbench, model: Fit, present: FloatArray, cart: int) -> _Track:
        """Return the way of a cart, with its sensitivities around a model."""
        way = [run.track[cart] for run in bench.runs]
        knots = np.linspace(min(float(x.min()) for x in way), max(float(x.max()) for x in way), KNOTS)
        ones = [np.ones_like(x) for x in way]
        pushes = [partial(hats, cart, k, knots, way, ones) for k in range(KNOTS)]
        B = bench.comparable(bench.pushed(model.values, pushes, _SIZE_V))
        rows = [bench.rows.of(r) for r in range(len(bench.runs))]
        squares, fitted = [B[i].T @ B[i] for i in rows], [B[i].T @ present[i] for i in rows]
        return cls(cart, knots, B, rows, squares, fitted, 0 if bench.parts else MOVES)

    @property
    def name(self) -> tuple[str, str]:
        return f"shape of {ALONG_TRACK}", f"cart_{self.cart + 1}"

    @property
    def ridge(self) -> float:
        return _RIDGE * float(np.trace(sum(self.squares))) / KNOTS

    def scores(self, e: FloatArray) -> list[FloatArray]:
        r"""Return :math:`B_r^T \varepsilon_r` of residuals, shape (N,) or (N, draws)."""
        return [self.columns[i].T @ e[i] for i in self.rows]

    def shape(self, e: FloatArray, present: FloatArray, moved: Sequence[int], predicted: float, odds: float) -> Shape:
        """Return the profile of all recordings with its band and what it explains."""
        profile = self.profile(self.scores(e), moved)
        change = np.concatenate(
            [self.columns[i] @ profile[m : m + KNOTS] for i, m in zip(self.rows, moved, strict=True)]
        )
        change -= present @ (present.T @ change)
        size = float(np.linalg.norm(change))
        unit = (change[:, None] / max(size, 1e-300)).astype(np.float32)
        gain = 1.0 - float(np.sum((e + change) ** 2) / np.sum(e**2))
        # along the track of the recording that says most; the others are laid over it
        whole = self.knots[0] + (self.knots[1] - self.knots[0]) * (np.arange(len(profile)) - self.moves)
        screened = Screened(Candidate(*self.name, (), ()), gain, (size,), 0.0, unit, unit[:, :0])
        band = self.band(self.scores(e + change), moved)
        return Shape(self.name[1], ALONG_TRACK, whole, profile, band, gain, predicted, screened, odds)

    def profile(self, scores: Sequence[FloatArray], moved: Sequence[int | None], but: int | None = None) -> FloatArray:
        """Return the profile of all recordings that have a move, or all but one, shape (K + 2 moves,)."""
        laid = [None if r == but else move for r, move in enumerate(moved)]
        right = np.zeros(KNOTS + 2 * self.moves)
        for score, move in zip(scores, laid, strict=True):
            if move is not None:
                right[move : move + KNOTS] -= score
        return np.asarray(np.linalg.solve(self._normal(laid), right), dtype=np.float64)

    def band(self, left: Sequence[FloatArray], moved: Sequence[int]) -> FloatArray:
        """Return the standard error of the profile over the recordings, from the scores of what it leaves."""
        each = np.zeros((len(left), KNOTS + 2 * self.moves))
        for row, score, move in zip(each, left, moved, strict=True):
            row[move : move + KNOTS] = score
        return np.asarray(np.sqrt(np.sum(np.linalg.solve(self._normal(moved), each.T) ** 2, axis=1)))

    def _normal(self, moved: Sequence[int | None]) -> FloatArray:
        normal = self.ridge * np.eye(KNOTS + 2 * self.moves)
        hidden = np.zeros((len(normal), self.fitted[0].shape[1]))
        for r, move in enumerate(moved):
            if move is not None:
                here = slice(move, move + KNOTS)
                normal[here, here] += self.squares[r]
                hidden[here] += self.fitted[r]
        return np.asarray(normal - hidden @ hidden.T)

    def best_move(self, profile: FloatArray, score: FloatArray, r: int) -> tuple[int, float]:
        """Return where a profile explains most of a recording, and how much of its square."""
        pieces = np.lib.stride_tricks.sliding_window_view(profile, KNOTS)
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
        eye = self.ridge * np.eye(KNOTS)
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


def place_shapes(bench: Workbench, model: Fit, null: FloatArray | Columns) -> list[Shape]:
    """Return the forces along the track that are plain, as free functions of the place, with their false-alarm probabilities.

    Parameters
    ----------
    null
        Raw residuals of null draws, shape (N, draws).
    """
    present = orthonormal(model.jacobian)
    e = model.residual - present @ (present.T @ model.residual)
    tracks = [_Track.of(bench, model, present, c) for c in range(len(bench.runs[0].keep))]
    found = [track.lay(track.scores(e)) for track in tracks]
    gains = [gained / float(e @ e) for gained, _ in found]
    if max(gains) < PLAIN:
        return []
    luck = _chance(bench, tracks, null, present)
    return [
        # asked beside all shapes of other variables: of two such questions one is answered by chance twice as often
        track.shape(e, present, moved, gain, min(1.0, 2.0 * luck.probability(track.name, [gain])))
        for track, gain, (_, moved) in zip(tracks, gains, found, strict=True)
        if gain >= PLAIN
    ]


def _chance(bench: Workbench, tracks: Sequence[_Track], null: FloatArray | Columns, present: FloatArray) -> Chance:
    """Lay the recordings of every null draw over one another in the same way."""
    draws = bench.comparable(null.astype(np.float64))
    draws -= present @ (present.T @ draws)
    scores = [track.scores(draws) for track in tracks]

    def one(d: int) -> list[float]:
        return [track.lay([s[:, d] for s in own])[0] for track, own in zip(tracks, scores, strict=True)]

    gains = np.array(list(bench.pool.map(one, range(draws.shape[1])))) / np.sum(draws**2, axis=0)[:, None]
    return Chance.of([track.name for track in tracks], np.maximum(gains, 0.0)[:, :, None])
