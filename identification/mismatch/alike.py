r"""Whether one size of an effect suits all recordings.

Physics has one size; what merely resembles the missing physics needs another size in every recording. A belt that slips clips
the force like a saturation, but at a limit that depends on how the motor is driven; a stop beside the track is a spring to the
ground only for the runs that reach it. With :math:`S_r` the sensitivities of recording r to the sizes of an effect that is in
the model already, and :math:`\varepsilon` what that model leaves,

.. math:: q = \sum_r \frac{\|S_r S_r^+ \varepsilon_r\|^2}{\|\varepsilon\|^2}

is what sizes of their own would remove beyond the common one. Nuisance feeds it, too: the same share of null draws tells
how much.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexdrive_gym.recording import FloatArray
from identification.mismatch.refit import Fit
from identification.mismatch.screening import orthonormal
from identification.mismatch.workbench import Columns, View, Workbench


@dataclass(frozen=True)
class Disagreement:
    """How much recordings disagree about the size of an effect.

    Attributes
    ----------
    share
        Of the remaining squared error, what sizes of their own remove beyond what they remove by chance.
    probability
        That chance makes them disagree as much.
    where
        Cart that shows it most.
    """

    share: float
    probability: float
    where: str


def disagreement(
    bench: Workbench, model: Fit, null: FloatArray | Columns, sizes: Sequence[str], view: View
) -> Disagreement:
    """Return how much the recordings disagree about an effect's sizes.

    Parameters
    ----------
    model
        With the effect.
    null
        Raw residuals of null draws around it, shape (N, draws).
    sizes
        Parameters among the model's names.
    """
    present = orthonormal(bench.seen(view, model.sensitivity))
    S = bench.seen(view, model.sensitivity[:, [model.names.index(n) for n in sizes]])

    def removed(e: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return shares that own sizes remove, and where, shape (draws,) and (carts,)."""
        e = e - present @ (present.T @ e)
        total, carts = np.zeros(e.shape[1]), np.zeros(len(bench.runs[0].keep))
        for r in range(len(bench.runs)):
            rows = bench.rows.of(r)
            Q = orthonormal(S[rows])
            part = Q @ (Q.T @ e[rows])
            total += np.sum(part**2, axis=0)
            carts += [np.sum(half**2) for half in np.split(part, len(carts))]
        return total / np.maximum(np.sum(e**2, axis=0), 1e-300), carts

    (own,), carts = removed(model.seen(view)[:, None])
    chance, _ = removed(bench.seen(view, null))
    return Disagreement(
        float(own - np.median(chance)),
        float((1 + np.sum(chance >= own)) / (1 + len(chance))),
        f"cart_{1 + int(np.argmax(carts))}",
    )
