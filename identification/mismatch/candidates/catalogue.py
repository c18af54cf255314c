"""Candidates of the catalogue: every effect at every place, its sizes alone and together, on a grid of its shapes."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from itertools import product
from math import isfinite

from flexdrive_gym.drive.effects import EFFECTS, LAYOUT, Effect, Parameter
from flexdrive_gym.drive.parameters import parameter
from identification.mismatch.fitting.scale import HANDOUT, Scale
from identification.topology import Topology

# part of every topology, or of the measurement rather than of the rig
_NO_CANDIDATES = frozenset({"viscous_friction", "spring", "encoder_quantisation"})
# of the measurement, too, where positions tell how velocities were made
_FILTER = "velocity_processing"
# cut-offs that are tried [Hz]
_CUTOFFS = (5.0, 15.0, 50.0)
# shares of the largest command at which a limit is tried
_LIMITS = (0.95, 0.85, 0.7, 0.5)
# base friction that a candidate can take over, since a cart held by it would never show the candidate
_TAKES_OVER = {"presliding": {"fd": "d"}, "breakaway": {"extra": "d"}, "stribeck": {"extra": "d"}}
# masses of their own that a base model has counted to a cart's, and what a cart keeps of its own at least
_PARTS = {"motor_gear_backlash": {"mass": "m1"}, "extra_mode": {"mass_1": "m1", "mass_2": "m2"}}
_LEAST_PART = 0.3


@dataclass(frozen=True)
class Candidate:
    """One effect at one place, with what a fit moves and where it starts.

    Attributes
    ----------
    id, where
        Of the catalogue.
    sizes
        Keys of the amplitudes and a plainly present value of each.
    shapes
        Keys of the non-linear parameters and one value of each.
    takes
        Sizes that may take over a base parameter: key to the base parameter.
    parts
        Sizes that a base parameter stood for besides its own: key to the base parameter.
    finer
        Keys of details of its law, which a fit moves, too, once this candidate leads, and where they start: a limit is round.
    """

    id: str
    where: str
    sizes: tuple[tuple[str, float], ...]
    shapes: tuple[tuple[str, float], ...] = ()
    takes: tuple[tuple[str, str], ...] = ()
    parts: tuple[tuple[str, str], ...] = ()
    finer: tuple[tuple[str, float], ...] = ()

    @property
    def name(self) -> tuple[str, str]:
        """Effect and place: what a finding is called by."""
        return self.id, self.where

    @property
    def keys(self) -> tuple[str, ...]:
        """Parameters that a fit of this candidate moves."""
        return tuple(k for k, _ in (*self.sizes, *self.shapes))

    @property
    def start(self) -> dict[str, float]:
        """Sizes and shapes at their start values."""
        return dict((*self.sizes, *self.shapes))

    def beside(self, values: Mapping[str, float], own: Mapping[str, float]) -> dict[str, float]:
        """Return a drive with the candidate, from whose base parameters is taken what they stood for."""
        taken = [(base, values[base], own[key]) for key, base in self.parts if base in values]
        return {**values, **{base: max(whole - part, _LEAST_PART * whole) for base, whole, part in taken}, **own}

    @property
    def absolute(self) -> bool:
        """Whether its size is a limit or a cut-off, to which it acts in no proportion."""
        return any(LAYOUT[key].parameter.role != "size" for key, _ in self.sizes)

    @property
    def proportional(self) -> bool:
        """Whether it acts in proportion to its sizes."""
        return not self.absolute and not self.behind_gap

    @property
    def behind_gap(self) -> bool:
        """Whether it is a mass that moves on its own before it meets its cart."""
        return bool(self.parts) and any(key.endswith(".gap") for key, _ in self.shapes)

    def one(self, i: int) -> dict[str, float]:
        """Return the parameters with size i at its start value and the others at null."""
        return {**dict(self.shapes), self.sizes[i][0]: self.sizes[i][1]}


def null_value(key: str) -> float:
    """Return the value at which a parameter's effect is absent."""
    return LAYOUT[key].parameter.null


