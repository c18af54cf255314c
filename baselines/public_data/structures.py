"""Structures that the data leave open: the findings, without one of them, with a look-alike instead, with one effect more."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from math import isfinite

from baselines.public_data.benchmark import Benchmark, piece
from baselines.public_data.fitting import Piece, fit, piece_of
from flexdrive_gym.drive.effects import EFFECTS, LAYOUT, Where
from flexdrive_gym.drive.parameters import parameter
from flexdrive_gym.recording import Recording

Named = tuple[str, Where]
# belong to every topology, or to the counts of the encoder
_BASE = frozenset({"viscous_friction", "spring", "encoder_quantisation"})
# so many structures besides the findings are averaged, at most, and with one effect more a fit must gain such a share
_MOST, _GAIN = 8, 0.005
# a glance at an effect takes so many steps, and sees so many samples of a recording
_GLANCE, _SAMPLES = 8, 25_000


@dataclass(frozen=True, eq=False)
class Structure:
    """A drive with its free parameters.

    Attributes
    ----------
    name
        In words.
    effects
        Beyond the topology.
    values
        To start from, or as fitted.
    cost
        Mean squared residual of the fit.
    """

    name: str
    effects: tuple[Named, ...]
    values: Mapping[str, float]
    cost: float = float("inf")

    def keys(self, benchmark: Benchmark) -> tuple[str, ...]:
        """Return the free parameters: the topology's, and the effects' that are not at home at a bound, like a lost sign."""
        free = list(benchmark.topology.free)
        for effect in self.effects:
            free += [key for key in keys_of(effect) if key not in free and not _at_bound(key)]
        return tuple(key for key in free if key not in benchmark.topology.fixed)

    def fitted(self, pieces: Sequence[Piece], benchmark: Benchmark, *, evaluations: int = 40) -> Structure:
        """Return the structure fitted to pieces."""
        values, cost = fit(self.values, self.keys(benchmark), pieces, benchmark, evaluations=evaluations)
        return replace(self, values=values, cost=cost)


def keys_of(effect: Named) -> tuple[str, ...]:
    """Return the parameters of an effect at a place."""
    return tuple(key for key, slot in LAYOUT.items() if (slot.effect.id, slot.where) == effect)


def open_structures(
    main: Structure,
    ties: Mapping[Named, Sequence[Named]],
    recordings: Sequence[Recording],
    benchmark: Benchmark,
    pool: Executor,
    say: Callable[[str], None],
) -> list[Structure]:
    """Return the fitted structures that the data leave open, the findings' own first.

    Parameters
    ----------
    main
        All findings, fitted.
    ties
        Finding to its look-alikes.
    recordings
        To fit to; a glance sees the first part of long ones.
    pool
        Fits structures on its threads; the kernels release the interpreter.
    """
    tried: list[Structure] = []
    for effect in main.effects:
        rest = tuple(e for e in main.effects if e != effect)
        tried.append(Structure(f"without {label(effect)}", rest, _without(main.values, effect)))
        tried += [
            Structure(f"{label(tie)} for {label(effect)}", (*rest, tie), _with(_without(main.values, effect), tie))
            for tie in ties.get(effect, ())
        ]
    tried += [
        Structure(f"with {label(effect)}", (*main.effects, effect), _with(main.values, effect))
        for effect in _others(main, benchmark)
    ]
    say(f"looking at {len(tried)} structures")
    pieces = [piece_of(r) for r in recordings]
    parts = [piece_of(piece(r, 0, min(r.n, _SAMPLES), r.name)) for r in recordings]
    usual, *seen = pool.map(lambda s: s.fitted(parts, benchmark, evaluations=_GLANCE), (main, *tried))
    kept = [s for s in seen if not s.name.startswith("with ") or s.cost < (1.0 - _GAIN) * usual.cost]
    kept = sorted(kept, key=lambda s: s.cost)[:_MOST]
    say(f"fitting {len(kept)} structures")
    far = [
        Structure(h.name, h.effects, {**benchmark.topology.start, **h.start, **benchmark.topology.fixed})
        for h in benchmark.hypotheses
    ]
    return [main, *pool.map(lambda s: s.fitted(pieces, benchmark), (*kept, *far))]


def label(effect: Named) -> str:
    """Return an effect in words."""
    id_, where = (part.replace("_", " ") for part in effect)
    return id_ if where in id_ else f"{id_} at {where}"


def _others(main: Structure, benchmark: Benchmark) -> list[Named]:
    base = {LAYOUT[key].effect.id for key in benchmark.topology.free if key in LAYOUT}
    return [
        (e.id, where)
        for e in EFFECTS
        for where in e.where
        if e.id not in _BASE | base and (e.id, where) not in main.effects and benchmark.topology.offers(where)
    ]


def _with(values: Mapping[str, float], effect: Named) -> dict[str, float]:
    """Return a drive to which an effect is added, its sizes small, its shapes where a fit usually starts."""
    added = {}
    for key in keys_of(effect):
        q = parameter(key)
        start = q.starts[0] if q.starts else q.null
        added[key] = 0.1 * start if q.role == "size" and isfinite(q.null) and not _at_bound(key) else start
    return {**values, **added}


def _without(values: Mapping[str, float], effect: Named) -> dict[str, float]:
    gone = keys_of(effect)
    return {key: value for key, value in values.items() if key not in gone}


def _at_bound(key: str) -> bool:
    """Whether an effect is there wholly or not at all: a sensor sees the sign, or it does not."""
    q = parameter(key)
    return q.unit == "1" and bool(q.starts) and q.starts[0] == q.upper
