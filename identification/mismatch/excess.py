"""Whether a model has more error than the restlessness of a rig makes, whatever form that error has.

The catalogue is asked what explains an error; an effect that is in no catalogue may fit nothing there and yet be large. So the
whole error is held against that of null draws of :mod:`chance <identification.mismatch.chance>`, which are the same rig, as
restless as two recorded ones, with nothing left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import rankdata

from flexdrive_gym.recording import FloatArray
from identification.mismatch.refit import Fit
from identification.mismatch.screening import orthonormal
from identification.mismatch.workbench import Columns, View, Workbench

_PART = 24


@dataclass(frozen=True)
class Excess:
    """How much more error there is than what surrounds a rig makes.

    Attributes
    ----------
    probability
        That a rig with nothing left out has as much error, in the view in which it has more.
    share
        Of the squared error, beyond the median of the draws.
    where
        Cart that has most of it.
    runs
        Numbers of the two recordings that have most of it, and their shares of it.
    """

    probability: float
    share: float
    where: str
    runs: tuple[tuple[int, float], ...]


def excess(bench: Workbench, null: FloatArray | Columns, model: Fit) -> Excess:
    """Compare a model's error with those of null draws, shape (N, draws), around it: its whole, nothing in particular."""
    squares = [_squares(bench, view, model, null) for view in bench.views]
    ranks = np.array([rankdata(s.sum(axis=(0, 1))) for s in squares])
    # in the view in which it is larger, and the draws each in theirs
    most = ranks.max(axis=0)
    here = squares[int(np.argmax(ranks[:, 0]))]
    own, draws = here[:, :, 0], here[:, :, 1:]
    beyond = np.maximum(own - np.median(draws, axis=2), 0.0)
    per_run = beyond.sum(axis=1) / max(float(beyond.sum()), 1e-300)
    return Excess(
        float(np.mean(most >= most[0])),
        float(max(0.0, 1.0 - np.median(draws.sum(axis=(0, 1))) / max(float(own.sum()), 1e-300))),
        f"cart_{1 + int(np.argmax(beyond.sum(axis=0)))}",
        tuple((int(r), float(per_run[r])) for r in np.argsort(-per_run)[:2]),
    )


def _squares(bench: Workbench, view: View, model: Fit, null: FloatArray | Columns) -> FloatArray:
    """Return the squared error of the model and of every draw, shape (runs, carts, 1 + draws), less what a refit takes out."""
    present = orthonormal(bench.seen(view, model.sensitivity))
    # a few draws at a time: all of them together are a good part of what a diagnosis may hold
    parts = [model.seen(view)[:, None]] + [null[:, i : i + _PART] for i in range(0, null.shape[1], _PART)]
    found = []
    for i, part in enumerate(parts):
        e = part if i == 0 else bench.seen(view, part)
        e = e - present @ (present.T @ e)
        carts = range(len(bench.runs[0].keep))
        found.append([[np.sum(e[bench.piece(r, c)] ** 2, axis=0) for c in carts] for r in range(len(bench.runs))])
    return np.concatenate(found, axis=2)
