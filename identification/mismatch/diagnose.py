"""Locate, name, model, prove: from recordings to a diagnosis."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import f as snedecor
from scipy.stats import t as student

from flexdrive_gym import Covariance, Drive, Provenance, __version__
from flexdrive_gym.drive.effects import LAYOUT
from flexdrive_gym.recording import FloatArray, Recording
from identification.likelihood import MaximumLikelihood, identify_by_likelihood
from identification.methods import rig_parameters
from identification.mismatch.lines import strongest_line
from identification.mismatch.maps import Map, draw_maps, harmonics
from identification.mismatch.missing_force import MissingForce, missing_force
from identification.mismatch.prove import gain_on, loop_fits, place, polished, total, velocity_fits
from identification.mismatch.refit import Coordinates, sensitivities
from identification.mismatch.rounds import LEVEL, Progress
from identification.mismatch.search import Search, Step, search
from identification.mismatch.shapes import Shape, likeness
from identification.mismatch.spatial import periods
from identification.mismatch.split import Split, split_recordings
from identification.mismatch.verdict import (
    Diagnosis,
    Estimate,
    Finding,
    Located,
    Named,
    Unnamed,
    Verdict,
    experiment_for,
    short,
    statement,
    unit_of,
)
from identification.mismatch.workbench import Workbench
from identification.output_error import prepare
from identification.quantities import HANDOUT_RATIOS
from identification.recordings import read_recordings
from identification.topology import Topology, topology_of

# a free shape must explain this share of the remaining error, and this much more than any name, to be called unnamed
_SHAPE_GAIN, _SHAPE_LEAD = 0.045, 1.6
# and a line in the spectrum this share
_LINE_SHARE = 0.05
# a fit this near to the floor leaves nothing to explain
_NEAR_FLOOR = 1.25
# a finding must cut the comparable squared error by this share where it was learnt, and by this one in recordings kept away
_LEARNT, _PROVEN = 0.01, 0.004
# and must not raise their plain rms, rough track and all, by more than this factor
_WORSE = 1.005
# a velocity that goes less far below zero than this, against its largest, never does
_NEGATIVE = 0.05
# a logarithm this uncertain says nothing, and its exponential is still a number
_UNKNOWN = 300.0
# cut-offs of a velocity filter, in multiples of the sampling rate
_FILTERS = (0.03, 0.08, 0.2)


def diagnose(
    recordings: str | Path | Sequence[str | Path] | Sequence[Recording],
    *,
    seed: int = 0,
    jobs: int | None = None,
    topology: Topology | None = None,
    say: Progress = lambda _: None,
) -> Diagnosis:
    """Locate the mismatch between drive and recordings, name the physics that was left out, model it and prove it.

    Parameters
    ----------
    recordings
        Folder, files, or recordings already read, of one drive.
    seed
        Of the null draws and resampling; the same seed gives the same diagnosis to the last bit.
    jobs
        Threads; default: the processors this process may use. The answer does not depend on it.
    topology
        Which bodies there are and what is free; default: one cart or two, as the recordings' channels tell.
    say
        Called with a few words at every stage.

    Returns
    -------
    Diagnosis

    Raises
    ------
    ValueError
        If the recordings cannot tell anything; the message says what to record.
    """
    begin = time.perf_counter()
    say("reading recordings")
    runs = _read(recordings)
    split = split_recordings(runs)
    with ThreadPoolExecutor(jobs or len(os.sched_getaffinity(0))) as pool:
        return _Diagnosing(
            runs, split, topology or topology_of(split.learn), np.random.default_rng(seed), pool, say, jobs
        ).result(begin)


def _read(recordings: Any) -> list[Recording]:
    if isinstance(recordings, str | Path):
        return list(read_recordings(recordings))
    items = list(recordings)
    if items and all(isinstance(r, Recording) for r in items):
        return items
    return list(read_recordings(items))


@dataclass(frozen=True, eq=False)
class _Proof:
    """A finding, and the drive refitted without it against the drive with all.

    Attributes
    ----------
    before, after
        Rms on recordings kept away [mm/s].
    share
        Of the squared error of recordings learnt from that it removes.
    learnt, kept
        Share of the comparable squared error that it removes, in recordings learnt from and kept away.
    """

    step: Step
    before: float
    after: float
    share: float
    learnt: float
    kept: float

    @property
    def holds(self) -> bool:
        """Whether the finding stands."""
        return self.learnt > _LEARNT and self.kept > _PROVEN and self.after < _WORSE * self.before


class _Diagnosing:
    """One diagnosis on its way."""

    def __init__(
        self,
        runs: Sequence[Recording],
        split: Split,
        topology: Topology,
        rng: np.random.Generator,
        pool: Executor,
        say: Progress,
        jobs: int | None,
    ) -> None:
        self.runs, self.split, self.rng, self.pool, self.say = runs, split, rng, pool, say
        self.topology, self.names = topology, topology.free
        say("fitting the free drive")
        self.tied: MaximumLikelihood | None = None
        self.free = identify_by_likelihood(split.learn, threads=jobs, topology=topology)
        if topology.two_carts:
            say("fitting with the handout's ratios")
            self.tied = identify_by_likelihood(split.learn, ties=HANDOUT_RATIOS, threads=jobs, topology=topology)
        self.bench = Workbench([prepare(r) for r in split.learn], pool, parts=split.parts)
        self.starts = self.without_sign(jobs)
        self.friction_spread = 0.0
        self.level = float(np.median([np.max(np.abs(r.u)) for r in split.learn]))

    def without_sign(self, jobs: int | None) -> dict[tuple[str, str], Mapping[str, float]]:
        """Return the free drive seen through a sensor that loses the sign, where a velocity never goes below zero."""
        found: dict[tuple[str, str], Mapping[str, float]] = {}
        for cart in (1, 2):
            where = f"encoder_{cart}"
            if not self.topology.offers(where) or not _never_negative(self.split.learn, f"v{cart}"):
                continue
            fixed = {f"rectified_sensor.{where}.share": 1.0}
            fit = identify_by_likelihood(self.split.learn, fixed=fixed, threads=jobs, topology=self.topology)
            found["rectified_sensor", where] = fit.drive.values
        return found

    def forces(self, values: Mapping[str, float], runs: Sequence[Recording]) -> list[MissingForce]:
        return list(self.pool.map(lambda r: missing_force(values, r), runs))

    def shapes(self, values: Mapping[str, float]) -> dict[str, tuple[float, ...]]:
        most = max(float(np.max(np.abs(r.u))) for r in self.split.learn)
        return {
            **periods(self.forces(values, self.split.learn)),
            "saturation.limit": (0.97 * most, 0.88 * most, 0.75 * most),
            **self.filters(),
        }

    def filters(self) -> dict[str, tuple[float, ...]]:
        """Return where to look for a velocity filter, if the recordings do not tell how velocities were made [Hz]."""
        if any(run.cutoff is not None for run in self.bench.runs):
            return {}
        rate = 1.0 / self.bench.runs[0].sample_time
        return {f"velocity_processing.encoder_{i}.cutoff": tuple(rate * f for f in _FILTERS) for i in (1, 2)}

    def result(self, begin: float) -> Diagnosis:
        split, say = self.split, self.say
        free = dict(self.free.drive.values)
        say("estimating the missing forces")
        forces = self.forces(free, split.learn)
        maps = draw_maps(forces)
        found = search(
            self.bench,
            free,
            self.topology,
            self.rng,
            drive_level=self.level,
            shapes=self.shapes,
            starts=self.starts,
            say=say,
        )
        # the proofs fit drives without any such freedom
        self.friction_spread = self.bench.spread.get("friction", 0.0)
        shape, alike, overrules = self.unnamed(found)
        say("proving on recordings kept away")
        proofs, before_values, after_values, drive = self.certain(found, () if overrules else found.steps)
        fits = velocity_fits(before_values, after_values, split.learn, self.runs, self.pool, held_out=False)
        fits += velocity_fits(before_values, after_values, split.prove, self.runs, self.pool, held_out=True)
        before, after = Drive(before_values, name="free fit"), Drive(after_values, name="diagnosed drive")
        fits += loop_fits(before, after, split.loops)
        proof = total(fits, held_out=True) if split.prove else total(fits)
        findings = self.findings(proofs, drive)
        unnamed = self.rhythm(found) if shape is None else self.describe(shape, alike)
        return Diagnosis(
            verdict=_verdict(findings, unnamed, proof),
            faults=tuple(f for r in self.runs for f in r.faults),
            located=located(maps),
            findings=findings,
            unnamed=unnamed,
            handout_tied_rms=self.tied.rms if self.tied else float("nan"),
            free_rms=self.free.rms,
            ratios=self.free.ratios,
            before_rms=proof[0],
            after_rms=proof[1],
            floor_rms=proof[2],
            per_recording=tuple(fits),
            predictions=(),
            drive=drive,
            free=before,
            seconds=time.perf_counter() - begin,
            split=split,
            notes=self.notes(),
            maps=tuple(maps),
            harmonics=tuple(harmonics(forces, split.learn)),
            forces=tuple(forces),
            remaining=tuple(draw_maps(self.forces(after_values, split.learn))),
            friction_spread=self.friction_spread,
            extra={
                "rivals": _rivals([p.step for p in proofs]),
                "order": {"@".join(p.step.rival.name): (_keys(p.step), _held(p.step)) for p in proofs},
            },
            learnt=after,
        )

    def unnamed(self, found: Search) -> tuple[Shape | None, list[tuple[str, float]], bool]:
        """Return the free shape that no name fits, if there is one; the names nearest to it; whether it overrules all names.

        A shape that goes far beyond everything that was named together says that the names were only the nearest ones.
        """
        first, last = found.stages[0], found.last
        named = 1.0 - float(np.prod([1.0 - s.rival.gain for s in found.steps]))
        rounds = [(found.last_shapes, last, 0.0, False)]
        if found.steps:
            rounds.insert(0, (found.first_shapes, first, named, True))
        for shapes, stage, so_far, overrules in rounds:
            for shape in shapes:
                if shape.predicted >= max(_SHAPE_GAIN, _SHAPE_LEAD * so_far) and shape.probability <= LEVEL:
                    return shape, likeness(self.bench, shape, stage.screened), overrules
        return None, [], False

    def describe(self, shape: Shape, alike: Sequence[tuple[str, float]]) -> Unnamed:
        return Unnamed(shape.where, shape.predicted, shape.sentence, tuple(alike[:3]))

    def rhythm(self, found: Search) -> Unnamed | None:
        """Return a disturbance with a rhythm of its own, which no property of the drive can make."""
        commands = [r.excitation.frequency for r in self.split.learn]
        line = strongest_line(self.bench, self.bench.residual(found.model.values), commands)
        if line is None or line.share < _LINE_SHARE:
            return None
        acts = f"{line.frequency:.3g} Hz whatever the command: a disturbance from outside"
        return Unnamed(line.where, line.share, acts, ())

    def fitted(self, found: Search, steps: Sequence[Step], start: Mapping[str, float]) -> Mapping[str, float]:
        """Return the drive with these findings, fitted to what was learnt from."""
        names = list(self.names)
        values = {
            **self.topology.fixed,
            **{k: start.get(k, self.free.drive.values.get(k, 0.0)) for k in self.names},
        }
        offsets = np.zeros(len(self.bench.runs))
        for step in steps:
            names += _keys(step)
            values |= {k: start.get(k, found.model.values[k]) for k in (*_keys(step), *_held(step))}
            if step.rival.candidate.period is not None:
                offsets = step.rival.offsets
        kept, self.bench.offsets = self.bench.offsets, offsets
        values = dict(polished(self.bench, values, names))
        self.bench.offsets = kept
        return values

    def certain(
        self, found: Search, steps: Sequence[Step]
    ) -> tuple[list[_Proof], Mapping[str, float], Mapping[str, float], Drive]:
        """Return what :meth:`proven` does of the findings whose sizes differ from none, and the drive of all recordings.

        An effect that is there has much the same size in every recording; one that fits a chance of some has not, and its
        interval, from the spread between recordings, holds its absence.
        """
        while True:
            proofs, free, everything = self.proven(found, steps)
            self.say("fitting all recordings")
            drive = self.final(everything, [p.step for p in proofs])
            steps = [p.step for p in proofs if _differs(p.step, drive)]
            if len(steps) == len(proofs):
                return proofs, free, everything, drive

    def proven(
        self, found: Search, steps: Sequence[Step]
    ) -> tuple[list[_Proof], Mapping[str, float], Mapping[str, float]]:
        """Return those of the findings that hold on recordings kept away, the free drive and the diagnosed one.

        A finding holds if the drive with all findings predicts those recordings better than the drive refitted without it.
        """
        free = self.fitted(found, (), {})
        steps = list(steps)
        while True:
            everything = self.fitted(found, steps, found.model.values) if steps else free
            proofs = []
            for step in steps:
                others = [s for s in steps if s is not step]
                without = self.fitted(found, others, found.model.values) if others else free
                proofs.append(self.proof(step, without, everything))
            failed = [p for p in proofs if not p.holds]
            if not failed:
                return proofs, free, everything
            steps.remove(min(failed, key=lambda p: p.kept).step)

    def proof(self, step: Step, without: Mapping[str, float], everything: Mapping[str, float]) -> _Proof:
        kept = self.split.prove or self.split.learn
        before, after, _ = total(velocity_fits(without, everything, kept, self.runs, self.pool, held_out=True))
        low, high, _ = total(velocity_fits(without, everything, self.split.learn, self.runs, self.pool, held_out=False))
        learnt, proven = (
            gain_on(some, without, everything, self.pool, parts=self.split.parts) for some in (self.split.learn, kept)
        )
        return _Proof(step, before, after, 1.0 - (high / low) ** 2, learnt, proven)

    def final(self, values: Mapping[str, float], steps: Sequence[Step]) -> Drive:
        """Return the drive fitted to all open-loop recordings, with intervals from the spread between recordings."""
        runs = (*self.split.learn, *self.split.prove)
        bench = Workbench([prepare(r) for r in runs], self.pool)
        bench.offsets = place(values, runs, self.pool)
        names = [*self.names, *(k for s in steps for k in _keys(s))]
        values = polished(bench, values, names)
        c = Coordinates(names, values)
        raw = bench.residual(values)
        e = bench.comparable(raw)
        J = bench.comparable(sensitivities(bench, c, c.of(values), values, raw))
        covariance = _between_runs(bench, J, e)
        gain = np.where(c.log, [values[n] for n in names], c.scale)
        quantile = float(student.ppf(0.975, max(len(runs) - 1, 1)))
        spread = quantile * np.sqrt(np.diag(covariance))
        intervals = {
            n: _interval(n, values[n], s, g, log=bool(on))
            for n, s, g, on in zip(names, spread, gain, c.log, strict=True)
        }
        rig = {k: v for k, v in rig_parameters(self.runs).items() if k not in values}
        return Drive(
            {**rig, **values},
            intervals,
            Covariance(tuple(names), covariance * np.outer(gain, gain)),
            Provenance(
                "diagnosis", tuple(r.name for r in runs), __version__, "; ".join(s.rival.name[0] for s in steps)
            ),
            name="diagnosed drive",
        )

    def findings(self, proofs: Sequence[_Proof], drive: Drive) -> tuple[Finding, ...]:
        result = []
        for proof in proofs:
            step = proof.step
            parameters = {
                short(k): Estimate(drive[k], drive.intervals.get(k, (float("nan"), float("nan"))), unit_of(k))
                for k in _keys(step)
            }
            parameters |= {short(k): Estimate(v, (v, v), unit_of(k)) for k, v in _held(step).items()}
            # what is itself a finding is no other explanation
            ties = tuple(Named(*t.name) for t in step.ties if t.name not in {p.step.rival.name for p in proofs})
            id_, where = step.rival.name
            result.append(
                Finding(
                    id_,
                    where,
                    parameters,
                    ties,
                    experiment_for(id_) or None if ties else None,
                    proof.share,
                    step.probability,
                    proof.before,
                    proof.after,
                    "mm/s",
                    statement(id_, where, parameters, proof.share, step.probability, ties),
                )
            )
        return tuple(sorted(result, key=lambda f: -f.share_of_error_explained))

    def notes(self) -> tuple[str, ...]:
        notes = list(self.free.notes)
        if self.friction_spread:
            notes.append(f"friction differs from run to run by about {self.friction_spread:.0%}")
        return tuple(notes)


def _never_negative(recordings: Sequence[Recording], channel: str) -> bool:
    """Whether a recorded velocity never goes below zero, though the command changes its sign."""
    signals = [v for r in recordings if (v := getattr(r, channel)) is not None]
    if not signals or not any(np.min(r.u) < 0.0 < np.max(r.u) for r in recordings):
        return False
    return min(float(np.min(v)) for v in signals) > -_NEGATIVE * max(float(np.max(v)) for v in signals)


def _keys(step: Step) -> tuple[str, ...]:
    """Return the parameters of an effect that were fitted."""
    return tuple(k for k in step.rival.candidate.keys if k in step.rival.fit.names)


def _differs(step: Step, drive: Drive) -> bool:
    """Whether the sizes of an effect together differ from none, by Hotelling's test at 5 % with the recordings as sample."""
    sizes = [k for k, _ in step.rival.candidate.sizes if k in _keys(step) and np.isfinite(LAYOUT[k].parameter.null)]
    if not sizes or drive.covariance is None:
        return True
    names = drive.covariance.names
    i = [names.index(k) for k in sizes]
    away = np.array([drive[k] - LAYOUT[k].parameter.null for k in sizes])
    k, n = len(sizes), len(drive.provenance.recordings)
    if n <= k + 1:
        return True
    distance = float(away @ np.linalg.pinv(drive.covariance.matrix[np.ix_(i, i)], hermitian=True) @ away)
    return distance > k * (n - 1) / (n - k) * float(snedecor.ppf(0.95, k, n - k))