def catalogue(
    topology: Topology,
    known: Collection[str] = (),
    reach: float | None = None,
    scale: Scale = HANDOUT,
    *,
    filtered: bool = False,
) -> list[Candidate]:
    """Return every candidate for a drive.

    Parameters
    ----------
    topology
        Which places there are, and what every fit moves.
    known
        Parameters the model already has; their effects are no candidates.
    reach
        Largest command [V]: a limit shows below it only. ``None``: the usual limits.
    scale
        Of what is usual; default: that of the handout's rig.
    filtered
        Whether velocities may have passed a filter of which nothing is known.
    """
    taken = {*known, *topology.free, *topology.fixed}
    found = []
    for effect in EFFECTS:
        if effect.id in _NO_CANDIDATES or (effect.id == _FILTER and not filtered):
            continue
        for where in effect.where:
            keys = [effect.key(where, q.name) for q in effect.parameters]
            if topology.offers(where) and not any(key in taken for key in keys):
                found += _of(effect, where, topology, reach, scale)
    return found


def _of(effect: Effect, where: str, topology: Topology, reach: float | None, scale: Scale) -> list[Candidate]:
    sizes = [q for q in effect.parameters if q.role == "size" and not q.finer]
    finer = tuple((effect.key(where, q.name), _usual(q, scale)[0]) for q in effect.parameters if q.finer)
    shapes = [q for q in effect.parameters if q.role == "shape"]
    if topology.carts == 1:
        sizes = [q for q in sizes if not q.name.endswith("_2")]
    # what acts in proportion to nothing, a limit or a cut-off, is its own size, and its starts are a grid
    limits = None if reach is None else tuple(share * reach for share in _LIMITS)
    absolute = [(q, limits or q.starts) for q in shapes if not isfinite(q.null)]
    if effect.id == _FILTER:
        absolute = [(q, _CUTOFFS) for q in shapes]
    if absolute:
        return [
            Candidate(effect.id, where, ((effect.key(where, q.name), v),), finer=finer)
            for q, grid in absolute
            for v in grid
        ]
    takes = tuple(
        (effect.key(where, own), f"{base}{where[-1]}") for own, base in _TAKES_OVER.get(effect.id, {}).items()
    )
    masses = {effect.key(where, name): base for name, base in _PARTS.get(effect.id, {}).items()}
    found = []
    grids = [[(effect.key(where, q.name), v) for v in _usual(q, scale)] for q in shapes]
    for start in product(*grids):
        # at zero a shape that cannot be negative is none: a fit sees its logarithm
        chosen = tuple((key, v) for key, v in start if v != 0.0 or parameter(key).lower < 0.0)
        for group in _groups(sizes):
            levels = max(len(_levels(q, scale)) for q in group)
            for level in range(levels):
                usual = [(effect.key(where, q.name), _levels(q, scale)) for q in group]
                own = tuple((key, sizes[min(level, len(sizes) - 1)]) for key, sizes in usual)
                parts = tuple((key, masses[key]) for key, _ in own if key in masses)
                found.append(Candidate(effect.id, where, own, chosen, takes, parts, finer))
    return found


def _groups(sizes: list[Parameter]) -> list[list[Parameter]]:
    """Return sizes one by one and all together; sine and cosine of a ripple are one thing."""
    waves = [q for q in sizes if q.name in {"a_sin", "a_cos"}]
    single = [[q] for q in sizes if q not in waves] + ([waves] if waves else [])
    return single if len(single) < 2 or waves else [*single, sizes]


def _levels(q: Parameter, scale: Scale) -> tuple[float, ...]:
    """Sizes at which a sensitivity is taken: non-linear effects look different when small."""
    return tuple(sorted({abs(v) for v in _usual(q, scale)}))


def _usual(q: Parameter, scale: Scale) -> tuple[float, ...]:
    """Return usual values on a rig, within bounds, each once."""
    factor = scale.of_unit(q.unit)
    return tuple(dict.fromkeys(min(max(factor * v, q.lower), q.upper) for v in q.starts))


def further(candidate: Candidate, named: object) -> bool:
    """Whether there is more to say by a candidate: of another name than one that is given, or other sizes of its plain law."""
    if not isinstance(named, Candidate):
        return named is None
    return not (candidate.shapes or named.shapes or set(candidate.keys) & set(named.keys))


def look_alikes(effect: str) -> set[str]:
    """Return the ids of the effects known to look like one, or that it is known to look like."""
    return {e.id for e in EFFECTS if effect in e.looks_like} | {
        i for e in EFFECTS if e.id == effect for i in e.looks_like
    }
