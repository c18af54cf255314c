"""A benchmark from beginning to end: diagnose, fit what the data leave open, validate by blocks, score by the rule."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from baselines.public_data.benchmark import Benchmark
from baselines.public_data.blocks import averaged, block_errors, weights
from baselines.public_data.fitting import piece_of, simulated, started
from baselines.public_data.replicates import friction_scores
from baselines.public_data.structures import Structure, open_structures
from flexdrive_gym import Drive, Provenance, Recording, __version__
from flexdrive_gym.drive.parameters import parameter
from flexdrive_gym.recording import Fault, FloatArray
from identification import Diagnosis, diagnose

AVERAGE = "average of open structures"


@dataclass(frozen=True)
class Score:
    """Rms error of one rung in one recording [unit of the rule].

    Attributes
    ----------
    part
        ``fitted``, ``validation`` (blocks that were left out) or ``test``.
    column
        Of the published table.
    """

    rung: str
    part: str
    recording: str
    column: str
    rms: float


@dataclass(frozen=True, eq=False)
class Rung:
    """A predictor: one fitted drive, or several with weights.

    Attributes
    ----------
    name
        Effect that it adds, the topology's name for the first, or that it is the average.
    members
        Weight and drive of each.
    """

    name: str
    members: tuple[tuple[float, Drive], ...]

    @property
    def drive(self) -> Drive:
        """The drive of the largest weight."""
        return max(self.members, key=lambda m: m[0])[1]


@dataclass(frozen=True, eq=False)
class Result:
    """What a benchmark run found.

    Attributes
    ----------
    found
        Diagnosis of all training recordings.
    ladder
        The free drive, the drive with each finding added, and last the average; fitted to all training recordings.
    scores
        In the training recordings, in their blocks when left out, and in test recordings.
    friction
        Recording to the 2.5 %, 50 % and 97.5 % quantiles of the score that run-to-run friction alone makes [unit of the rule].
    recordings
        The files as read, training first, with their faults: no fit uses what a fault touches, the rule scores every sample.
    seconds
        Wall time.
    """

    benchmark: Benchmark
    found: Diagnosis
    ladder: tuple[Rung, ...]
    scores: tuple[Score, ...]
    friction: Mapping[str, tuple[float, float, float]]
    recordings: tuple[Recording, ...]
    seconds: float

    @property
    def tested(self) -> bool:
        """Whether there were test recordings."""
        return any(s.part == "test" for s in self.scores)

    @property
    def faults(self) -> tuple[Fault, ...]:
        """What is wrong with the files, times in the rig's seconds."""
        one = self.benchmark.units.per_time
        return tuple(
            replace(f, start_s=f.start_s / one, end_s=f.end_s / one) for r in self.recordings for f in r.faults
        )

    @property
    def notes(self) -> tuple[str, ...]:
        """What reading the files met."""
        return tuple(f"{r.name}: {note}" for r in self.recordings for note in r.notes)

    def rms(self, rung: str, part: str, column: str | None = None) -> float:
        """Return the rms over the recordings of a part; nan where there are none."""
        squares = [s.rms**2 for s in self.scores if (s.rung, s.part) == (rung, part) and column in (None, s.column)]
        return float(np.sqrt(np.mean(squares))) if squares else float("nan")

    def as_json(self) -> dict[str, Any]:
        """Return the object of ``benchmark.json``."""
        b = self.benchmark
        return {
            "schema": 2,
            "benchmark": b.name,
            "citation": b.citation,
            "rule": {"window": b.rule.window, "unit": b.rule.unit, "metric": "rms of a free simulation"},
            "published": [{"method": p.method, **dict(zip(b.columns, p.figures, strict=True))} for p in b.published],
            "faults": [vars(f) for f in self.faults],
            "notes": list(self.notes),
            "findings": [{"id": f["id"], "where": f["where"]} for f in self.found.as_json()["findings"]],
            "ladder": [
                {
                    "rung": rung.name,
                    "fitted": self.rms(rung.name, "fitted"),
                    "validation": {c: self.rms(rung.name, "validation", c) for c in b.columns},
                }
                for rung in self.ladder
            ],
            "final": [
                {
                    "rung": rung.name,
                    "test": {c: self.rms(rung.name, "test", c) for c in b.columns},
                    "parameters": parameters(b, rung.drive),
                    "members": [{"weight": w, "structure": d.name} for w, d in rung.members],
                }
                for rung in self.ladder
            ],
            "friction": {name: list(quantiles) for name, quantiles in self.friction.items()},
            "scores": [vars(s) for s in self.scores],
            "seconds": self.seconds,
        }


def parameters(benchmark: Benchmark, drive: Drive) -> dict[str, dict[str, Any]]:
    """Return the fitted parameters of a drive in the rig's units."""
    found = {}
    for name, value in drive.values.items():
        if name not in benchmark.topology.fixed:
            number, unit = benchmark.units.of_rig(value, parameter(name).unit)
            found[name] = {"value": number, "unit": unit}
    return found


def simulation_error(rung: Rung, recording: Recording, benchmark: Benchmark) -> FloatArray:
    """Return measured minus simulated output of a free simulation [engine's units], ndarray, shape (n,)."""
    measured = piece_of(recording)
    total = np.array(measured.measured)
    for weight, drive in rung.members:
        total -= weight * simulated(drive.values, started(drive.values, measured, benchmark))
    return total


