"""One round of the search: screen the whole catalogue, refit what leads, judge it against chance."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import isfinite

import numpy as np

from flexdrive_gym.drive.effects import EFFECTS, LAYOUT
from flexdrive_gym.recording import FloatArray
from identification.mismatch.candidates import Candidate, bounds, catalogue, look_alikes
from identification.mismatch.chance import Chance, chance, null_residuals
from identification.mismatch.refit import Fit, refit
from identification.mismatch.screening import Screened, orthonormal, screen
from identification.mismatch.workbench import Columns, View, Workbench
from identification.topology import Topology

Progress = Callable[[str], None]
# effect and place to a drive that has it
Starts = Mapping[tuple[str, str], Mapping[str, float]]
# a finding must be rarer than this by chance, and explain at least this share of the remaining squared error
LEVEL, LEAST_GAIN = 0.02, 0.006
_BATCH = 48
# candidates that are looked at together
_LOOKED_AT = 24
_REFITS = 5
_SECOND_STARTS = 1
# of the greatest surprise among plain residuals: what comes this near is refitted, too
_NEARLY = 0.5
# what explains this share is worth comparing with its look-alikes
_WORTH_A_LOOK = 0.02
# of the surprise that the luckiest tenth of draws reach: what is below it after one refit is not refitted any further
_HOPELESS = 0.4
# shares of a cart's dry friction that may be there at rest only; a hump wide enough for finite differences to see its slope
_AT_REST, _WIDE_MM_S = (0.4, 0.7), 25.0
# waves within the longest way that make a repetition: where all runs share their place, and where each began anywhere
_WAVES, _WAVES_APART = 1.5, 1.0


@dataclass(frozen=True, eq=False)
class Rival:
    """A candidate refitted jointly with the model of its stage.

    Attributes
    ----------
    screened
        Its linear prospects.
    fit
        The joint refit, without its sensitivities.
    offsets
        Where every run began along the track [mm], modulo the period.
    gains
        Share of the stage's squared error that the refit removed, in every view.
    gain
        The same in the view of the stage.
    probability
        False-alarm probability of that gain in a search over the whole catalogue.
    """

    screened: Screened
    fit: Fit
    offsets: FloatArray
    gains: tuple[float, ...]
    gain: float = 0.0
    probability: float = 1.0

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
    view
        In which something stands out most from chance.
    null
        Raw residuals of the null draws, shape (N, draws).
    runs
        Rows of every recording.
    """

    before: Fit
    rivals: tuple[Rival, ...]
    screened: tuple[Screened, ...]
    view: View
    null: Columns = field(repr=False)
    runs: tuple[slice, ...] = field(repr=False)

    def behind(self, rival: Rival, best: Rival, draws: int = 999) -> float:
        """Return the probability that a rival is as good as another one, by their costs in the same recordings, resampled."""
        cost = [[float(np.sum(r.fit.seen(self.view)[rows] ** 2)) for rows in self.runs] for r in (rival, best)]
        worse = np.array(cost[0]) - np.array(cost[1])
        pick = np.random.default_rng(draws).integers(0, len(worse), (draws, len(worse)))
        return float(np.mean(worse[pick].sum(axis=1) <= 0.0))


def directions(
    bench: Workbench, candidates: Sequence[Candidate], values: Mapping[str, float], raw: FloatArray
) -> list[Columns]:
    """Return, per candidate, the change of the raw residual as each size goes from null to its start, shape (N, sizes)."""
    jobs = [(i, drive) for i, candidate in enumerate(candidates) for drive in candidate.directions(values)]
    columns: list[list[Columns]] = [[] for _ in candidates]
    for begin in range(0, len(jobs), _BATCH):
        part = jobs[begin : begin + _BATCH]
        found = (bench.residuals([drive for _, drive in part]) - raw[:, None]).astype(np.float32)
        for (i, _), column in zip(part, found.T, strict=True):
            columns[i].append(column)
    return [np.column_stack(c) for c in columns]


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
    columns = directions(bench, candidates, model.values, raw)
    views = {view: screened_in(bench, view, model, candidates, columns) for view in bench.views}
    del columns
    null = null_residuals(bench, model.values, rng)
    luck = chance(bench, views, null, model)
    screened = views["comparable"]
    leaders = best_of_each(screened)
    prospects = _prospects(views)
    chosen = _to_refit(views, leaders, luck)
    chosen += [s for s in screened if s.candidate.name in starts and not any(s is c for c in chosen)]

    def refitted(s: Screened) -> Rival:
        say(f"refitting with {s.candidate.id} ({s.candidate.where})")
        name = s.candidate.name

        def hopeless(gains: Sequence[float]) -> bool:
            return max(luck.surprise(name, np.maximum(gains, prospects[name]))) < _HOPELESS * luck.lucky

        return _rival(bench.alone(), model, s, raw, hopeless, starts.get(name))

    tried = list(bench.pool.map(refitted, chosen))
    first = max(tried, key=lambda r: max(r.gains), default=None)
    if first is not None and max(first.gains) > _WORTH_A_LOOK:
        tried += bench.pool.map(lambda s, first=first: _beside(bench.alone(), model, s, first), _alike(first, leaders))
    best: dict[tuple[str, str], Rival] = {}
    for r in (r for r in tried if _repeats(bench, r)):
        if r.name not in best or max(r.gains) > max(best[r.name].gains):
            best[r.name] = r
    seen = {n: np.maximum(r.gains, prospects[n]) for n, r in best.items()}
    odds = {n: luck.surprise(n, gains) for n, gains in seen.items()}
    where = int(np.argmax(np.max(list(odds.values()), axis=0))) if odds else 0
    judged = [replace(r, gain=r.gains[where], probability=luck.probability(n, seen[n])) for n, r in best.items()]
    order = sorted(judged, key=lambda r: (not passes(r), -r.gain))
    runs = tuple(bench.rows.of(i) for i in range(len(bench.runs)))
    return Stage(model, tuple(order), tuple(leaders), bench.views[where], null, runs)


