"""The sealed truth of a case, and how it is drawn.

Kinds and how often :func:`draw_truth` draws them where none is asked for:

========= ===== ==========================================================================
effect    50 %  one effect of the catalogue, at 0.25, 0.5, 1 or 2 times "plainly present"
pair      12 %  two of them that do not look alike, at 0.5, 1 or 2
null      14 %  nothing but nuisance
fault     10 %  an encoder that fails in one to four recordings; in half of the cases also an effect at 1 or 2
outside   14 %  an effect that is in nobody's catalogue, at 1 or 2
========= ===== ==========================================================================
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Literal, get_args

import numpy as np

from baselines.rig_simulator.catalogue import CATALOGUE, LOOK_ALIKES, OUTSIDE, Maker, size_one
from baselines.rig_simulator.nuisance import Nuisance, draw_nuisance

Kind = Literal["effect", "pair", "null", "fault", "outside"]
KINDS: tuple[Kind, ...] = get_args(Kind)
MIXTURE: Mapping[str, float] = {"effect": 0.50, "pair": 0.12, "null": 0.14, "fault": 0.10, "outside": 0.14}
SIZES = (0.25, 0.5, 1.0, 2.0)
SCHEMA = 1

# two recorded rigs, identified with all ratios free
_RIGS = (
    {"m1": 7.6e-4, "m2": 3.4e-4, "b1": 9.5e-3, "b2": 3.2e-3, "k": 0.096, "d1": 0.36, "d2": 0.25},
    {"m1": 7.3e-4, "m2": 2.4e-4, "b1": 1.05e-2, "b2": 9.9e-3, "k": 0.125, "d1": 0.58, "d2": 0.42},
)
# more friction than this and 1.5 V hardly move the carts
_MOST_FRICTION_V = 1.02


@dataclass(frozen=True)
class Effect:
    """One left-out effect: catalogue id, place, its numbers and how many times "plainly present" it is."""

    id: str
    where: str
    parameters: Mapping[str, float]
    size: float


@dataclass(frozen=True)
class Fault:
    """A failure of an encoder in one recording.

    ``how`` is ``frozen`` (every count is lost while it stands) or ``lost`` (most are, in bursts). Either way the position
    is offset ever after.
    """

    recording: str
    where: str
    start_s: float
    end_s: float
    how: str
    id: str = "encoder_dropout"


@dataclass(frozen=True)
class Truth:
    """All that is hidden from the tool.

    Attributes
    ----------
    kind, seed
        What was drawn, and from which seed; with them the recordings can be made again.
    drive
        m1, m2, b1, b2, k, d1, d2 of the rig.
    effects, faults
        What is left out, and what is broken. Faults are placed when the recordings are made.
    nuisance
        The data set's levels.
    n_faults
        How many faults to place.
    """

    kind: str
    seed: int
    drive: Mapping[str, float]
    effects: tuple[Effect, ...]
    nuisance: Nuisance
    n_faults: int = 0
    faults: tuple[Fault, ...] = field(default=())

    def json(self) -> str:
        """Return the truth as canonical JSON, the text that is sealed."""
        return json.dumps({"schema": SCHEMA, **asdict(self)}, sort_keys=True, indent=1) + "\n"


def seal(text: str) -> str:
    """Return the SHA-256 of a truth, to be published before any diagnosis."""
    return hashlib.sha256(text.encode()).hexdigest()


def draw_drive(rng: np.random.Generator) -> dict[str, float]:
    """Draw a drive around the two recorded rigs; some have the handout's ratios, some nearly a recorded rig's numbers."""
    pick = rng.random()
    while True:
        if pick < 0.2:
            drive = {n: v * float(np.exp(0.07 * rng.standard_normal())) for n, v in _RIGS[int(pick < 0.05)].items()}
        else:
            m1, b1, d1 = rng.uniform(5e-4, 1.2e-3), rng.uniform(0.006, 0.014), rng.uniform(0.2, 0.6)
            alpha, beta, gamma = rng.uniform(0.3, 0.8), rng.uniform(0.1, 0.6), rng.uniform(0.1, 0.8)
            if pick > 0.85:
                alpha, beta, gamma = 0.54, 0.1, 0.1
            drive = {"m1": m1, "m2": alpha * m1, "b1": b1, "b2": beta * b1, "d1": d1, "d2": gamma * d1}
            drive["k"] = rng.uniform(0.07, 0.13)
        if drive["d1"] + drive["d2"] <= _MOST_FRICTION_V:
            return {name: float(f"{value:.5g}") for name, value in drive.items()}


def make_effect(rng: np.random.Generator, maker: Maker, drive: Mapping[str, float], size: float) -> Effect:
    """Return an effect of a size, its free numbers (periods, phases, signs) drawn."""
    numbers = maker.make(rng, drive, size * size_one(maker))
    return Effect(maker.id, maker.where, {n: float(f"{v:.6g}") for n, v in numbers.items()}, size)


def find(effect_id: str, where: str | None = None) -> Maker:
    """Return the maker of an effect.

    Raises
    ------
    KeyError
        If nobody makes it.
    """
    for maker in (*CATALOGUE, *OUTSIDE):
        if maker.id == effect_id and where in (None, maker.where):
            return maker
    names = sorted({f"{m.id}@{m.where}" for m in (*CATALOGUE, *OUTSIDE)})
    raise KeyError(f"effect: nothing makes {effect_id!r} at {where!r}; there are {', '.join(names)}.")


def _pick(rng: np.random.Generator, makers: tuple[Maker, ...]) -> Maker:
    """Draw an id first, then a place, so that effects of two places are not twice as frequent."""
    ids = sorted({m.id for m in makers})
    chosen = ids[int(rng.integers(len(ids)))]
    places = [m for m in makers if m.id == chosen]
    return places[int(rng.integers(len(places)))]


def _pair(rng: np.random.Generator) -> tuple[Maker, Maker]:
    makers = tuple(m for m in CATALOGUE if m.id != "rectified_sensor")
    while True:
        a, b = _pick(rng, makers), _pick(rng, makers)
        if a.id != b.id and frozenset((a.id, b.id)) not in LOOK_ALIKES:
            return a, b


def draw_truth(
    seed: int,
    kind: Kind | None = None,
    *,
    size: float | None = None,
    effect: tuple[str, str] | None = None,
) -> Truth:
    """Draw a truth.

    Parameters
    ----------
    seed
        Everything follows from it.
    kind
        Drawn by the mixture above if not given.
    size
        Size of the effects; drawn if not given.
    effect
        Id and place of the (first) effect; drawn if not given.
    """
    rng = np.random.default_rng([seed, 2])
    if kind is None:
        kind = KINDS[int(rng.choice(len(KINDS), p=[MIXTURE[k] for k in KINDS]))]
    drive, nuisance = draw_drive(rng), draw_nuisance(rng)
    makers: tuple[Maker, ...] = ()
    sizes: tuple[float, ...] = SIZES
    if kind == "effect":
        makers = (_pick(rng, CATALOGUE),)
    elif kind == "pair":
        makers, sizes = _pair(rng), (0.5, 1.0, 2.0)
    elif kind == "outside":
        makers, sizes = (_pick(rng, OUTSIDE),), (1.0, 2.0)
    elif kind == "fault" and rng.random() < 0.5:
        makers, sizes = (_pick(rng, tuple(m for m in CATALOGUE if m.id != "rectified_sensor")),), (1.0, 2.0)
    if effect is not None:
        makers = (find(*effect), *makers[1:])
    effects = tuple(
        make_effect(rng, m, drive, size if size is not None else float(sizes[int(rng.integers(len(sizes)))]))
        for m in makers
    )
    n_faults = int(rng.integers(1, 5)) if kind == "fault" else 0
    return Truth(kind, seed, drive, effects, nuisance, n_faults)
