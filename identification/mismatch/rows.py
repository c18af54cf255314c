"""Where the blocks of every recording and cart lie in the one long vector that residuals are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexdrive_gym.recording import BoolArray, FloatArray
from identification.replay.output_error import Run


@dataclass(frozen=True, eq=False)
class Rows:
    """Where the blocks of every recording and cart lie in one long vector.

    Attributes
    ----------
    starts
        First block of every recording, and the end.
    blocks
        Blocks per cart of every recording.
    valid
        Which blocks no fault touches, shape (N,).
    cart
        Cart of every block, 0 or 1, shape (N,).
    time
        Start of every block [s], shape (N,).
    """

    starts: tuple[int, ...]
    blocks: tuple[int, ...]
    valid: BoolArray
    cart: FloatArray
    time: FloatArray

    def of(self, run: int) -> slice:
        """Return the rows of one recording."""
        return slice(self.starts[run], self.starts[run + 1])


def rows_of(runs: Sequence[Run]) -> Rows:
    """Return where the blocks of prepared recordings lie, one recording after the other, all carts in a row."""
    starts, blocks, valid, cart, time = [0], [], [], [], []
    for run in runs:
        edges = np.arange(0, len(run.u), run.block)
        blocks.append(len(edges))
        for c, keep in enumerate(run.keep):
            share = np.add.reduceat(keep.astype(float), edges) / np.diff(np.append(edges, len(run.u)))
            valid.append(share > 0.5)
            cart.append(np.full(len(edges), c))
            time.append(edges * run.sample_time)
        starts.append(starts[-1] + len(run.keep) * len(edges))
    return Rows(tuple(starts), tuple(blocks), np.concatenate(valid), np.concatenate(cart), np.concatenate(time))