def screened_in(
    bench: Workbench, view: View, model: Fit, candidates: Sequence[Candidate], columns: Sequence[Columns]
) -> list[Screened]:
    """Screen every candidate in one view; ``columns`` as from :func:`directions`."""
    present = orthonormal(bench.seen(view, model.sensitivity))
    e = model.seen(view)
    e = e - present @ (present.T @ e)

    def some(part: Sequence[tuple[Candidate, Columns]]) -> list[Screened]:
        # one look at many columns costs hardly more than at one
        together = alone.seen(view, np.column_stack([c for _, c in part]).astype(np.float64))
        ends = np.cumsum([c.shape[1] for _, c in part])
        own = np.split(together, ends[:-1], axis=1)
        return [screen(alone, candidate, c, e, present) for (candidate, _), c in zip(part, own, strict=True)]

    alone, pairs = bench.alone(), list(zip(candidates, columns, strict=True))
    parts = [pairs[i : i + _LOOKED_AT] for i in range(0, len(pairs), _LOOKED_AT)]
    return [s for found in bench.pool.map(some, parts) for s in found]


def _prospects(views: Mapping[View, Sequence[Screened]]) -> dict[tuple[str, str], FloatArray]:
    """Return the linear gain of every effect and place in every view."""
    found: dict[tuple[str, str], FloatArray] = {}
    for i, entries in enumerate(views.values()):
        for s in entries:
            gains = found.setdefault(s.candidate.name, np.zeros(len(views)))
            gains[i] = max(gains[i], s.gain)
    return found


def _repeats(bench: Workbench, rival: Rival) -> bool:
    """Whether the way holds enough waves of an effect to call it repeating; any smooth force is a piece of a long wave.

    Friction along the track need not repeat to be that: its slope is a part of the effect.
    """
    c = rival.candidate
    if c.period is None or any(key.endswith(".slope") for key in c.keys):
        return True
    if bench.parts:
        track = np.concatenate([run.track for run in bench.runs], axis=1)
        return _WAVES * rival.fit.values[c.period] <= float(np.max(np.ptp(track, axis=1)))
    way = max(float(np.max(np.ptp(run.track, axis=1))) for run in bench.runs)
    return _WAVES_APART * rival.fit.values[c.period] <= way


def passes(rival: Rival) -> bool:
    """Whether chance would hardly reach a rival, and it is worth naming."""
    return rival.probability <= LEVEL and rival.gain >= LEAST_GAIN


def _to_refit(views: Mapping[View, Sequence[Screened]], leaders: Sequence[Screened], luck: Chance) -> list[Screened]:
    """The leaders in gain and in surprise, other starts for the first of them, and what is known to look like them."""
    screened = views["comparable"]
    chosen = list(leaders[:_REFITS])
    prospects = _prospects(views)
    for i, entries in enumerate(views.values()):
        best = best_of_each(entries)
        surprise = {s.candidate.name: luck.surprise(s.candidate.name, prospects[s.candidate.name])[i] for s in best}
        first = sorted(best, key=lambda s: -surprise[s.candidate.name])
        if i == 0:
            surprising = first
        # forces that all runs share resemble one another
        near = [s for s in first if surprise[s.candidate.name] > _NEARLY * max(1.0, surprise[first[0].candidate.name])]
        names = {c.candidate.name for c in chosen}
        chosen += [s for s in (first[:3] if i == 0 else near[:_REFITS]) if s.candidate.name not in names]
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
    bench: Workbench,
    model: Fit,
    s: Screened,
    raw: FloatArray,
    hopeless: Callable[[Sequence[float]], bool],
    known: Mapping[str, float] | None = None,
) -> Rival:
    """Refit a candidate; what is hopeless after its first fit is not worth another."""
    c = s.candidate
    if known is not None:
        # its own parameters stay as given: a sensor loses the sign or it does not
        fit = refit(bench, {**model.values, **known}, model.names, iterations=12)
        return Rival(s, fit.bare(), bench.offsets, tuple(fit.beside(model, view) for view in bench.views))
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
    fit = refit(bench, start, (*model.names, *keys), iterations=6, fresh=keys, known=model)
    if hopeless(_gains(bench, model, fit)):
        offsets, bench.offsets = bench.offsets, here
        return Rival(s, fit.bare(), offsets, _gains(bench, model, fit))
    if fit.weighted > model.weighted:
        # what is best among comparable residuals may lie beyond a ridge: begin beside the present model
        start.update({key: LAYOUT[key].parameter.null + 0.1 * size for key, size in c.sizes if isfinite(size)})
        fit = refit(bench, start, (*model.names, *keys), iterations=6, fresh=keys, known=model)
    fit = min((fit, *_moved_over(bench, c, model)), key=lambda f: f.weighted)
    if bench.unplaced(c.period):
        keys = _align(bench, model, c, dict(fit.values), raw)
        again = refit(bench, fit.values, (*model.names, *keys), iterations=3, fresh=keys, known=model)
        fit = min(fit, again, key=lambda f: f.cost)
    fit = _in_both_views(bench, model, fit, start, keys)
    offsets, bench.offsets = bench.offsets, here
    return Rival(s, fit.bare(), offsets, _gains(bench, model, fit))


