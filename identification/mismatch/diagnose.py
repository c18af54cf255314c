"""Locate, name, model, prove: from recordings to a diagnosis."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from flexdrive_gym import DEFAULT_DRIVE, Drive
from flexdrive_gym.recording import Recording
from identification.likelihood import MaximumLikelihood, identify_by_likelihood
from identification.mismatch.chance import null_residuals
from identification.mismatch.crew import Crew
from identification.mismatch.maps import Map, draw_maps, harmonics
from identification.mismatch.missing_force import MissingForce, missing_force
from identification.mismatch.proof import Proof
from identification.mismatch.prove import loop_fits, own_rms, total, velocity_fits
from identification.mismatch.proving import Proving, held_of, keys_of
from identification.mismatch.rounds import Progress
from identification.mismatch.search import Search, Step, search
from identification.mismatch.settle import settle
from identification.mismatch.spatial import periods
from identification.mismatch.split import Split, split_recordings
from identification.mismatch.unnamed import describe, left_unnamed
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
from identification.quantities import HANDOUT_RATIOS
from identification.recordings import RecordingSet, Rig
from identification.recordings.given import Source, given
from identification.replay.output_error import Run, prepare, simulate_run
from identification.selection import select
from identification.topology import Topology, topology_of

# a fit this near to the floor leaves nothing to explain
_NEAR_FLOOR = 1.25
# times as far as recordings went, a spring is looked at
_FARTHER = 10.0
# a velocity that goes less far below zero than this, against its largest, never does
_NEGATIVE = 0.05
# cut-offs of a velocity filter, in multiples of the sampling rate
_FILTERS = (0.03, 0.08, 0.2)


def diagnose(
    recordings: Source,
    *,
    seed: int = 0,
    jobs: int | None = None,
    topology: Topology | None = None,
    rig: Rig | str | Path | None = None,
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
        Threads; default: one more than the processors this process may use, because now and then one waits for the interpreter's
        lock. The answer does not depend on it.
    topology
        Which bodies there are and what is free; default: one cart or two, as the recordings' channels tell.
    rig
        Rig description, or its file, to read recordings with; those already read bring theirs.
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
    selection = select(given(recordings, rig))
    runs = selection.require()
    split = split_recordings(runs)
    # its own threads keep the processors busy: those of the linear algebra would only be in their way
    with threadpool_limits(1, user_api="blas"), Crew(jobs or len(os.sched_getaffinity(0)) + 1) as pool:
        bodies = topology or topology_of(RecordingSet(split.learn, rig=runs.rig))
        found = _Diagnosing(runs, split, bodies, np.random.default_rng(seed), pool, say, jobs).result(begin)
    # what was left out has faults, too
    faults = tuple(f for r, _ in selection.left_out for f in r.faults)
    return replace(found, faults=(*found.faults, *faults), notes=(*selection.notes, *found.notes))


class _Diagnosing:
    """One diagnosis on its way."""

    def __init__(
        self,
        runs: Sequence[Recording],
        split: Split,
        topology: Topology,
        rng: np.random.Generator,
        pool: Crew,
        say: Progress,
        jobs: int | None,
    ) -> None:
        self.runs, self.split, self.rng, self.pool, self.say = runs, split, rng, pool, say
        self.topology, self.names = topology, topology.free
        say("fitting the free drive")
        self.tied: MaximumLikelihood | None = None
        self.free = self._identified(jobs)
        if topology.two_carts:
            say("fitting with the handout's ratios")
            self.tied = self._identified(jobs, ties=HANDOUT_RATIOS)
        self.bench = Workbench([prepare(r) for r in split.learn], pool, parts=split.parts)
        self.starts = self.without_sign(jobs)
        self.friction_spread = 0.0
        self.level = float(np.median([np.max(np.abs(r.u)) for r in split.learn]))

    def _identified(self, jobs: int | None, **options: Any) -> MaximumLikelihood:
        return identify_by_likelihood(self.split.learn, threads=jobs, topology=self.topology, **options)

    def without_sign(self, jobs: int | None) -> dict[tuple[str, str], Mapping[str, float]]:
        """Return the free drive seen through a sensor that loses the sign, where a velocity never goes below zero.

        From speeds alone the equations of motion tell a wrong drive to begin with; one with the handout's ratios is found from
        farther away, and the lab's own rig is one more place to begin.
        """
        found: dict[tuple[str, str], Mapping[str, float]] = {}
        for cart in (1, 2):
            where = f"encoder_{cart}"
            if not self.topology.offers(where) or not _never_negative(self.split.learn, f"v{cart}"):
                continue
            fixed, start = {f"rectified_sensor.{where}.share": 1.0}, None
            if self.topology.two_carts:
                usual = {n: DEFAULT_DRIVE[n] for n in self.names}
                start = self._identified(jobs, fixed=fixed, ties=HANDOUT_RATIOS, start=usual).drive.values
            found["rectified_sensor", where] = self._identified(jobs, fixed=fixed, start=start).drive.values
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
        proving = Proving(self.runs, split, self.topology, free, self.bench, self.pool, say)
        found = search(
            self.bench,
            free,
            self.topology,
            self.rng,
            drive_level=self.level,
            shapes=self.shapes,
            starts=self.starts,
            stands=proving.stands,
            say=say,
        )
        # the proofs fit drives without any such freedom
        self.friction_spread = self.bench.spread.get("friction", 0.0)
        left, overruled = left_unnamed(found)
        say("proving on recordings kept away")
        steps = [s for s in found.steps if s not in overruled]
        proofs, before_values, after_values, drive = proving.certain(found, steps)
        fits = velocity_fits(before_values, after_values, split.learn, self.runs, self.pool, held_out=False)
        fits += velocity_fits(before_values, after_values, split.prove, self.runs, self.pool, held_out=True)
        before, after = Drive(before_values, name="free fit"), Drive(after_values, name="diagnosed drive")
        fits += loop_fits(before, after, split.loops)
        units = self.runs[0].units
        speed = units.one("mm/s")
        rms, rms_after, floor = total(fits, held_out=True) if split.prove else total(fits)
        proof = (rms / speed, rms_after / speed, floor / speed)
        own = None
        if self.friction_spread and proofs:
            kept = split.prove or split.learn
            both = own_rms(before_values, after_values, kept, self.pool, self.friction_spread)
            own = (both[0] / speed, both[1] / speed)
        findings = self.findings(proofs, drive)
        if steps and not proofs:
            # what is left is then what there was before any name
            found = self.nothing_named(found)
            left, _ = left_unnamed(found)
        commands = [r.excitation.frequency for r in split.learn]
        refused, kept_away = ((), None) if proofs else (proving.refused, proving.kept_away)
        unnamed = describe(self.bench, found, left, commands, refused, kept_away, units)
        left_out = draw_maps(self.forces(after_values, split.learn))
        maps = [m.of_rig(units) for m in maps]
        return Diagnosis(
            verdict=_verdict(findings, unnamed, proof),
            faults=tuple(f for r in self.runs for f in r.in_rig_units().faults),
            located=located(maps),
            findings=findings,
            unnamed=unnamed,
            handout_tied_rms=self.tied.rms / speed if self.tied else float("nan"),
            free_rms=self.free.rms / speed,
            ratios=self.free.ratios,
            before_rms=proof[0],
            after_rms=proof[1],
            floor_rms=proof[2],
            per_recording=tuple(f.of_rig(units) for f in fits),
            predictions=(),
            drive=drive.replace(units=units),
            free=before.replace(units=units),
            unit=units.name("mm/s"),
            seconds=time.perf_counter() - begin,
            split=split,
            notes=self.notes(drive),
            maps=tuple(maps),
            harmonics=tuple(harmonics(forces, split.learn)),
            forces=tuple(f.of_rig(units) for f in forces),
            remaining=tuple(m.of_rig(units) for m in left_out),
            friction_spread=self.friction_spread,
            extra={
                "rivals": _rivals(findings, [p.step for p in proofs]),
                "order": {"@".join(p.step.rival.name): (keys_of(p.step), held_of(p.step)) for p in proofs},
            },
            learnt=after.replace(units=units),
            tied=self.tied.drive if self.tied else None,
            own_rms=own,
        )

    def nothing_named(self, found: Search) -> Search:
        """Return a search as if it had found nothing, with the bench around the free drive."""
        model = settle(self.bench, dict(self.free.drive.values), self.names)
        last = replace(found.stages[0], before=model, null=null_residuals(self.bench, model.values, self.rng))
        return replace(found, steps=(), model=model, stages=(last,), last_shapes=found.first_shapes)

    def findings(self, proofs: Sequence[Proof], drive: Drive) -> tuple[Finding, ...]:
        result = []
        units = self.runs[0].units
        speed = units.one("mm/s")
        for proof in proofs:
            step = proof.step
            parameters = {
                short(k): Estimate(drive[k], drive.intervals.get(k, (float("nan"), float("nan"))), unit_of(k))
                for k in keys_of(step)
            }
            parameters |= {short(k): Estimate(v, (v, v), unit_of(k)) for k, v in held_of(step).items()}
            parameters = {name: estimate.of_rig(units) for name, estimate in parameters.items()}
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
                    proof.probability,
                    proof.before / speed,
                    proof.after / speed,
                    units.name("mm/s"),
                    statement(id_, where, parameters, proof.share, proof.probability, ties),
                )
            )
        return tuple(sorted(result, key=lambda f: -f.share_of_error_explained))

    def notes(self, drive: Drive) -> tuple[str, ...]:
        notes = list(self.free.notes)
        if self.friction_spread:
            notes.append(f"friction differs from run to run by about {self.friction_spread:.0%}")
        return (*notes, *spring_notes(drive.replace(units=self.runs[0].units), self.bench.runs))


def spring_notes(drive: Drive, runs: Sequence[Run]) -> tuple[str, ...]:
    """Say beyond which deflection a spring's force falls again, as a power of it does somewhere, and how far recordings went."""
    reached = 0.0
    for run in runs:
        moved = simulate_run(drive.values, run)
        between = moved[0] - moved[1] if len(moved) == 2 else moved[0]
        deflection = between if run.positions else np.cumsum(between) * run.sample_time
        reached = max(reached, float(np.max(np.abs(deflection))))
    tried = np.linspace(0.0, _FARTHER * reached, 1001)
    falls = np.diff(drive.spring_force(tried)) < 0.0, np.diff(-drive.spring_force(-tried)) < 0.0
    turns = [float(tried[np.argmax(side)]) for side in falls if side.any()]
    if not turns:
        return ()
    turn, far = (drive.units.text(x, "mm", 2) for x in (min(turns), reached))
    note = (
        f"the spring's force as it was fitted falls again beyond {turn} of deflection, and runs go to {far}: trust no "
        "simulation that goes much farther than they do"
    )
    return (note,)


