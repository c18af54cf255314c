r"""The floor: how well could any single model do?

A deterministic model driven by a periodic command answers periodically once its transient is over, and answers every
replicate alike. What differs between the periods of a run, or between replicates, no single model can explain. With
:math:`N` repetitions of the same phase the unbiased estimate of that variance is

.. math:: s^2 = \tfrac{1}{N-1} \overline{\textstyle\sum_i (v_i - \bar v)^2}.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexdrive_gym.recording import BoolArray, Channel, FloatArray, Recording

_CHANNELS: tuple[Channel, ...] = ("v1", "v2")


@dataclass(frozen=True)
class Floor:
    """Repeatability of one cart's velocity in one recording.

    Attributes
    ----------
    rms
        Of what does not repeat [mm/s], encoder counts included; nan where nothing repeats.
    repetitions
        Periods (of this run and its replicates) compared.
    source
        ``replicates``, ``periods`` or ``none``.
    """

    recording: str
    cart: int
    rms: float
    repetitions: int
    source: str


def by_phase(values: FloatArray, period: float) -> FloatArray:
    """Fold a signal onto its period, leaving out the first period (the transient).

    Parameters
    ----------
    values : ndarray, shape (n,)
        Signal; nan where it is not valid.
    period
        Period in samples, not necessarily whole.

    Returns
    -------
    ndarray, shape (whole periods after the first, round(period))
        Row i is period i + 1; (0, m) where the run is too short.
    """
    m = max(1, round(period))
    n = int(len(values) / period + 1e-6) - 1
    if n < 1:
        return np.zeros((0, m))
    # nearest sample instead of interpolation: encoder noise keeps its variance
    index = np.rint((1 + np.arange(n))[:, None] * period + np.arange(m)[None, :] * (period / m)).astype(int)
    return np.asarray(values[np.minimum(index, len(values) - 1)])


def spread(rows: FloatArray) -> tuple[float, int]:
    """Return the unbiased variance across rows, pooled over columns, and the number of rows."""
    count = np.sum(np.isfinite(rows), axis=0)
    use = count >= 2
    if len(rows) < 2 or not use.any():
        return float("nan"), len(rows)
    part = rows[:, use]
    squares = np.nansum((part - np.nanmean(part, axis=0)) ** 2, axis=0)
    return float(np.sum(squares) / np.sum(count[use] - 1)), len(rows)


def smoothed(values: FloatArray, keep: BoolArray, width: int) -> FloatArray:
    """Return the moving mean over ``width`` samples times its root, nan where a sample is not valid.

    White noise keeps its variance, so that the result compares with block residuals.
    """
    masked = np.where(keep, values, np.nan)
    if width <= 1:
        return masked
    padded = np.concatenate([np.full(width // 2, np.nan), masked, np.full(width - 1 - width // 2, np.nan)])
    return np.asarray(np.lib.stride_tricks.sliding_window_view(padded, width).mean(axis=1) * np.sqrt(width))


def run_variance(values: FloatArray, keep: BoolArray, period: float, width: int = 1) -> float:
    """Return the variance of what does not repeat between the periods of one run; nan if nothing repeats."""
    if not period > 1.0:
        return float("nan")
    return spread(by_phase(smoothed(values, keep, width), period))[0]


def measure_floor(recordings: Sequence[Recording]) -> tuple[Floor, ...]:
    """Measure the floor of every velocity channel.

    Periods after the first of a run and of all its replicates (same kind, amplitude, frequency and feedback) are
    compared phase by phase.

    Parameters
    ----------
    recordings
        Of one drive.
    """
    result = []
    for r in recordings:
        twins = [q for q in recordings if replicates(q, r)]
        for cart, name in enumerate(_CHANNELS, start=1):
            rows = [
                by_phase(np.where(q.valid(name), values, np.nan), period_samples(q))
                for q in twins
                for values in [getattr(q, name)]
                if values is not None and period_samples(q) > 1.0
            ]
            if getattr(r, name) is None:
                continue
            width = min((row.shape[1] for row in rows), default=0)
            variance, n = spread(np.vstack([row[:, :width] for row in rows])) if rows else (float("nan"), 0)
            source = "none" if not np.isfinite(variance) else "replicates" if len(twins) > 1 else "periods"
            result.append(Floor(r.name, cart, float(np.sqrt(variance)), n, source))
    return tuple(result)


def period_samples(recording: Recording) -> float:
    """Return the period of the command in samples; 0 where it does not repeat."""
    excitation = recording.excitation
    if excitation.kind not in ("square", "sine") or excitation.frequency <= 0.0:
        return 0.0
    return 1.0 / (excitation.frequency * recording.sample_time)


def replicates(a: Recording, b: Recording) -> bool:
    """Whether two recordings are replicates: driven by the same command, sampled at the same rate."""
    x, y = a.excitation, b.excitation
    return (
        x.kind == y.kind
        and x.feedback == y.feedback
        and abs(x.amplitude - y.amplitude) <= 0.02 * max(abs(x.amplitude), 1e-9)
        and abs(x.frequency - y.frequency) <= 0.01 * max(x.frequency, 1e-9)
        and abs(a.sample_time - b.sample_time) <= 1e-6
        and (np.sign(a.u[np.argmax(np.abs(a.u) > 0)]) == np.sign(b.u[np.argmax(np.abs(b.u) > 0)]))
    )
