"""How quickly and how evenly a run went."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

_QUANTILES = {"median": 0.5, "p99": 0.99, "max": 1.0}


@dataclass
class Timing:
    """Times of one run or several [s], a number per sample.

    Attributes
    ----------
    response
        From having a sample to having sent its command, by this computer's clock.
    latency
        From taking a sample to having its command, by the rig's clock; empty where the rig does not say.
    jitter
        How far the time between two samples' arrivals is from that between their instants, without sign; empty where the rig's
        clock is not that on the wall.
    """

    response: list[float] = field(default_factory=list)
    latency: list[float] = field(default_factory=list)
    jitter: list[float] = field(default_factory=list)

    def summary(self) -> dict[str, dict[str, float] | None]:
        """Return median, 99 % quantile and largest of each [ms]; ``None`` where there is none."""
        return {name: _summary(values) for name, values in vars(self).items()}


def together(timings: Iterable[Timing]) -> Timing:
    """Return the times of several runs as one's."""
    whole = Timing()
    for timing in timings:
        whole.response += timing.response
        whole.latency += timing.latency
        whole.jitter += timing.jitter
    return whole


def _summary(values: Sequence[float]) -> dict[str, float] | None:
    if not values:
        return None
    return {name: 1e3 * float(np.quantile(values, q)) for name, q in _QUANTILES.items()}
