"""Where controllers run: a drive with a reference. Cases are drawn once from a seed, so all controllers meet the same."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

import numpy as np

from baselines.loop_analysis.stability_limit import with_rig
from flexdrive_gym import Drive
from flexdrive_gym.drive.effects import EFFECTS
from flexdrive_gym.recording import FloatArray
from flexdrive_gym.reference_specs import split
from flexdrive_gym.references import REFERENCES, sample_reference
from flexdrive_gym.units import LAB, Units

DRAWS = 500
# runs along the other references: enough drives for an interval of a few per cent, few enough to stay quick
UNSEEN_DRAWS = 100
HANDOUT = "handout"
# of a random reference: the first seed whose nine bits in four seconds change six times; those of 0 change once, which is a step
_SEED = 5

# beside the handout's trajectory: a longer and faster move, steps, smooth waves, and what no cart can follow in full
UNSEEN: Mapping[str, Mapping[str, float]] = MappingProxyType({
    "s_curve": MappingProxyType({"stroke": 90.0, "speed": 150.0, "acceleration": 900.0, "jerk": 9000.0}),
    "square": MappingProxyType({"amplitude": 7.5, "frequency": 0.4}),
    "sine": MappingProxyType({"amplitude": 18.0, "frequency": 0.8}),
    "chirp": MappingProxyType({"amplitude": 8.0, "start_hz": 0.3, "end_hz": 2.5, "duration": 4.0}),
    "prbs": MappingProxyType({"amplitude": 6.0, "bit_s": 0.45}),
})  # fmt: skip


@dataclass(frozen=True)
class Reference:
    """A reference with a name: a key of :data:`~flexdrive_gym.references.REFERENCES`, its keywords, and how it was asked for."""

    name: str
    keywords: tuple[tuple[str, float], ...] = ()
    asked: str = ""

    def sampled(self, t: FloatArray) -> FloatArray:
        """Return the reference at instants [s], ndarray, shape (n,) [mm]; a random one is the same every time."""
        return sample_reference((self.name, dict(self.keywords)), t, np.random.default_rng(_SEED))

    def __str__(self) -> str:
        if dict(self.keywords) == UNSEEN.get(self.name):
            return self.name
        return self.asked or _text(self.name, dict(self.keywords))


def _text(name: str, keywords: Mapping[str, float]) -> str:
    return name + "".join(f":{key}={value:g}" for key, value in keywords.items())


def named_reference(text: str, units: Units = LAB) -> Reference:
    """Return a reference from ``name`` or ``name:keyword=value:…``; a name alone stands for the one in :data:`UNSEEN`.

    Parameters
    ----------
    text
        As a user writes it, values in the rig's units.
    units
        The rig's.

    Raises
    ------
    ValueError
        For a keyword without a number; an unknown name or keyword is found when it is sampled.
    """
    try:
        name, keywords = split(text)
    except ValueError as error:
        raise ValueError(str(error).replace("reference:", "references:", 1)) from error
    sizes = {p.name: units.one(p.unit) for p in REFERENCES[name].parameters} if name in REFERENCES else {}
    given = {key: value * sizes.get(key, 1.0) for key, value in keywords.items()} or dict(UNSEEN.get(name, {}))
    reference = Reference(name, tuple(given.items()), _text(name, keywords))
    try:
        reference.sampled(np.zeros(1))
    except (TypeError, ValueError) as error:
        raise ValueError(f"references: {error}") from error
    return reference


UNSEEN_REFERENCES = tuple(named_reference(name) for name in UNSEEN)


@dataclass(frozen=True, eq=False)
class Case:
    """A drive and a reference on which every controller runs.

    Attributes
    ----------
    name
        Unique.
    group
        ``nominal``, ``draw`` or ``effect``: what the drive is.
    drive
        The drive.
    reference
        The handout's trajectory, or one of the others.
    """

    name: str
    group: Literal["nominal", "draw", "effect"]
    drive: Drive
    reference: Reference = Reference(HANDOUT)

    @property
    def handout(self) -> bool:
        """Whether the reference is the handout's trajectory."""
        return self.reference.name == HANDOUT


def typical_effects(drive: Drive) -> list[Case]:
    """Return the drive with each effect of the catalogue that it lacks, one at a time, at typical size.

    The size is the effect's own (the first start value of its parameters). An effect at a place that the drive already has,
    identified or the rig's, is left as it is.
    """
    cases = []
    for effect in EFFECTS:
        for where in effect.where:
            keys = {effect.key(where, p.name): p for p in effect.parameters}
            if any(key in drive.values for key in keys) or (drive.carts == 1 and _needs_second_cart(where)):
                continue
            values = {key: p.starts[0] for key, p in keys.items() if p.starts}
            if values:
                name = effect.id if len(effect.where) == 1 else f"{effect.id}, {where}"
                cases.append(Case(name, "effect", drive.replace(values, name=f"{drive.name} with {name}")))
    return cases


def _needs_second_cart(where: str) -> bool:
    return where in {"cart_2", "encoder_2", "spring"}


def cases_of(
    drive: Drive,
    *,
    draws: int = DRAWS,
    effects: bool = True,
    references: Sequence[Reference] = UNSEEN_REFERENCES,
    seed: int = 0,
) -> list[Case]:
    """Return the cases: the drive itself, drawn drives, the drive with each left-out effect, and other references.

    Parameters
    ----------
    drive
        The handout's encoder counts and command limit are added where it has none.
    draws
        From the identified covariance; 0 for none. The first hundred of them also follow the other references.
    effects
        Whether each left-out effect at its typical size is a case.
    references
        Beside the handout's trajectory.
    seed
        Of the draws.

    Raises
    ------
    ValueError
        If draws are asked for and the drive has no covariance.
    """
    rig = with_rig(drive)
    drawn = rig.draw(np.random.default_rng(seed), draws) if draws else []
    cases = [Case(drive.name, "nominal", rig)]
    cases += [Case(f"draw {i + 1}", "draw", d) for i, d in enumerate(drawn)]
    if effects:
        cases += typical_effects(rig)
    for reference in references:
        cases.append(Case(f"{drive.name}, {reference}", "nominal", rig, reference))
        cases += [Case(f"draw {i + 1}, {reference}", "draw", d, reference) for i, d in enumerate(drawn[:UNSEEN_DRAWS])]
    return cases
