"""Naming: add one effect at a time, each searched in the whole catalogue, until what is left could be chance."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from flexdrive_gym.drive.effects import EFFECTS, LAYOUT
from flexdrive_gym.recording import FloatArray
from identification.mismatch.candidates import Candidate, bounds, catalogue
from identification.mismatch.chance import Chance, chance, null_residuals
from identification.mismatch.refit import Coordinates, Fit, refit, sensitivities, with_fresh_jacobian
from identification.mismatch.screening import Screened, orthonormal, screen
from identification.mismatch.shapes import Shape, free_shapes
from identification.mismatch.workbench import FRICTION, OFFSET, Workbench
from identification.topology import Topology

Progress = Callable[[str], None]
# effect and place to a drive that has it
Starts = Mapping[tuple[str, str], Mapping[str, float]]
# a finding must be rarer than this by chance, and explain at least this share of the remaining squared error
LEVEL, LEAST_GAIN = 0.01, 0.03
# rivals closer than this in gain, or not plainly worse in the paired recordings, are ties
TIE_LEVEL, TIE_GAIN = 0.05, 0.98
# friction along the track whose rms is below this share of the drive is the roughness that every rig has
ROUGHNESS = 0.012
WAY_MM = 100.0
# friction along the track is taken out from this gain on, and is a finding from this one on
TRACK_GAIN, TRACK_FINDING = 0.15, 0.4
MOST_EFFECTS = 5
# waves within the way that make a repetition
_WAVES = 1.5
# what comes before its refinements, if it explains this share of what the best of them does
_PLAIN, _PLAIN_GAIN = "coulomb_friction", 0.5
_BATCH = 48
_REFITS = 5
_SECOND_STARTS = 1


@dataclass(frozen=True, eq=False)
class Rival:
    """A candidate refitted jointly with the model of its stage.

    Attributes
    ----------
    screened
        Its linear prospects.
    fit
        The joint refit.
    offsets
        Where every run began along the track [mm], modulo the period.
    gain
        Share of the stage's comparable squared error that the refit removed.
    probability
        False-alarm probability of that gain in a search over the whole catalogue.
    behind
        Probability that it is as good as the stage's best, from the recordings' paired costs.
    """

    screened: Screened
    fit: Fit
    offsets: FloatArray
    gain: float
    probability: float = 1.0
    behind: float = 1.0

    @property
    def candidate(self) -> Candidate:
        """Effect and place with start values."""
        return self.screened.candidate

    @property
    def name(self) -> tuple[str, str]:
        """Effect and place."""
        return self.candidate.name


@dataclass(frozen=True, eq=False)
class Stage:
    """One round of the search: what was tried, and what chance reaches.

    Attributes
    ----------
    before
        The model at the start of the round.
    rivals
        Refitted candidates: first those that chance would not reach, each part by gain.
    screened
        Best entry of every effect and place, best first.
    null
        Comparable residuals of the null draws, shape (N, draws).
    """

    before: Fit
    rivals: tuple[Rival, ...]
    screened: tuple[Screened, ...]
    null: FloatArray = field(repr=False)

    @property
    def probability(self) -> float:
        """False-alarm probability of the first rival."""
        return self.rivals[0].probability if self.rivals else 1.0


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
    rms_before, rms_after
        Of the block residuals in the recordings learnt from [mm/s].
    roughness
        Whether it is no finding but the roughness of every track.
    """

    rival: Rival
    ties: tuple[Rival, ...]
    probability: float
    rms_before: float
    rms_after: float
    roughness: bool


@dataclass(frozen=True, eq=False)
class Search:
    """All rounds: the baseline, what was taken up, and where it ended."""

    baseline: Fit
    steps: tuple[Step, ...]
    model: Fit
    stages: tuple[Stage, ...] = field(repr=False)
    first_shapes: tuple[Shape, ...] = field(repr=False)
    last_shapes: tuple[Shape, ...] = field(repr=False)

    @property
    def last(self) -> Stage:
        """The round that found nothing more."""
        return self.stages[-1]

    @property
    def findings(self) -> tuple[Step, ...]:
        """Steps that are findings."""
        return tuple(s for s in self.steps if not s.roughness)


def directions(
    bench: Workbench, candidates: Sequence[Candidate], values: Mapping[str, float], raw: FloatArray
) -> list[FloatArray]:
    """Return every candidate's comparable columns."""
    jobs = [(i, drive) for i, candidate in enumerate(candidates) for drive in candidate.directions(values)]
    columns: list[list[FloatArray]] = [[] for _ in candidates]
    for begin in range(0, len(jobs), _BATCH):
        part = jobs[begin : begin + _BATCH]
        found = bench.comparable(bench.residuals([drive for _, drive in part]) - raw[:, None])
        for (i, _), column in zip(part, found.T, strict=True):
            columns[i].append(column)
    return [np.column_stack(c) for c in columns]


