"""Naming: add one effect at a time, each searched in the whole catalogue, until what is left could be chance."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from identification.mismatch.alike import Disagreement, disagreement
from identification.mismatch.along_track import place_shapes
from identification.mismatch.candidates import look_alikes
from identification.mismatch.chance import chance, null_residuals
from identification.mismatch.refit import Fit
from identification.mismatch.rounds import LEAST_GAIN, LEVEL, Progress, Rival, Stage, Starts, passes, stage
from identification.mismatch.settle import settle
from identification.mismatch.shapes import WORTH, Shape, free_shapes
from identification.mismatch.surroundings import differs_between_runs, dry_level
from identification.mismatch.workbench import View, Workbench
from identification.topology import Topology

# once something is certainly left out, which effect it is is decided among all that chance would reach more rarely than this
PLAUSIBLE = 0.1
# what chance would reach more rarely than this is suspected: recordings kept away decide
SUSPICIOUS = 0.15
# rivals closer than this in gain, or not plainly worse in the paired recordings, are ties
TIE_LEVEL, TIE_GAIN = 0.05, 0.98
# friction along the track whose rms is below this share of the drive, or of the cart's dry friction, is the roughness that every
# rig has: those that were measured are rough by up to 0.14 of their friction
ROUGHNESS, ROUGH_FRICTION = 0.012, 0.2
WAY_MM = 100.0
# findings at most, and rivals of one round that are put to the proof
MOST_EFFECTS, MOST_TRIED = 4, 3
# of what an effect explains, recordings that want sizes of their own must not explain this share more
_UNLIKE = 0.35
# what comes before its refinements, if it explains this share of what the best of them does
_PLAIN, _PLAIN_GAIN = "coulomb_friction", 0.5


@dataclass(frozen=True, eq=False)
class Step:
    """An effect that the search took up.

    Attributes
    ----------
    rival
        The effect with its joint refit.
    ties
        Others that these recordings cannot tell from it.
    probability
        False-alarm probability.
    view
        In which it was found.
    suspected
        Whether nothing in its round was as rare by chance as a finding must be, so that recordings kept away decide.
    """

    rival: Rival
    ties: tuple[Rival, ...]
    probability: float
    view: View
    suspected: bool = False


@dataclass(frozen=True, eq=False)
class Unlike:
    """A step taken back, for every recording wants another size of it: it only resembles what is missing.

    Attributes
    ----------
    step
        As it was taken.
    share
        Of the error left by the steps before it that it explained.
    likeness
        Cosine between what its common size explains and what sizes of the recordings' own do.
    disagreement
        Of the recordings about its size.
    """

    step: Step
    share: float
    likeness: float
    disagreement: Disagreement


# findings before, a finding, start values: whether it holds on recordings kept away
Stands = Callable[[Sequence[Step], Step, Mapping[str, float]], bool]


@dataclass(frozen=True, eq=False)
class Search:
    """All rounds: what was taken up, and where it ended.

    Attributes
    ----------
    steps
        What stands at the end of the search.
    unlike
        What was taken back.
    model
        With the steps.
    stages
        All rounds; the last one is around the model.
    first_shapes, last_shapes
        Free shapes beside no name, and beside all.
    """

    steps: tuple[Step, ...]
    unlike: tuple[Unlike, ...]
    model: Fit
    stages: tuple[Stage, ...] = field(repr=False)
    first_shapes: tuple[Shape, ...] = field(repr=False)
    last_shapes: tuple[Shape, ...] = field(repr=False)

    @property
    def last(self) -> Stage:
        """The round that found nothing more."""
        return self.stages[-1]


def search(
    bench: Workbench,
    values: Mapping[str, float],
    topology: Topology,
    rng: np.random.Generator,
    *,
    drive_level: float,
    shapes: Callable[[Mapping[str, float]], Mapping[str, Sequence[float]]],
    starts: Starts | None = None,
    stands: Stands = lambda *_: True,
    say: Progress = lambda _: None,
) -> Search:
    """Find the effects that were left out of a drive.

    Parameters
    ----------
    bench
        The recordings to learn from.
    values
        The free fit.
    drive_level
        Typical command [V], against which sizes are judged.
    shapes
        Start grids found from the data, for the present model.
    starts
        Drives from which named candidates are refitted, instead of from the present model: a sensor that shows something else
        than motion spoils every fit that does not know of it.
    stands
        Whether a finding holds on recordings kept away, next to those before it and with the given start values.
    """
    starts = starts or {}
    model = settle(bench, values, topology.free)
    steps: list[Step] = []
    stages: list[Stage] = []
    while True:
        if len(steps) == MOST_EFFECTS:
            stages.append(_around(bench, stages[-1], model, rng))
            break
        now = stage(bench, model, topology, rng, shapes(model.values), starts, say=say)
        stages.append(now)
        if len(stages) == 1:
            say("free shapes")
            shapes_found = first_shapes = _shapes(bench, now)
        step = _proven(now, drive_level, steps, stands)
        if step is None:
            break
        best = step.rival
        bench.offsets = best.offsets
        model = settle(bench, best.fit.values, best.fit.names, None if bench.parts else topology.free)
        steps.append(step)
        say(f"found: {best.name[0]} at {best.name[1]}")
    unlike: list[Unlike] = []
    while steps:
        worst = _most_unlike(bench, stages[-1], steps)
        if worst is None:
            break
        unlike.append(worst)
        steps.remove(worst.step)
        say(f"taken back: {worst.step.rival.name[0]} at {worst.step.rival.name[1]}")
        model = _without(bench, model, worst.step, steps, topology)
        stages.append(_around(bench, stages[-1], model, rng))
    if len(stages) > 1:
        say("free shapes")
        shapes_found = _shapes(bench, stages[-1])
    return Search(tuple(steps), tuple(unlike), model, tuple(stages), first_shapes, shapes_found)


def _around(bench: Workbench, last: Stage, model: Fit, rng: np.random.Generator) -> Stage:
    """Return a round in which nothing is tried: what chance reaches around a model."""
    return replace(last, before=model, rivals=(), null=null_residuals(bench, model.values, rng))


def _most_unlike(bench: Workbench, last: Stage, steps: Sequence[Step]) -> Unlike | None:
    """Return the step about whose size the recordings disagree most, if they do by more than chance makes them.

    That levels of dry friction differ from run to run says nothing, nor that constant forces do: a track has a slope where a
    run began.
    """
    found: list[Unlike] = []
    left = 1.0
    for step in reversed(steps):
        # of the error that is left in the end
        left /= max(1.0 - step.rival.gain, 1e-3)
        explained = step.rival.gain * left
        sizes = [k for k, _ in step.rival.candidate.sizes if k in last.before.names and not differs_between_runs(k)]
        if not sizes:
            continue
        own = disagreement(bench, last.before, last.null, sizes, step.view)
        if own.probability <= LEVEL and own.share > max(_UNLIKE * explained, WORTH):
            alike = float(np.sqrt(explained / (explained + own.share)))
            found.append(Unlike(step, step.rival.gain, alike, own))
    return min(found, key=lambda u: u.likeness, default=None)


def _without(bench: Workbench, model: Fit, gone: Step, others: Sequence[Step], topology: Topology) -> Fit:
    """Return the model without one of its steps."""
    keys = gone.rival.candidate.keys
    names = [n for n in model.names if n not in keys]
    values = {k: v for k, v in model.values.items() if k not in keys}
    if all(s.rival.candidate.period is None for s in others):
        bench.offsets = np.zeros(len(bench.runs))
    return settle(bench, values, names, None if bench.parts else topology.free)


def _proven(now: Stage, drive_level: float, steps: Sequence[Step], stands: Stands) -> Step | None:
    """Return the best finding of a round that holds on recordings kept away, if one of the first does."""
    rivals = now.rivals
    # that what chance would hardly reach was refused is no ground for suspicion
    suspicious = _choose(now, drive_level) is None
    choose = _suspect if suspicious else _choose
    for _ in range(MOST_TRIED):
        best = choose(replace(now, rivals=rivals), drive_level)
        if best is None:
            return None
        ties = [r for r in rivals if r is not best and (_ties(now, r, best) or _as_good(r, best))]
        step = Step(best, _foremost(ties, best), best.probability, now.view, suspicious)
        if stands(steps, step, best.fit.values):
            return step
        rivals = tuple(r for r in rivals if r is not best)
    return None


def _shapes(bench: Workbench, stage: Stage) -> tuple[Shape, ...]:
    """Free shapes on the model before a stage, with their false-alarm probabilities."""
    shapes = free_shapes(bench, stage.before)
    luck = chance(bench, {"comparable": [s.screened for s in shapes]}, stage.null, stage.before)
    shapes = [replace(s, probability=luck.probability(s.screened.candidate.name, [s.gain])) for s in shapes]
    shapes += place_shapes(bench, stage.before, stage.null)
    return tuple(sorted(shapes, key=lambda s: -s.predicted))


def _choose(now: Stage, drive_level: float) -> Rival | None:
    """Return what to take up: nothing, unless chance would hardly reach it; then what fits best.

    That something is left out, and what, are two questions. The first is answered by the effect that goes furthest beyond its
    own usual luck; an effect that chance feeds more often may yet explain the recordings better. Dry friction comes before its
    refinements where the drive has none yet: a hump at low speed alone fits better than it, because a hump bends more ways.
    What has a shape at its lower bound is another effect than it is called.
    """
    rivals = [r for r in now.rivals if not _rough(r, drive_level) and not r.candidate.vanishes(r.fit.values)]
    if not any(passes(r) for r in rivals):
        return None
    likely = [r for r in rivals if passes(r) or (r.probability <= PLAUSIBLE and r.candidate.period is None)]
    best = max(likely, key=lambda r: r.gain)
    plain = next((r for r in likely if r.name == (_PLAIN, best.candidate.where)), None)
    if plain is not None and plain is not best and plain.gain > _PLAIN_GAIN * best.gain:
        return plain
    # of what cannot be told apart, the explanation with the fewest numbers
    equals = [r for r in likely if r is best or _ties(now, r, best)]
    return min(equals, key=lambda r: (len(r.fit.names), -r.gain))


def _suspect(now: Stage, drive_level: float) -> Rival | None:
    """Return the best of all that chance would not reach too often, though too often to be taken up by itself.

    If that is a rough track, or repeats along it, nothing is suspected.
    """
    best = max((r for r in now.rivals if r.probability <= SUSPICIOUS), key=lambda r: r.gain, default=None)
    if best is None or best.candidate.period is not None or best.gain < LEAST_GAIN:
        return None
    return None if _rough(best, drive_level) or best.candidate.vanishes(best.fit.values) else best


def _ties(now: Stage, rival: Rival, best: Rival) -> bool:
    if rival.gain <= 0.5 * best.gain or rival.probability > PLAUSIBLE:
        return False
    return now.behind(rival, best) > TIE_LEVEL or rival.gain > TIE_GAIN * best.gain


def _as_good(rival: Rival, best: Rival) -> bool:
    """Whether a rival explains as much in the view in which the best explains more: the other may tell them apart by chance."""
    view = int(np.argmax(best.gains))
    return rival.probability <= PLAUSIBLE and rival.gains[view] > TIE_GAIN * best.gains[view]


def _foremost(ties: Sequence[Rival], best: Rival) -> tuple[Rival, ...]:
    """Return the three ties there is room for: those that are known to look like the finding come first."""
    known = look_alikes(best.name[0])
    return tuple(sorted(ties, key=lambda r: (r.name[0] not in known, -r.gain))[:3])


def friction_along_track(values: Mapping[str, float], where: str) -> float:
    """Return the rms variation of a cart's friction over the way that recordings usually take [V]."""
    key = f"position_friction.{where}."
    wave = np.hypot(values.get(key + "a_sin", 0.0), values.get(key + "a_cos", 0.0))
    return float(np.hypot(wave / np.sqrt(2.0), values.get(key + "slope", 0.0) * WAY_MM / np.sqrt(12.0)))


def _rough(rival: Rival, drive_level: float) -> bool:
    if rival.candidate.id != "position_friction":
        return False
    values, where = rival.fit.values, rival.candidate.where
    usual = max(ROUGHNESS * drive_level, ROUGH_FRICTION * dry_level(values, int(where[-1]) - 1))
    return friction_along_track(values, where) < usual