def run_benchmark(
    benchmark: Benchmark,
    folder: Path,
    *,
    seed: int = 0,
    jobs: int | None = None,
    say: Callable[[str], None] = lambda _: None,
) -> Result:
    """Run a benchmark on the files of a folder.

    Raises
    ------
    ValueError
        If the folder has no training files.
    """
    begin = time.perf_counter()
    files = [p for p in benchmark.files(folder, benchmark.train) if p not in benchmark.files(folder, benchmark.test)]
    if not files:
        raise ValueError(
            f"data: {folder} must hold training files of {benchmark.name} ({', '.join(benchmark.train)}); got none. "
            f"They are those of {benchmark.citation}."
        )
    training = tuple(benchmark.read(p) for p in files)
    tests = tuple(benchmark.read(p) for p in benchmark.files(folder, benchmark.test))
    found = diagnose(training, seed=seed, jobs=jobs, topology=benchmark.topology, say=say)
    with ThreadPoolExecutor(jobs or len(os.sched_getaffinity(0))) as pool:
        ladder, structures = _climbed(found, training, benchmark, pool, say)
        errors = block_errors([*ladder, *structures], training, benchmark, pool, say)
    open_errors = errors[len(ladder) :]
    shares = weights(open_errors)
    rungs = [_rung(s.name, [(1.0, s)], training) for s in ladder]
    rungs.append(_rung(AVERAGE, list(zip(map(float, shares), structures, strict=True)), training))
    validated = [*errors[: len(ladder)], averaged(open_errors)]
    say("scoring")
    scores = _scored(rungs, training, "fitted", training, benchmark)
    for rung, blocks in zip(rungs, validated, strict=True):
        for i, r in enumerate(training):
            e = np.concatenate([blocks[j][i] for j in range(benchmark.blocks)])
            column = benchmark.columns[benchmark.column_of(r)]
            scores.append(Score(rung.name, "validation", r.name, column, benchmark.figure(e)))
    scores += _scored(rungs, tests, "test", training, benchmark)
    rng = np.random.default_rng([seed, 1])
    best = rungs[-1].drive.values
    friction = {r.name: friction_scores(best, training, r, benchmark, rng) for r in (tests or training)}
    recordings = (*training, *tests)
    return Result(benchmark, found, tuple(rungs), tuple(scores), friction, recordings, time.perf_counter() - begin)


def _climbed(
    found: Diagnosis,
    training: Sequence[Recording],
    benchmark: Benchmark,
    pool: Executor,
    say: Callable[[str], None],
) -> tuple[list[Structure], list[Structure]]:
    """Return the ladder from the free drive to all findings, and the structures that are open around its end."""
    pieces = [piece_of(r) for r in training]
    diagnosed = found.drive.values
    topology = benchmark.topology
    effects: list[tuple[str, Any]] = []
    ties = {}
    values = {**topology.start, **{k: v for k, v in diagnosed.items() if k in topology.free}, **topology.fixed}
    ladder = [Structure(topology.name, (), values).fitted(pieces, benchmark)]
    for f in found.as_json()["findings"]:
        name = (f["id"], f["where"])
        say(f"fitting {name[0]} at {name[1]}")
        effects.append(name)
        ties[name] = [(t["id"], t["where"]) for t in f["ties"]]
        prefixes = tuple(f"{id_}." for id_, _ in effects)
        own = {k: v for k, v in diagnosed.items() if k.startswith(prefixes) or k in {"d1", "d2"}}
        starts = [{**ladder[-1].values, **{k: v for k, v in own.items() if k not in ladder[-1].values}}]
        starts.append({**values, **own})
        label = f"{name[0]}@{name[1]}"
        rungs = [Structure(label, tuple(effects), s).fitted(pieces, benchmark) for s in starts]
        ladder.append(min(rungs, key=lambda s: s.cost))
    return ladder, open_structures(replace(ladder[-1], name="findings"), ties, training, benchmark, pool, say)


def _rung(name: str, members: Sequence[tuple[float, Structure]], training: Sequence[Recording]) -> Rung:
    names = tuple(r.name for r in training)
    drives = tuple(
        (w, Drive(s.values, provenance=Provenance("benchmark", names, __version__, s.name), name=s.name))
        for w, s in members
        if w > 0.0
    )
    return Rung(name, drives)


def _scored(
    rungs: Sequence[Rung],
    recordings: Sequence[Recording],
    part: str,
    training: Sequence[Recording],
    benchmark: Benchmark,
) -> list[Score]:
    scores = []
    for r in recordings:
        column = benchmark.column_of(r)
        inside = _within(r, training)
        for rung in rungs:
            error = simulation_error(rung, r, benchmark)
            scores.append(Score(rung.name, part, r.name, benchmark.columns[column], benchmark.score(error)))
            again = benchmark.without_extrapolation.get(column)
            if again is not None and inside > benchmark.rule.window:
                rms = benchmark.score(error[:inside])
                scores.append(Score(rung.name, part, r.name, benchmark.columns[again], rms))
    return scores


def _within(recording: Recording, training: Sequence[Recording]) -> int:
    """Return how many samples there are before the output exceeds every one of training."""
    most = {name: max(float(np.max(np.abs(getattr(r, name)))) for r in training) for name, _ in recording.channels()}
    beyond = np.any([np.abs(y) > most[name] for name, y in recording.channels()], axis=0)
    return int(np.argmax(beyond)) if beyond.any() else recording.n
