"""All trials of a study: on all cores or a cluster, interrupted and resumed at will."""

from __future__ import annotations

import gzip
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from baselines.blind_study.one import conduct, opened
from baselines.blind_study.plan import Trial, plan
from baselines.evaluation.parallel import Backend, Progress, code_digest, workers
from flexdrive_gym.files import write_atomically

_DECIDES = ("baselines.rig_simulator", "identification", "flexdrive_gym")
# all outcomes of a study in one file, a line each
PACKED = "outcomes.jsonl.gz"


def engine() -> str:
    """Return a digest of the code that makes and diagnoses: outcomes of different code are not mixed."""
    return code_digest(_DECIDES)


def conduct_study(
    folder: Path,
    trials: int,
    *,
    seed: int = 0,
    backend: Backend = "threading",
    jobs: int = -1,
    scheduler: str | None = None,
    progress: Progress = lambda _done, _all: None,
) -> list[Mapping[str, Any]]:
    """Run the trials that have no outcome yet, neither single nor packed; return the outcomes of all, in order.

    Parameters
    ----------
    folder
        Holds ``study.json``, the sealed truths and the outcomes, or these packed; with ``dask``, one that all workers see.
    trials, seed
        What :func:`baselines.blind_study.plan.plan` is asked for.
    backend, jobs, scheduler
        Where trials are computed; the outcomes do not depend on it.
    progress
        Called with the number of trials done and of all.

    Raises
    ------
    ValueError
        If the folder holds another study, or the workers cannot be reached; nothing is written then.
    """
    chosen = plan(trials, seed)
    with workers(backend, jobs, scheduler) as run:
        _enter(folder, {"trials": trials, "seed": seed, "engine": engine()})
        _unpack(folder, chosen)
        todo = [t for t in chosen if not opened(folder, t.number).exists()]
        done = len(chosen) - len(todo)
        progress(done, len(chosen))
        run(
            [(conduct, (t, folder.resolve())) for t in todo],
            lambda finished, _: progress(done + finished, len(chosen)),
        )
    return outcomes(folder, chosen)


def settings(folder: Path) -> Mapping[str, Any]:
    """Return what a folder's study was asked for: trials, seed, and the digest of the code that answers.

    Raises
    ------
    ValueError
        If the folder holds no study, or a damaged one.
    """
    file = folder / "study.json"
    if not file.exists():
        raise ValueError(f"output: {folder} holds no study. Begin one without --report.")
    return _parsed(file, file.read_text())


def outcomes(folder: Path, trials: tuple[Trial, ...]) -> list[Mapping[str, Any]]:
    """Return the outcomes that there are, in order; without single ones those that were packed.

    Raises
    ------
    ValueError
        If a file is damaged.
    """
    files = [opened(folder, t.number) for t in trials]
    found = [_parsed(f, f.read_text()) for f in files if f.exists()]
    packed = folder / PACKED
    if found or not packed.exists():
        return found
    try:
        lines = gzip.decompress(packed.read_bytes()).decode().splitlines()
    except (OSError, EOFError, UnicodeDecodeError) as error:
        raise _damaged(packed, error) from None
    return [_parsed(packed, line) for line in lines]


def _parsed(file: Path, text: str) -> Mapping[str, Any]:
    try:
        found: Mapping[str, Any] = json.loads(text)
    except json.JSONDecodeError as error:
        raise _damaged(file, error) from None
    return found


def _damaged(file: Path, error: Exception) -> ValueError:
    return ValueError(f"output: {file} cannot be read: {error}. Put the original back, or run those trials again.")


def pack(folder: Path, found: Sequence[Mapping[str, Any]]) -> Path:
    """Write outcomes, truths with their hashes included, into one file, from which :func:`outcomes` reads them again."""
    lines = "".join(json.dumps(outcome) + "\n" for outcome in found)
    # without a time stamp: the same outcomes are the same file
    return write_atomically(folder / PACKED, gzip.compress(lines.encode(), mtime=0))


def _unpack(folder: Path, trials: tuple[Trial, ...]) -> None:
    """Write single outcomes where there are packed ones alone, so that a study that was published goes on."""
    if (folder / PACKED).exists():
        for outcome in outcomes(folder, trials):
            file = opened(folder, outcome["trial"]["number"])
            if not file.exists():
                write_atomically(file, json.dumps(outcome))


def _enter(folder: Path, wanted: Mapping[str, object]) -> None:
    file = folder / "study.json"
    if file.exists():
        there = settings(folder)
        for name, value in wanted.items():
            if there.get(name) != value:
                raise ValueError(
                    f"output: {folder} holds a study with {name} {there.get(name)!r}, not {value!r}. Give another folder, or "
                    "remove that one."
                )
        return
    write_atomically(file, json.dumps(wanted, indent=1) + "\n")