def _held(step: Step) -> dict[str, float]:
    """Return the parameters of an effect that were not fitted, because it is there or it is not."""
    fit = step.rival.fit
    if _keys(step):
        return {}
    return {k: fit.values[k] for k in step.rival.candidate.keys if k in fit.values}


def _rivals(steps: Sequence[Step]) -> dict[str, list[dict[str, Any]]]:
    """Return, per finding, the drives that explain the recordings as well: the finding's own and its ties'."""
    return {
        "@".join(step.rival.name): [
            {"id": r.name[0], "where": r.name[1], "values": dict(r.fit.values)} for r in (step.rival, *step.ties)
        ]
        for step in steps
        if step.ties
    }


def _between_runs(bench: Workbench, J: FloatArray, e: FloatArray) -> FloatArray:
    """Sandwich covariance with the recordings as clusters: what differs from run to run counts once a run."""
    scores = np.array([J[bench.rows.of(r)].T @ e[bench.rows.of(r)] for r in range(len(bench.runs))])
    inverse = np.linalg.pinv(J.T @ J, rcond=1e-12, hermitian=True)
    n = len(scores)
    return np.asarray(inverse @ (scores.T @ scores) @ inverse * (n / max(n - 1, 1)))


def _interval(name: str, value: float, spread: float, gain: float, *, log: bool) -> tuple[float, float]:
    if log:
        return float(value * np.exp(-spread)), float(value * np.exp(min(spread, _UNKNOWN)))
    low, high = value - spread * gain, value + spread * gain
    if name in LAYOUT:
        low, high = max(low, LAYOUT[name].parameter.lower), min(high, LAYOUT[name].parameter.upper)
    return float(low), float(high)


def located(maps: Sequence[Map]) -> tuple[Located, ...]:
    """Return each equation's share of the missing force and the variable it follows most."""
    sizes = {m.where: m.size**2 for m in maps}
    everything = sum(sizes.values())
    found = []
    for where, square in sorted(sizes.items(), key=lambda item: -item[1]):
        best = max((m for m in maps if m.where == where), key=lambda m: m.explained)
        i = int(np.argmax(np.abs(best.mean)))
        acts = f"{best.variable} near {best.centre[i]:.3g}" if best.explained > 0.02 else "nothing that was looked at"
        found.append(Located(where, float(square / everything), acts, best.sentence))
    return tuple(found)


def _verdict(findings: Sequence[Finding], unnamed: Unnamed | None, proof: tuple[float, float, float]) -> Verdict:
    if not findings:
        return "no_mismatch" if unnamed is None else "unexplained"
    near = not np.isfinite(proof[2]) or proof[1] < _NEAR_FLOOR * proof[2]
    return "explained" if unnamed is None and near else "partly_explained"
