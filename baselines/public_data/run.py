"""A benchmark from beginning to end: diagnose, climb the ladder, score every rung by the benchmark's rule."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from baselines.public_data.benchmark import Benchmark
from flexdrive_gym import Drive, Recording
from flexdrive_gym.recording import Fault, FloatArray
from identification import diagnose
from identification.initial_state import with_start
from identification.mismatch.ladder import Rung, climb
from identification.mismatch.verdict import Diagnosis, unit_of
from identification.replay.output_error import prepare_measured, simulate_run


@dataclass(frozen=True)
class Score:
    """Rms error of one rung in one recording [unit of the rule].

    Attributes
    ----------
    part
        ``learnt``, ``validation`` or ``test``.
    column
        Of the published table.
    """

    rung: str
    part: str
    recording: str
    column: str
    rms: float


@dataclass(frozen=True, eq=False)
class Result:
    """What a benchmark run found.

    Attributes
    ----------
    found
        Diagnosis that ``final`` is about.
    ladder
        Rungs fitted to what was learnt from.
    final
        Rungs fitted to all training recordings: what test recordings are scored with. Where there are any, all training
        recordings were also diagnosed; else the names are those of ``ladder``.
    scores
        Of the ladder in what was learnt from and in the validation part, and of ``final`` in test recordings.
    recordings
        The files as read, training first, with their faults: no fit uses what a fault touches, the rule scores every sample.
    seconds
        Wall time.
    """

    benchmark: Benchmark
    found: Diagnosis
    ladder: tuple[Rung, ...]
    final: tuple[Rung, ...]
    scores: tuple[Score, ...]
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
            "schema": 1,
            "benchmark": b.name,
            "citation": b.citation,
            "rule": {"window": b.rule.window, "unit": b.rule.unit, "metric": "rms of a free simulation"},
            "published": [{"method": p.method, **dict(zip(b.columns, p.figures, strict=True))} for p in b.published],
            "faults": [vars(f) for f in self.faults],
            "notes": list(self.notes),
            "findings": [{"id": f.id, "where": f.where} for f in self.found.findings],
            "ladder": [
                {
                    "rung": rung.name,
                    "learnt": self.rms(rung.name, "learnt"),
                    "validation": self.rms(rung.name, "validation"),
                    "parameters": parameters(b, rung.drive),
                }
                for rung in self.ladder
            ],
            "final": [
                {
                    "rung": rung.name,
                    "test": {c: self.rms(rung.name, "test", c) for c in b.columns},
                    "parameters": parameters(b, rung.drive),
                }
                for rung in self.final
            ],
            "scores": [vars(s) for s in self.scores],
            "seconds": self.seconds,
        }


def parameters(benchmark: Benchmark, drive: Drive) -> dict[str, dict[str, Any]]:
    """Return the fitted parameters of a drive in the rig's units."""
    found = {}
    for name, value in drive.values.items():
        if name not in benchmark.topology.fixed:
            number, unit = benchmark.units.of_rig(value, unit_of(name))
            found[name] = {"value": number, "unit": unit}
    return found


def simulation_error(drive: Drive, recording: Recording, benchmark: Benchmark) -> FloatArray:
    """Return measured minus simulated output of a free simulation [engine's units], ndarray, shape (n,)."""
    run = with_start(drive.values, prepare_measured(recording), benchmark.rule.window, moving=benchmark.topology.moving)
    seen = max(range(len(run.keep)), key=lambda c: int(run.keep[c].sum()))
    return np.asarray(run.measured[seen] - simulate_run(drive.values, run)[seen])


def score_all(
    benchmark: Benchmark,
    rungs: Sequence[Rung],
    recordings: Sequence[Recording],
    part: str,
    training: Sequence[Recording],
) -> list[Score]:
    """Score every rung in every recording."""
    scores = []
    for r in recordings:
        column = benchmark.column_of(r)
        inside = _within(r, training)
        for rung in rungs:
            error = simulation_error(rung.drive, r, benchmark)
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
    everything = tuple(benchmark.read(p) for p in files)
    learn, validation = benchmark.hold_out(everything)
    tests = tuple(benchmark.read(p) for p in benchmark.files(folder, benchmark.test))
    found = diagnose(learn, seed=seed, jobs=jobs, topology=benchmark.topology, say=say)
    window = benchmark.rule.window
    ladder = climb(found, learn, benchmark.topology, window=window, jobs=jobs, say=say)
    say("fitting all training recordings")
    whole = diagnose(everything, seed=seed, jobs=jobs, topology=benchmark.topology, say=say) if tests else found
    final = climb(whole, everything, benchmark.topology, window=window, jobs=jobs, say=say)
    say("scoring")
    scores = score_all(benchmark, ladder, learn, "learnt", learn)
    scores += score_all(benchmark, ladder, validation, "validation", learn)
    scores += score_all(benchmark, final, tests, "test", everything)
    return Result(benchmark, whole, ladder, final, tuple(scores), (*everything, *tests), time.perf_counter() - begin)
