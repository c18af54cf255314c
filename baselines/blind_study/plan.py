"""Which trials are run: every effect at every size as evenly as their number allows, in a random order."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from baselines.rig_simulator.catalogue import CATALOGUE, OUTSIDE, Maker
from baselines.rig_simulator.truth import KINDS, MIXTURE, SIZES, Kind

_OUTSIDE_SIZES = (1.0, 2.0)


@dataclass(frozen=True)
class Trial:
    """One trial before its truth is drawn.

    Attributes
    ----------
    number
        From 0, in the order of running; any first part of the order is a fair sample.
    seed
        Of the concealed rig, its data set, and the diagnosis.
    kind
        What is concealed, as in :mod:`baselines.rig_simulator.truth`.
    effect
        Id and place that must be concealed, or ``None`` to leave it to the draw.
    size
        In multiples of "plainly present", or ``None`` to leave it to the draw.
    """

    number: int
    seed: int
    kind: Kind
    effect: tuple[str, str] | None = None
    size: float | None = None


def plan(trials: int, seed: int = 0) -> tuple[Trial, ...]:
    """Return the trials of a study, in the documented mixture of kinds.

    Raises
    ------
    ValueError
        For fewer than one trial.
    """
    if trials < 1:
        raise ValueError(f"trials: must be at least 1; got {trials}. A full study has 200 or more.")
    rng = np.random.default_rng([seed, 11])
    contents: list[tuple[Kind, tuple[str, str] | None, float | None]] = []
    for kind, count in _counts(trials).items():
        if kind == "effect":
            contents += [("effect", effect, size) for effect, size in _spread(CATALOGUE, SIZES, count, rng)]
        elif kind == "outside":
            contents += [("outside", effect, size) for effect, size in _spread(OUTSIDE, _OUTSIDE_SIZES, count, rng)]
        else:
            contents += [(kind, None, None)] * count
    order = rng.permutation(trials)
    seeds = rng.integers(0, 2**31, trials)
    return tuple(Trial(number, int(seeds[number]), *contents[int(which)]) for number, which in enumerate(order))


def _counts(trials: int) -> dict[Kind, int]:
    """Return how many of each kind, by largest remainders."""
    exact = {kind: trials * MIXTURE[kind] for kind in KINDS}
    counts = {kind: int(exact[kind]) for kind in KINDS}
    for kind in sorted(KINDS, key=lambda k: counts[k] - exact[k])[: trials - sum(counts.values())]:
        counts[kind] += 1
    return counts


def _spread(
    makers: tuple[Maker, ...], sizes: tuple[float, ...], count: int, rng: np.random.Generator
) -> list[tuple[tuple[str, str], float]]:
    """Return effects and sizes: ids in turn, the places of each in turn, and every size before one is repeated."""
    ids = [str(i) for i in rng.permutation(sorted({m.id for m in makers}))]
    first = {i: int(rng.integers(len(sizes))) for i in ids}
    chosen = []
    for n in range(count):
        id_, turn = ids[n % len(ids)], n // len(ids)
        places = [m.where for m in makers if m.id == id_]
        # the place changes once in a round of sizes as well, so that no place is tied to a size
        where = places[(turn + turn // len(sizes)) % len(places)]
        chosen.append(((id_, where), sizes[(first[id_] + turn) % len(sizes)]))
    return chosen
