"""Ripples with a phase of their own in every recording: what predicts other experiments is no noise."""

from __future__ import annotations

import numpy as np

from flexdrive_gym.recording import FloatArray
from identification.mismatch.fitting.score import shared
from identification.mismatch.noise.nuisance import Direction
from identification.mismatch.selection.evaluate import Name, random_gains
from identification.mismatch.selection.linear import Linear


def ripples(linear: Linear, left: FloatArray) -> list[Direction]:
    """Return the ripples with a phase of their own in every run that predict other experiments, the best period of each name.

    What is noise is told beside them: without them the variability of forces along the track takes over what they are.

    Parameters
    ----------
    left : ndarray, shape (N,)
        Raw residual of a model that lacks nothing else.
    """
    entries = [e for e in linear.entries if e.random]
    if not entries:
        return []
    bench, first = linear.bench, len(linear.base)
    columns = linear.white[:, [c for e in entries for c in e.columns]]
    best: dict[Name, tuple[float, list[Direction]]] = {}
    found = random_gains(bench, columns, linear.noise.white(left)[:, None])
    for entry, (gain, variance) in zip(entries, found, strict=True):
        name, total = entry.candidate.name, float(shared(gain[:, 0]))
        if total > max(bench.settings.ripple, best[name][0] if name in best else 0.0):
            changes = [linear.changes[:, c - first].astype(np.float64) for c in entry.columns]
            best[name] = total, [Direction("@".join(name), float(np.sqrt(variance)), change) for change in changes]
    return [d for _, own in best.values() for d in own]
