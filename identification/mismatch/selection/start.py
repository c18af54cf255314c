"""Where fits begin: the equation error, which sees far, and the sensitivities of the present simulation, which see near."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from flexdrive_gym.drive.parameters import parameter
from identification.equation_error import start_values
from identification.mismatch.candidates.catalogue import Candidate, look_alikes, null_value
from identification.mismatch.candidates.screen import Screen, TooShortError
from identification.mismatch.fitting.bench import Bench, Values
from identification.mismatch.fitting.fit import Fit
from identification.mismatch.selection.evaluate import Name, Table
from identification.mismatch.selection.linear import Linear
from identification.topology import Topology

Start = tuple[Candidate, dict[str, float]]
# mass of a second cart over the first one's, and stiffness over the mass that it moves [1/s²]: 3 Hz
_MASS, _STIFFNESS = 0.3, 350.0
# its friction over the first one's
_FRICTIONS = (0.1, 0.5)
# shares of dry friction that what it hides starts with: bristles are nearly all of it, static friction may be anything
_TAKEN = (0.9, 0.5, 0.2)
# shapes that a leading candidate is fitted from
_SHAPES = 3


def base_starts(bench: Bench, topology: Topology) -> list[dict[str, float]]:
    """Return starts of the base model: both equation errors, a heavier cart 2, other stiffnesses, and no friction."""
    starts = [{**topology.start, **start_values(bench.recordings, topology)}]
    with suppress(TooShortError):
        starts.insert(0, Screen(bench.recordings, bench.settings, bench.pool).values)
    good = [_positive(s, topology) for s in starts if _sound({k: v for k, v in s.items() if k[0] == "m"})]
    good = good or [_positive(starts[-1], topology)]
    first = good[0]
    if "k" in first:
        good += [{**first, "k": f * first["k"]} for f in (0.5, 2.0)]
    if "m2" in first and "m2" in topology.free:
        good.append({**first, "m2": 1.5 * first["m2"], "k": 1.3 * first["k"]})
    good.append({**first, **{k: 0.3 * v for k, v in first.items() if k[0] == "d"}})
    return [{**s, **topology.fixed} for s in good]


def candidate_starts(
    base: Fit, linear: Linear, table: Table, candidates: Sequence[Candidate], order: Sequence[Name], most: int
) -> list[Start]:
    """Return the leading candidates around the simulation with their sizes, their look-alikes, and what a cart at rest hides.

    Parameters
    ----------
    order
        Names, the most promising first.
    most
        So many lead.
    """
    damping, asked = linear.bench.settings.damping, {c.name for c in candidates}
    residual = linear.residual[:, None]
    g, square = linear.gradient(residual)[..., 0], linear.square(residual)[:, 0]

    def start(candidate: Candidate, columns: Sequence[int]) -> Start:
        if candidate.absolute:
            # half of a limit is no half of what it does
            return candidate, {**base.values, **candidate.start}
        sizes = linear.normal(g, square, columns).solve(damping)[len(linear.base) :]
        own = {}
        for (key, usual), size in zip(candidate.sizes, sizes, strict=True):
            q = parameter(key)
            least = 0.1 * usual
            # a size of the wrong sign cannot be fitted from null, where there is no slope to see
            own[key] = float(np.clip(size, q.lower, q.upper)) if abs(size) > abs(least) and size > q.lower else least
        return candidate, candidate.beside(base.values, {**candidate.start, **own})

    found: dict[Name, list[Start]] = {}
    for name in (n for n in order if n in asked):
        shapes: dict[object, Start] = {}
        for _, entry in sorted(table.entries[name], key=lambda item: -item[0]):
            if isinstance(entry.candidate, Candidate) and len(shapes) < _SHAPES:
                # a fit leads to another optimum from another shape
                key = entry.candidate.shapes or entry.candidate.sizes
                shapes.setdefault(key, start(entry.candidate, entry.columns))
        if shapes:
            found[name] = list(shapes.values())
    leading = list(found)[:most]
    alike = [n for n in list(found)[most:] if any(n[0] in look_alikes(i) for i, _ in leading[:3])]
    jobs = [s for n in leading for s in found[n]] + [found[n][0] for n in alike]
    # a mass behind a gap is no small change: to first order its size says nothing
    masses = [c for c in candidates if c.behind_gap and c.name in (*leading, *alike)]
    jobs += [(c, c.beside(base.values, c.start)) for c in masses]
    # what a cart at rest hides has no sensitivity: it is always asked for, with some of the friction that hides it taken over
    hidden = {c.name: c for c in candidates if c.takes and not any(k in base.values for k in c.keys)}
    # a model without that friction is asked for it, too
    absent = {taken for c in hidden.values() for _, taken in c.takes if taken not in base.names}
    jobs += [(c, {**base.values, **c.start}) for c in candidates if any(c.keys == (taken,) for taken in absent)]
    jobs += [job for c in hidden.values() for job in hiding_starts(linear.bench, c, base.values)]
    return jobs


def hiding_starts(bench: Bench, candidate: Candidate, values: Values) -> list[Start]:
    """Return starts of a candidate that a cart at rest hides: it has taken over some of the friction that hides it.

    Parameters
    ----------
    values
        Drive without it.
    """
    usual = replace(candidate, shapes=tuple((k, null_value(k)) for k, _ in candidate.shapes))
    jobs: list[Start] = [(usual, _taking_over(usual, values, share)) for share in _TAKEN]
    bends = compliance(bench, candidate.where)
    if bends > 0.0 and any(parameter(k).unit == "mm" for k, _ in candidate.shapes):
        whole = _taking_over(usual, values, _TAKEN[0])
        level = max(whole[key] for key, _ in candidate.takes)
        found_length = tuple(
            (k, float(np.clip(level * bends, parameter(k).lower, parameter(k).upper))) for k, _ in usual.shapes
        )
        seen = replace(candidate, shapes=found_length)
        jobs.append((seen, _taking_over(seen, values, _TAKEN[0])))
    return jobs


def compliance(bench: Bench, where: str) -> float:
    """Return how far a cart moves per unit of the command where it does not break away [mm/V]; 0 where no recording shows it."""
    cart = int(where[-1]) - 1
    ratios = [
        float(np.ptp(run.track[cart]) / np.ptp(run.u))
        for run in bench.runs
        if run.positions and cart < len(run.track) and np.ptp(run.u) > 0.0
    ]
    return float(np.median(ratios)) if ratios else 0.0


def far_starts(bench: Bench, base: Fit, known: Values, candidates: Sequence[Candidate]) -> list[Start]:
    """Return the candidates that the equation error proposes, with the model's and their own parameters as it sees them."""
    asked = [c for c in candidates if not any(k in base.values for k, _ in c.sizes)]
    found: list[Start] = []
    for resting in (False, True):
        try:
            screen = Screen(bench.recordings, bench.settings, bench.pool, known, resting=resting)
        except TooShortError:
            break
        seen: set[Name] = set()
        for p in screen.propose(asked):
            if (
                p.candidate.name not in seen
                and p.gain > 0.0
                and _sound(p.start)
                and len(seen) < bench.settings.proposals // 2
            ):
                seen.add(p.candidate.name)
                # the equation error has all of the handout's parameters, the model perhaps not
                own = {k: v for k, v in p.start.items() if k in base.names or k in p.candidate.keys}
                found.append((p.candidate, own))
    return found


