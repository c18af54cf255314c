"""Shares of successes with their intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt


@dataclass(frozen=True)
class Share:
    """A share of successes with its 95 % interval (Wilson, J. Am. Stat. Assoc. 22, 1927)."""

    hits: int
    trials: int
    value: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.hits} of {self.trials} = {self.value:.0%} ({self.low:.0%} … {self.high:.0%})"


def share(hits: Sequence[bool]) -> Share | None:
    """Return the share of what is true with its Wilson interval, or ``None`` of nothing."""
    n, k, z = len(hits), sum(map(bool, hits)), 1.959963984540054
    if n == 0:
        return None
    p = k / n
    centre, half = p + z**2 / (2 * n), z * sqrt(p * (1 - p) / n + z**2 / (4 * n**2))
    scale = 1.0 + z**2 / n
    # at the ends round-off shall not leave 0 or 1 outside
    return Share(k, n, p, max(0.0, (centre - half) / scale), min(1.0, max(p, (centre + half) / scale)))
