"""The generous model: what is left of a residual when whatever predicts other experiments is taken out of it, linearly."""

from __future__ import annotations

from flexdrive_gym.recording import FloatArray
from identification.mismatch.linear import Linear
from identification.mismatch.score import gains

# log-likelihood that a parameter must gain to join a model: Akaike's one, and one for having been chosen
WORTH = 2.0


def generous(linear: Linear) -> FloatArray:
    """Return the raw residual of a model that has, linearly, whatever predicts other experiments, shape (N,)."""
    damping = linear.bench.settings.damping
    residual = linear.residual[:, None]
    g, square = linear.gradient(residual)[..., 0], linear.square(residual)[:, 0]
    columns: list[int] = []
    before = linear.normal(g, square)
    rest = [e for e in linear.entries if not e.random]
    for _ in range(linear.bench.settings.generous):
        best = None
        for entry in rest:
            more = [*columns, *(c for c in entry.columns if c not in columns)]
            normal = linear.normal(g, square, more)
            gain = float(gains(before, normal, damping).sum()) - WORTH * (len(more) - len(columns))
            if best is None or gain > best[0]:
                best = gain, entry, normal, more
        if best is None or best[0] <= 0.0:
            break
        _, entry, before, columns = best
        rest.remove(entry)
    return linear.moved(columns, before.solve(damping))