def _moved_over(bench: Workbench, c: Candidate, model: Fit) -> list[Fit]:
    """Refit what holds a cart at rest from drives that hold it as the model does, but with less friction in motion.

    A fit without it takes it for dry friction; from there stick-slip makes the error a rough function.
    """
    extra, dry, speed = f"{c.id}.{c.where}.extra", f"d{c.where[-1]}", f"{c.id}.{c.where}.vs"
    level = model.values.get(dry, 0.0)
    if extra not in c.keys or not level > 0.0:
        return []
    low, high = bounds(extra)
    some, much = _AT_REST
    others = [(dict(c.shapes), some), ({speed: _WIDE_MM_S}, some)] if speed in c.keys else [({}, some), ({}, much)]
    starts = [
        {**model.values, **shape, dry: (1.0 - part) * level, extra: float(np.clip(part * level, low, high))}
        for shape, part in others
    ]
    return [refit(bench, start, (*model.names, *c.keys)) for start in starts]


def _alike(first: Rival, leaders: Sequence[Screened]) -> list[Screened]:
    """Return what is known to look like a rival; what repeats along the track, and what acts on the other cart, does not."""
    if first.candidate.period is not None:
        return []
    where, looks = first.candidate.where, look_alikes(first.candidate.id)
    other = {"cart_1": "cart_2", "cart_2": "cart_1"}.get(where)
    near = [s for s in leaders if s.candidate.id in looks and s.candidate.where != other]
    return [s for s in near if s.candidate.period is None]


def _beside(bench: Workbench, model: Fit, s: Screened, first: Rival) -> Rival:
    """Refit a candidate from where another one ended: beyond a ridge that its own start may not cross.

    It begins with the other's drive, and with its sizes where a parameter has the same name.
    """
    others = {k.rpartition(".")[2]: first.fit.values[k] for k in first.candidate.keys}
    start = {k: v for k, v in first.fit.values.items() if k in model.values}
    start |= dict(s.candidate.shapes)
    for key, size in s.candidate.sizes:
        low, high = bounds(key)
        start[key] = float(np.clip(others.get(key.rpartition(".")[2], size), low, high))
    keys = s.candidate.keys
    fit = refit(bench, start, (*model.names, *keys), iterations=6, fresh=keys, known=model)
    fit = min((fit, *_moved_over(bench, s.candidate, model)), key=lambda f: f.weighted)
    fit = _in_both_views(bench, model, fit, start, keys)
    return Rival(s, fit.bare(), bench.offsets, _gains(bench, model, fit))


def _gains(bench: Workbench, model: Fit, fit: Fit) -> tuple[float, ...]:
    return tuple(max(fit.beside(model, view), 0.0) for view in bench.views)


def _in_both_views(bench: Workbench, model: Fit, plain: Fit, start: Mapping[str, float], keys: Sequence[str]) -> Fit:
    """Refit where residuals are compared, too, from the plain fit or from the start; each view keeps its own best."""
    if len(bench.views) == 1:
        return plain
    names = (*model.names, *keys)
    begins = [plain.values] if plain.cost < model.cost else [start, plain.values]
    tried = [refit(bench, b, names, iterations=4, fresh=keys, known=model, view="comparable") for b in begins]
    sharp = min(tried, key=lambda f: f.cost)
    if sharp.cost >= plain.cost:
        return plain
    return replace(sharp, weighted=plain.weighted, minimised=plain.minimised)


def _align(bench: Workbench, model: Fit, c: Candidate, start: dict[str, float], raw: FloatArray) -> tuple[str, ...]:
    """Find where every run began along the track from its own amplitudes; leave one amplitude in ``start``."""
    sin, cos = (next(k for k, _ in c.sizes if k.endswith(end)) for end in ("a_sin", "a_cos"))
    shape = tuple((k, start[k]) for k, _ in c.shapes)
    step = dict(c.sizes)[sin]
    probe = Candidate(c.id, c.where, ((sin, step), (cos, step)), shape)
    columns = bench.comparable(directions(bench, [probe], model.values, raw)[0].astype(np.float64))
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
