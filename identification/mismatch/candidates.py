"""What could have been left out: every catalogue entry at every place and at several shapes, as a direction to look in.

A *candidate* is one effect at one place with start values. Its sizes (linear amplitudes) begin at the null; its shapes (a
Stribeck velocity, a period) mean nothing at the null and are taken from a grid.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from math import isfinite

from flexdrive_gym.drive.effects import EFFECTS, LAYOUT, Effect, Parameter
from identification.topology import TWO_CARTS, Topology

# part of every topology, or of the measurement rather than of the rig
_NOT_LEFT_OUT = frozenset({"viscous_friction", "spring", "encoder_quantisation"})

# of a bound
_NEAR = 1e-3


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

    def vanishes(self, values: Mapping[str, float]) -> bool:
        """Whether a drive has a shape at its lower bound, where it is another effect: a hump without width, stiff bristles."""
        return any(values[key] < bounds(key)[0] * (1.0 + _NEAR) for key, _ in self.shapes)

    def directions(self, values: Mapping[str, float]) -> list[dict[str, float]]:
        """Return the drive with each size in turn at its start value, the others at their null."""
        return [{**values, **dict(self.shapes), key: start} for key, start in self.sizes]


def catalogue(
    topology: Topology = TWO_CARTS,
    known: Collection[str] = (),
    shapes: Mapping[str, Sequence[float]] | None = None,
) -> list[Candidate]:
    """Return every candidate for a drive.

    Parameters
    ----------
    topology
        Which places there are, and what every fit moves.
    known
        Parameters the model already has; their effects are no candidates.
    shapes
        Start grids found from the data, which replace those of the catalogue.
    """
    known, shapes = {*known, *topology.free, *topology.fixed}, dict(shapes or {})
    found = []
    for effect in EFFECTS:
        if effect.id in _NOT_LEFT_OUT:
            continue
        for where in effect.where:
            keys = [effect.key(where, q.name) for q in effect.parameters]
            if not topology.offers(where) or any(key in known for key in keys):
                continue
            # a filter that the recordings know of is no question; its cut-off has no usual value to start from either
            if effect.id == "velocity_processing" and not any(key in shapes for key in keys):
                continue
            found += _grid(effect, where, shapes)
    return found


def _grid(effect: Effect, where: str, shapes: Mapping[str, Sequence[float]]) -> list[Candidate]:
    # what is absent at infinity (a limit) is a size of its own: its start is either present or not
    size = [q for q in effect.parameters if q.role == "size" or switch(q, effect)]
    grids = []
    for q in effect.parameters:
        key = effect.key(where, q.name)
        if q in size and not switch(q, effect):
            continue
        grids.append([(key, float(v)) for v in shapes.get(key, q.starts)])
    switches = {effect.key(where, q.name) for q in size if switch(q, effect)}
    levels = max((len(_levels(q)) for q in size if not switch(q, effect)), default=1)
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


def switch(q: Parameter, effect: Effect) -> bool:
    """Whether a parameter is either present or not: absent at infinity, or the only one, without a size, as a filter's."""
    return not isfinite(q.null) or all(other.role == "shape" for other in effect.parameters)


def _levels(q: Parameter) -> tuple[float, ...]:
    """Sizes at which the direction is taken: non-linear effects look different when small."""
    return tuple(sorted({abs(v) for v in q.starts}))


def bounds(key: str) -> tuple[float, float]:
    """Return the bounds of a parameter."""
    q = LAYOUT[key].parameter
    return q.lower, q.upper


def look_alikes(effect: str) -> set[str]:
    """Return the ids of the effects that are known to look like one, or that it is known to look like."""
    return {e.id for e in EFFECTS if effect in e.looks_like} | {
        i for e in EFFECTS if e.id == effect for i in e.looks_like
    }