def _never_negative(recordings: Sequence[Recording], channel: str) -> bool:
    """Whether a recorded velocity never goes below zero, though the command changes its sign."""
    signals = [v for r in recordings if (v := getattr(r, channel)) is not None]
    if not signals or not any(np.min(r.u) < 0.0 < np.max(r.u) for r in recordings):
        return False
    return min(float(np.min(v)) for v in signals) > -_NEGATIVE * max(float(np.max(v)) for v in signals)


def _rivals(findings: Sequence[Finding], steps: Sequence[Step]) -> dict[str, list[dict[str, Any]]]:
    """Return, per finding with ties, the drives that explain the recordings as well: its own first, then its ties'."""
    tied = {(f.id, f.where): {(t.id, t.where) for t in f.ties} for f in findings if f.ties}
    return {
        "@".join(step.rival.name): [
            {"id": r.name[0], "where": r.name[1], "values": dict(r.fit.values)}
            for r in (step.rival, *(t for t in step.ties if t.name in tied[step.rival.name]))
        ]
        for step in steps
        if step.rival.name in tied
    }


def located(maps: Sequence[Map]) -> tuple[Located, ...]:
    """Return each equation's share of the missing force and the variable it follows most."""
    sizes = {m.where: m.size**2 for m in maps}
    everything = sum(sizes.values())
    found = []
    for where, square in sorted(sizes.items(), key=lambda item: -item[1]):
        best = max((m for m in maps if m.where == where), key=lambda m: m.explained)
        i = int(np.argmax(np.abs(best.mean)))
        acts = f"{best.variable} near {best.centre[i]:.3g}" if best.explained > 0.02 else "no single signal"
        found.append(Located(where, float(square / everything), acts, best.sentence))
    return tuple(found)


def _verdict(findings: Sequence[Finding], unnamed: Unnamed | None, proof: tuple[float, float, float]) -> Verdict:
    if not findings:
        return "no_mismatch" if unnamed is None else "unexplained"
    near = not np.isfinite(proof[2]) or proof[1] < _NEAR_FLOOR * proof[2]
    return "explained" if unnamed is None and near else "partly_explained"
