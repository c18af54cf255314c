"""What could have been left out: every catalogue entry at every place and at several shapes, as a direction to look in.

A *candidate* is one effect at one place with start values. Its sizes (linear amplitudes) begin at the null; its shapes (a
Stribeck velocity, a period) mean nothing at the null and are taken from a grid.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from math import isfinite

from flexdrive_gym.drive.effects import EFFECTS, LAYOUT, Effect, Parameter

# part of every baseline, or of the measurement rather than of the rig
_NOT_LEFT_OUT = frozenset(
    {"viscous_friction", "coulomb_friction", "spring", "encoder_quantisation", "velocity_processing"}
)


@dataclass(frozen=True)
class Candidate:
    """One effect at one place, with start values.

    Attributes
    ----------
    id, where
        Of the catalogue.
    sizes
        Keys of the linear amplitudes and a plainly present value of each.
    shapes
        Keys of the non-linear parameters and one value of each.
    """

    id: str
    where: str
    sizes: tuple[tuple[str, float], ...]
    shapes: tuple[tuple[str, float], ...]

    @property
    def name(self) -> tuple[str, str]:
        """Effect and place: what a finding is called by."""
        return self.id, self.where

    @property
    def period(self) -> str | None:
        """Key of the spatial period, for an effect whose phase differs from run to run."""
        return next((k for k, _ in self.shapes if k.endswith(".P")), None)

    @property
    def keys(self) -> tuple[str, ...]:
        """All parameters of the effect at this place."""
        return tuple(k for k, _ in (*self.sizes, *self.shapes))

    def directions(self, values: Mapping[str, float]) -> list[dict[str, float]]:
        """Return the drive with each size in turn at its start value, the others at their null."""
        return [{**values, **dict(self.shapes), key: start} for key, start in self.sizes]


def catalogue(
    carts: int,
    known: Mapping[str, float] | None = None,
    shapes: Mapping[str, Sequence[float]] | None = None,
) -> list[Candidate]:
    """Return every candidate for a drive.

    Parameters
    ----------
    carts
        1 or 2; with one cart nothing acts on cart 2, the spring or encoder 2.
    known
        Parameters the model already has; their effects are no candidates.
    shapes
        Start grids found from the data, which replace those of the catalogue.
    """
    known, shapes = dict(known or {}), dict(shapes or {})
    found = []
    for effect in EFFECTS:
        if effect.id in _NOT_LEFT_OUT:
            continue
        for where in effect.where:
            if carts == 1 and where in {"cart_2", "spring", "encoder_2"}:
                continue
            if any(effect.key(where, q.name) in known for q in effect.parameters):
                continue
            found += _grid(effect, where, shapes)
    return found


def _grid(effect: Effect, where: str, shapes: Mapping[str, Sequence[float]]) -> list[Candidate]:
    # what is absent at infinity (a limit) is a size of its own: its start is either present or not
    size = [q for q in effect.parameters if q.role == "size" or not isfinite(q.null)]
    grids = []
    for q in effect.parameters:
        key = effect.key(where, q.name)
        if q in size and isfinite(q.null):
            continue
        grids.append([(key, float(v)) for v in shapes.get(key, q.starts)])
    switches = {effect.key(where, q.name) for q in size if not isfinite(q.null)}
    levels = max((len(_levels(q)) for q in size if isfinite(q.null)), default=1)
    candidates = []
    for chosen in product(*grids):
        if switches:
            own = tuple(pair for pair in chosen if pair[0] in switches)
            candidates.append(Candidate(effect.id, where, own, tuple(p for p in chosen if p[0] not in switches)))
            continue
        for level in range(levels):
            starts = tuple((effect.key(where, q.name), _levels(q)[min(level, len(_levels(q)) - 1)]) for q in size)
            candidates.append(Candidate(effect.id, where, starts, tuple(chosen)))
    return candidates


def _levels(q: Parameter) -> tuple[float, ...]:
    """Sizes at which the direction is taken: non-linear effects look different when small."""
    return tuple(sorted({abs(v) for v in q.starts}))


def bounds(key: str) -> tuple[float, float]:
    """Return the bounds of a parameter."""
    q = LAYOUT[key].parameter
    return q.lower, q.upper
