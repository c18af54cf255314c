"""Topology: which bodies a drive has, which of their parameters a fit may move, and where anything can act.

The catalogue of effects is written for two carts and a spring. Other rigs are that drive with something missing: one cart
alone, a second cart that is the ground, a sensor on one of the carts only. A topology says what is missing, so that the
engine needs no knowledge of any rig. What is *measured* is not part of it: recordings say that by the channels they have, and
a channel that was not recorded has no valid samples.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from flexdrive_gym.drive.effects import LAYOUT
from flexdrive_gym.drive.parameters import parameter
from flexdrive_gym.recording import Recording
from identification.recordings.rig import Rig

# a mass that no command moves: the ground
GROUND_MASS = 1e9


@dataclass(frozen=True)
class Topology:
    """A drive with its parts named.

    Attributes
    ----------
    name
        In words.
    carts
        Bodies of the simulation, 1 or 2; one that is the ground counts.
    free
        Parameters of the linear drive (and friction, where it is taken for granted) that every fit moves.
    fixed
        Parameters held at a value: a body that is the ground, or a choice where the data cannot tell.
    idle
        Places at which nothing can act or be seen; effects there are no candidates.
    start
        Values to start from besides those found in the data.

    Raises
    ------
    ValueError, KeyError
        For a number of carts other than 1 and 2, or a parameter that is unknown or both free and fixed.
    """

    name: str
    carts: int
    free: tuple[str, ...]
    fixed: Mapping[str, float] = field(default_factory=dict)
    idle: frozenset[str] = frozenset()
    start: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.carts not in (1, 2):
            raise ValueError(f"carts: must be 1 or 2; got {self.carts}. A drive has one cart or two.")
        for name in (*self.free, *self.fixed, *self.start):
            parameter(name)
        both = sorted(set(self.free) & set(self.fixed))
        if both:
            raise ValueError(f"fixed: what is fixed cannot be free; got {', '.join(both)} twice. Leave it out of free.")

    @property
    def two_carts(self) -> bool:
        """Whether it is the handout's drive: two carts that both move, all of their parameters free."""
        return set(TWO_CARTS.free) <= set(self.free)

    @property
    def moving(self) -> int:
        """How many bodies move: one that is the ground does not."""
        return self.carts - (self.fixed.get("m2") == GROUND_MASS)

    def offers(self, where: str) -> bool:
        """Whether an effect can act at a place of the catalogue."""
        return where not in self.idle and not (self.carts == 1 and where in _SECOND)


_SECOND = frozenset({"cart_2", "spring", "encoder_2"})
_FILTER = "velocity_processing"
CART = Topology("one cart", 1, ("m1", "b1", "d1"))
TWO_CARTS = Topology("two carts and a spring", 2, ("m1", "m2", "b1", "b2", "k", "d1", "d2"))


def grounded(name: str, start: Mapping[str, float]) -> Topology:
    """Return a cart on a spring to the ground, without dry friction."""
    return Topology(name, 2, ("m1", "b1", "k"), {"m2": GROUND_MASS}, frozenset({"cart_2", "encoder_2"}), start)


def topology_of(recordings: Sequence[Recording]) -> Topology:
    """Return the topology that the channels of the recordings tell: two carts where the second one is seen in every run.

    A rig description that came with them has the last word on the number of carts, and adds the effects that it knows. Velocities
    that were not made from a position as far as the recordings tell have passed a filter, which is part of the model, too.
    """
    seen = [r.v2 is not None or r.x2 is not None for r in recordings]
    told = TWO_CARTS if seen and all(seen) else CART
    rig: Rig | None = getattr(recordings, "rig", None)
    if rig is not None and rig.carts is not None:
        told = TWO_CARTS if rig.carts == 2 else CART
    filtered = any(r.velocity_cutoff is None and (r.v1 is not None or r.v2 is not None) for r in recordings)
    return with_known(told, (*(() if rig is None else rig.known), *((_FILTER,) if filtered else ())))


def with_known(topology: Topology, known: Sequence[str]) -> Topology:
    """Return a topology whose every fit moves the parameters of known effects, too, at each place that they can act.

    Parameters
    ----------
    known
        Ids of the catalogue; ``id@place`` for one place of several.
    """
    start: dict[str, float] = {}
    for item in known:
        id_, _, place = item.partition("@")
        for name, slot in LAYOUT.items():
            if slot.effect.id == id_ and place in ("", slot.where) and topology.offers(slot.where):
                begin = slot.parameter.starts[0] if slot.parameter.starts else slot.parameter.null
                start[name] = float(np.clip(begin, slot.parameter.lower, slot.parameter.upper))
    if not start:
        return topology
    free = (*topology.free, *(name for name in start if name not in topology.free))
    return replace(topology, free=free, start={**topology.start, **start})
