"""One trial from beginning to end: conceal, seal, diagnose elsewhere, open the seal."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from baselines.blind_study.payoff import payoff
from baselines.blind_study.plan import Trial
from baselines.rig_simulator.critical_gain import critical_gain
from baselines.rig_simulator.truth import Truth, draw_truth, seal
from flexdrive_gym.drive.toml import loads
from flexdrive_gym.files import write_atomically

# controllers are tried on one rig of so many
_PAYOFF_EVERY = 5
# a diagnosis that takes longer has failed: all but one of the studies in docs/trial took less, beside other work, too
_LONGEST_S = 1800.0
# one thread each: a study keeps the cores busy with trials
_THREADS = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")


def sealed(folder: Path, number: int) -> Path:
    """Return the file of a trial's truth."""
    return folder / "sealed" / f"{number:04d}.json"


def opened(folder: Path, number: int) -> Path:
    """Return the file of a trial's outcome."""
    return folder / "trials" / f"{number:04d}.json"


def conduct(trial: Trial, folder: Path) -> int:
    """Run one trial and write its outcome; return its number.

    The recordings lie in a temporary folder of their own, which is all that the diagnosing process is told of. A diagnosis
    that fails is an outcome too.

    Raises
    ------
    ValueError
        If the truth is no longer what was sealed.
    """
    folder, truth = folder.resolve(), sealed(folder.resolve(), trial.number)
    with tempfile.TemporaryDirectory(prefix="flexdrive-") as name:
        recordings, result = Path(name) / "recordings", Path(name) / "answer.json"
        made = _python(
            "baselines.rig_simulator.make", *_concealing(trial), "-o", str(recordings), "--truth", str(truth)
        )
        if made.returncode:
            raise ValueError(f"trial {trial.number}: its rig could not be made: {made.stderr.strip()}")
        digest = made.stdout.split()[0]
        begin = time.perf_counter()
        failed = _diagnose(recordings, result, trial.seed)
        seconds = time.perf_counter() - begin
        answer = json.loads(result.read_text()) if failed is None else None
    text = truth.read_text()
    if seal(text) != digest:
        raise ValueError(
            f"trial {trial.number}: the truth in {truth} is not what was sealed; its hash should be {digest}."
        )
    rig = draw_truth(trial.seed, trial.kind, size=trial.size, effect=trial.effect)
    outcome = {
        "trial": vars(trial),
        "sha256": digest,
        "truth": json.loads(text),
        "answer": answer,
        "failed": failed,
        "seconds": seconds,
        "critical_gain": critical_gain(rig),
        "payoff": _payoff(rig, answer) if trial.number % _PAYOFF_EVERY == 0 else None,
    }
    write_atomically(opened(folder, trial.number), json.dumps(outcome))
    return trial.number


def _diagnose(recordings: Path, result: Path, seed: int) -> str | None:
    """Let another process diagnose a folder; return why it failed, if it did."""
    try:
        run = _python(
            "baselines.blind_study.diagnosing",
            str(recordings),
            str(result),
            str(seed),
            cwd=str(result.parent),
            longest=_LONGEST_S,
        )
    except subprocess.TimeoutExpired:
        return f"no answer within {_LONGEST_S / 60:g} minutes"
    if run.returncode == 0:
        return None
    if run.returncode in (-signal.SIGINT, -signal.SIGTERM):
        # somebody stopped it: the trial is done again when the study goes on
        raise KeyboardInterrupt
    return run.stderr.strip().rsplit("\n", maxsplit=1)[-1] or f"ended without a word, status {run.returncode}"


def _payoff(rig: Truth, answer: Mapping[str, Any] | None) -> object:
    """Run controllers designed on the drives that the answer holds on the rig itself, if a named effect is concealed there."""
    if answer is None or not rig.effects or any(e.where == "outside" for e in rig.effects):
        return None
    return payoff(rig, {name: loads(text) for name, text in answer["drives"].items()}).as_json()


def _concealing(trial: Trial) -> list[str]:
    arguments = ["--seed", str(trial.seed), "--kind", trial.kind]
    if trial.effect is not None:
        arguments += ["--effect", "@".join(trial.effect)]
    if trial.size is not None:
        arguments += ["--size", str(trial.size)]
    return arguments


def _python(
    module: str, *arguments: str, cwd: str | None = None, longest: float | None = None
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(  # noqa: S603  (our own modules, no shell)
        [sys.executable, "-m", module, *arguments],
        timeout=longest,
        capture_output=True,
        text=True,
        check=False,
        cwd=cwd,
        env={**os.environ, **_THREADS},
    )