def misread_starts(values: Values, candidates: Sequence[Candidate], topology: Topology) -> list[Start]:
    """Return what may be wrong with a reading, beside a second cart as usual: what is fitted to wrong readings is no start."""
    found = {c.name: c for c in candidates if c.where.startswith("encoder") and not any(k in values for k in c.keys)}
    mass = values["m1"]
    starts = []
    for share in _FRICTIONS:
        usual = {"m2": _MASS * mass, "k": _STIFFNESS * _MASS * mass}
        usual |= {f"{n}2": share * values[f"{n}1"] for n in "bd" if f"{n}1" in values}
        second = {n: v for n, v in usual.items() if n in topology.free}
        starts += [(c, {**second, **c.start}) for c in found.values()]
    return starts


def _positive(values: Values, topology: Topology) -> dict[str, float]:
    mass = max([v for n, v in values.items() if n[0] == "m" and 0.0 < v < 1e6] or [1e-3])
    small = {"m": _MASS * mass, "k": _STIFFNESS * mass, "b": mass, "d": 0.0}
    names = [n for n in topology.free if n not in topology.fixed]
    return {n: v if (v := values.get(n, 0.0)) > 0.0 else small.get(n[0], parameter(n).null) for n in names}


def _taking_over(candidate: Candidate, values: Values, share: float) -> dict[str, float]:
    """Return a start in which a candidate has taken over a share of the base parameter that would hide it."""
    start = {**values, **candidate.start}
    for key, taken in candidate.takes:
        level = values.get(taken, 0.0)
        start |= {key: max(share * level, candidate.start[key]), taken: (1.0 - share) * level}
    return start


def _sound(values: Mapping[str, float]) -> bool:
    return all(np.isfinite(v) for v in values.values())