def search(
    bench: Workbench,
    values: Mapping[str, float],
    topology: Topology,
    rng: np.random.Generator,
    *,
    drive_level: float,
    shapes: Callable[[Mapping[str, float]], Mapping[str, Sequence[float]]],
    starts: Starts | None = None,
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
    """
    starts = starts or {}
    first = model = baseline(bench, values, topology.free)
    steps: list[Step] = []
    stages: list[Stage] = []
    while True:
        now = stage(bench, model, topology, rng, shapes(model.values), starts, say=say)
        stages.append(now)
        if len(stages) == 1:
            say("free shapes")
            shapes_found = first_shapes = _shapes(bench, now)
        best = _choose(now, drive_level)
        if best is None or len(steps) >= MOST_EFFECTS + 2:
            break
        rough = _roughness(best, drive_level)
        if len([s for s in steps if not s.roughness]) >= MOST_EFFECTS and not rough:
            break
        before = rms(bench, model.values)
        bench.offsets = best.offsets
        model = settle(bench, best.fit.values, best.fit.names)
        ties = () if rough else tuple(r for r in now.rivals if r is not best and _ties(r, best))
        steps.append(Step(best, ties[:3], best.probability, before, rms(bench, model.values), rough))
        say(f"{'rough track' if rough else 'found'}: {best.name[0]} at {best.name[1]}")
    if len(stages) > 1:
        say("free shapes")
        shapes_found = _shapes(bench, stages[-1])
    return Search(first, tuple(steps), model, tuple(stages), first_shapes, shapes_found)


def _shapes(bench: Workbench, stage: Stage) -> tuple[Shape, ...]:
    """Free shapes on the model before a stage, with their false-alarm probabilities."""
    shapes = free_shapes(bench, stage.before)
    luck = chance(bench, [s.screened for s in shapes], stage.null, orthonormal(stage.before.jacobian))
    return tuple(replace(s, probability=luck.probability(s.screened.candidate.name, s.gain)) for s in shapes)


def _choose(now: Stage, drive_level: float) -> Rival | None:
    """Return what to take up: the best that chance would not reach, or else friction along the track.

    Every track is rough, so chance makes friction along the track, and its gain proves nothing; its size against the drive
    decides whether it is a finding. Taken out either way, it no longer hides the rest. Dry friction comes before its
    refinements where the drive has none yet: a hump at low speed alone fits better than it, because a hump bends more ways.
    """
    if not now.rivals:
        return None
    best = now.rivals[0] if _passes(now.rivals[0]) else None
    plain = next((r for r in now.rivals if r.candidate.id == _PLAIN and r.probability <= TIE_LEVEL), None)
    if best is not None and plain is not None and plain.gain > _PLAIN_GAIN * best.gain:
        return plain
    if best is not None:
        # of what cannot be told apart, the explanation with the fewest numbers
        equals = [r for r in now.rivals if _passes(r) and (r is best or _ties(r, best))]
        best = min(equals, key=lambda r: (len(r.fit.names), r.fit.cost))
    track = [r for r in now.rivals if r.candidate.id == "position_friction" and r.gain >= TRACK_GAIN]
    along = max(track, key=lambda r: r.gain, default=None)
    if along is None or (best is not None and best.gain > 0.7 * along.gain):
        return best
    if not _roughness(along, drive_level) and along.gain < TRACK_FINDING:
        return best
    return along


def _ties(rival: Rival, best: Rival) -> bool:
    if rival.gain <= 0.5 * best.gain or rival.probability > TIE_LEVEL:
        return False
    return rival.behind > TIE_LEVEL or rival.gain > TIE_GAIN * best.gain


def along_track(values: Mapping[str, float], where: str) -> float:
    """Return the rms variation of a cart's friction over the way that recordings usually take [V]."""
    key = f"position_friction.{where}."
    wave = np.hypot(values.get(key + "a_sin", 0.0), values.get(key + "a_cos", 0.0))
    return float(np.hypot(wave / np.sqrt(2.0), values.get(key + "slope", 0.0) * WAY_MM / np.sqrt(12.0)))


def _roughness(rival: Rival, drive_level: float) -> bool:
    if rival.candidate.id != "position_friction":
        return False
    return along_track(rival.fit.values, rival.candidate.where) < ROUGHNESS * drive_level


def rms(bench: Workbench, values: Mapping[str, float]) -> float:
    """Return the rms of the block residuals over valid blocks [mm/s]."""
    e = bench.residual(values)[bench.rows.valid]
    return float(np.sqrt(np.mean(e**2)))


def best_of_each(screened: Sequence[Screened], most: int = 1) -> list[Screened]:
    """Return the best entries of every effect and place, best first."""
    count: dict[tuple[str, str], int] = {}
    kept = []
    for s in sorted(screened, key=lambda s: -s.gain):
        n = count.get(s.candidate.name, 0)
        if n < most and s.gain > 0.0:
            kept.append(s)
            count[s.candidate.name] = n + 1
    return kept


def stage(
    bench: Workbench,
    model: Fit,
    topology: Topology,
    rng: np.random.Generator,
    shapes: Mapping[str, Sequence[float]],
    starts: Starts,
    *,
    say: Progress = lambda _: None,
) -> Stage:
    """Search the catalogue once for what explains most of the model's error."""
    raw = bench.residual(model.values)
    known = [n for n in model.values if n in LAYOUT]
    candidates = catalogue(topology, known, shapes)
    say(f"screening {len(candidates)} candidates")
    present = orthonormal(model.jacobian)
    e = model.residual - present @ (present.T @ model.residual)
    columns = directions(bench, candidates, model.values, raw)
    screened = list(
        bench.pool.map(lambda pair: screen(bench, pair[0], pair[1], e, present), zip(candidates, columns, strict=True))
    )
    null = null_residuals(bench, model.values, rng)
    luck = chance(bench, screened, null, present)
    leaders = best_of_each(screened)
    tried = []
    chosen = _to_refit(screened, leaders, luck)
    chosen += [s for s in screened if s.candidate.name in starts and not any(s is c for c in chosen)]
    for s in chosen:
        say(f"refitting with {s.candidate.id} ({s.candidate.where})")
        tried.append(_rival(bench, model, s, raw, starts.get(s.candidate.name)))
    best: dict[tuple[str, str], Rival] = {}
    for r in (r for r in tried if _repeats(bench, r)):
        if r.name not in best or r.fit.cost < best[r.name].fit.cost:
            best[r.name] = r
    judged = [replace(r, probability=luck.probability(r.name, max(r.gain, r.screened.gain))) for r in best.values()]
    order = sorted(judged, key=lambda r: (not _passes(r), r.fit.cost))
    return Stage(model, tuple(_paired(bench, order, rng)), tuple(leaders), null)


def _repeats(bench: Workbench, rival: Rival) -> bool:
    """Whether the way holds enough waves of an effect to call it repeating; any smooth force is a piece of a long wave.

    Asked only where all runs share their place: waves of several runs that began anywhere overlap as they please.
    """
    period = rival.candidate.period
    if period is None or not bench.parts:
        return True
    track = np.concatenate([run.track for run in bench.runs], axis=1)
    return _WAVES * rival.fit.values[period] <= float(np.max(np.ptp(track, axis=1)))


def _passes(rival: Rival) -> bool:
    return rival.probability <= LEVEL and rival.gain >= LEAST_GAIN


def _to_refit(screened: Sequence[Screened], leaders: Sequence[Screened], luck: Chance) -> list[Screened]:
    """The leaders in gain and in surprise, other starts for the first of them, and what is known to look like them."""
    chosen = list(leaders[:_REFITS])
    surprising = sorted(leaders, key=lambda s: -luck.surprise(s.candidate.name, s.gain))
    chosen += [s for s in surprising[:3] if not any(s is c for c in chosen)]
    alike: set[str] = set()
    for s in (*leaders[:2], *surprising[:1]):
        alike |= {i for e in EFFECTS if e.id == s.candidate.id for i in e.looks_like}
    others = [s for s in leaders[_REFITS:] if s.candidate.id in alike and not any(s is c for c in chosen)]
    chosen += [s for s in others if s.gain > 0.1 * leaders[0].gain][:2]
    for s in leaders[:_SECOND_STARTS]:
        others = [o for o in screened if o.candidate.name == s.candidate.name and o is not s and o.gain > 0.3 * s.gain]
        others = [o for o in others if o.candidate.shapes != s.candidate.shapes]
        chosen += sorted(others, key=lambda o: -o.gain)[:1]
    return chosen


def _rival(
    bench: Workbench, model: Fit, s: Screened, raw: FloatArray, known: Mapping[str, float] | None = None
) -> Rival:
    c = s.candidate
    if known is not None:
        # its own parameters stay as given: a sensor loses the sign or it does not
        fit = refit(bench, {**model.values, **known}, model.names, iterations=12)
        return Rival(s, fit, bench.offsets, 1.0 - fit.cost / model.cost)
    start = {**model.values, **dict(c.shapes)}
    for (key, _), size in zip(c.sizes, s.sizes, strict=True):
        low, high = bounds(key)
        start[key] = float(np.clip(size, low, high))
    here = bench.offsets
    keys = c.keys
    if bench.unplaced(c.period):
        keys = _align(bench, model, c, start, raw)
    # shapes do nothing while every size is null
    if all(start[key] == LAYOUT[key].parameter.null for key, _ in c.sizes):
        start.update({key: 0.1 * size for key, size in c.sizes})
    fit = refit(bench, start, (*model.names, *keys), iterations=6, fresh=keys, known=(model.names, model.jacobian))
    if bench.unplaced(c.period):
        keys = _align(bench, model, c, dict(fit.values), raw)
        again = refit(
            bench, fit.values, (*model.names, *keys), iterations=3, fresh=keys, known=(model.names, model.jacobian)
        )
        fit = min(fit, again, key=lambda f: f.cost)
    offsets, bench.offsets = bench.offsets, here
    return Rival(s, fit, offsets, 1.0 - fit.cost / model.cost)


def _align(bench: Workbench, model: Fit, c: Candidate, start: dict[str, float], raw: FloatArray) -> tuple[str, ...]:
    """Find where every run began along the track from its own amplitudes; leave one amplitude in ``start``."""
    sin, cos = (next(k for k, _ in c.sizes if k.endswith(end)) for end in ("a_sin", "a_cos"))
    shape = tuple((k, start[k]) for k, _ in c.shapes)
    step = dict(c.sizes)[sin]
    probe = Candidate(c.id, c.where, ((sin, step), (cos, step)), shape)
    columns = directions(bench, [probe], model.values, raw)[0]
    present = orthonormal(model.jacobian)
    columns -= present @ (present.T @ columns)
    e = model.residual - present @ (present.T @ model.residual)
    offsets, weight, size = bench.offsets.copy(), 0.0, 0.0
    for r in range(len(bench.runs)):
        rows = bench.rows.of(r)
        (a, b), *_ = np.linalg.lstsq(columns[rows], -e[rows], rcond=1e-3)
        w = float(np.sum(columns[rows] ** 2))
        offsets[r] += np.arctan2(b, a) * start[c.period or ""] / (2.0 * np.pi)
        weight, size = weight + w, size + w * float(np.hypot(a, b)) * step
    bench.offsets = offsets
    start[sin], start[cos] = size / max(weight, 1e-300), 0.0
    return tuple(k for k in c.keys if k != cos)


def _paired(bench: Workbench, rivals: Sequence[Rival], rng: np.random.Generator, draws: int = 999) -> list[Rival]:
    """Judge rivals against the best by their costs in the same recordings, resampled."""
    if not rivals:
        return []
    n = len(bench.runs)
    pick = rng.integers(0, n, (draws, n))
    costs = [np.array([float(np.sum(r.fit.residual[bench.rows.of(i)] ** 2)) for i in range(n)]) for r in rivals]
    return [
        replace(r, behind=float(np.mean((cost - costs[0])[pick].sum(axis=1) <= 0.0)) if i else 1.0)
        for i, (r, cost) in enumerate(zip(rivals, costs, strict=True))
    ]


def baseline(bench: Workbench, values: Mapping[str, float], names: Sequence[str]) -> Fit:
    """Refit the drive's own parameters on the bench and set its weights, whitening and run-to-run friction."""
    fit = settle(bench, values, names)
    return settle(bench, fit.values, names)


def _ones(bench: Workbench) -> list[FloatArray]:
    return [np.vstack([np.ones(len(run.u)), np.zeros(len(run.u))]) for run in bench.runs]


def settle(bench: Workbench, values: Mapping[str, float], names: Sequence[str], *, spread: bool = True) -> Fit:
    """Weigh anew with the present model's residuals, then fit it.

    Parameters
    ----------
    spread
        Whether friction and the track's slope may differ from run to run; in parts of one recording they never do.
    """
    bench.forget_random_effects()
    raw = bench.residual(values)
    bench.weigh(raw)
    if spread and not bench.parts:
        friction = [n for n in ("d1", "d2") if n in names]
        c = Coordinates(friction, values)
        # against a relative change of friction
        c.scale = np.array([max(values.get(n, 0.0), 1e-3) for n in friction])
        D = sensitivities(bench, c, c.of(values), values, raw)
        D = np.column_stack([D, bench.pushed(values, [lambda: _ones(bench)], 0.02)])
        bench.set_random_effects(bench.whitened(D), bench.whitened(raw), [FRICTION] * len(friction) + [OFFSET])
    return with_fresh_jacobian(bench, refit(bench, values, names, iterations=6))
