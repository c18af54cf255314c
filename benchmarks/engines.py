"""Old and new diagnosis on the same concealed data sets, in pairs.

``python -m benchmarks engines [--seed 9] [--trials 40] [--only new]``. Seeds 1 to 9 are development: what is printed compares
engines and proves nothing about either.
"""

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from scipy.stats import binomtest

from baselines.blind_study.plan import Trial, plan
from baselines.rig_simulator.make import make_case
from flexdrive_gym.recording import Recording
from identification import diagnose as old_diagnose
from identification import read_recordings
from identification.diagnosis.diagnose import diagnose as new_diagnose

Name = tuple[str, str]


@dataclass(frozen=True)
class Answer:
    """Names with their ties, whether something stayed unnamed, and how long it took (processor time) [s]."""

    names: dict[Name, list[Name]]
    unnamed: bool
    seconds: float


@dataclass(frozen=True)
class Judged:
    """Concealed effects named exactly or in a tie, false positives, and whether something stayed unnamed."""

    hits: frozenset[Name]
    exact: frozenset[Name]
    false: tuple[Name, ...]
    unnamed: bool


def judge(concealed: Sequence[Name], answer: Answer) -> Judged:
    hits, exact, matched = set(), set(), set()
    for name in concealed:
        tied = [n for n, ties in answer.names.items() if name in ties and n not in matched]
        if name in answer.names:
            hits.add(name)
            exact.add(name)
            matched.add(name)
        elif tied:
            hits.add(name)
            matched.add(tied[0])
    return Judged(frozenset(hits), frozenset(exact), tuple(n for n in answer.names if n not in matched), answer.unnamed)


def old(recordings: Sequence[Recording], seed: int) -> Answer:
    begin = time.process_time()
    found = old_diagnose(recordings, seed=seed)
    names = {(f.id, f.where): [(t.id, t.where) for t in f.ties] for f in found.findings}
    return Answer(names, found.unnamed is not None, time.process_time() - begin)


def new(recordings: Sequence[Recording], seed: int) -> Answer:
    begin = time.process_time()
    found = new_diagnose(recordings, seed=seed)
    names = {(f.effect.id, f.effect.where): [(t.id, t.where) for t in f.ties] for f in found.findings}
    return Answer(names, found.unnamed is not None, time.process_time() - begin)


ENGINES: dict[str, Callable[[Sequence[Recording], int], Answer]] = {"old": old, "new": new}


def compare(trial: Trial, engines: Sequence[str]) -> tuple[list[Name], bool, dict[str, tuple[Answer, Judged]]]:
    """Make a data set, diagnose it by every engine, and open its truth."""
    with tempfile.TemporaryDirectory(prefix="flexdrive-") as name:
        folder, sealed = Path(name) / "recordings", Path(name) / "truth.json"
        make_case(folder, sealed, trial.seed, trial.kind, trial.size, trial.effect)
        recordings = read_recordings(folder)
        answers = {e: ENGINES[e](recordings, trial.seed) for e in engines}
        truth = json.loads(sealed.read_text())
    concealed = [(e["id"], e["where"]) for e in truth["effects"] if e["where"] != "outside"]
    outside = len(concealed) < len(truth["effects"])
    return concealed, outside, {e: (a, judge(concealed, a)) for e, a in answers.items()}


def _line(names: Sequence[Name]) -> str:
    return ", ".join("@".join(n) for n in names) or "–"


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks engines", description=__doc__)
    parser.add_argument("--seed", type=int, default=9, help="of the plan; 1 to 9 are development")
    parser.add_argument("--trials", type=int, default=40)
    parser.add_argument("--only", choices=list(ENGINES), help="run one engine")
    given = parser.parse_args(sys.argv[2:])
    engines = [given.only] if given.only else list(ENGINES)
    total = {e: {"hits": 0, "exact": 0, "false": 0, "clean": 0, "unnamed": 0, "seconds": 0.0} for e in engines}
    effects = empty = outsiders = gained = lost = 0
    for trial in plan(given.trials, given.seed):
        concealed, outside, results = compare(trial, engines)
        effects, empty = effects + len(concealed), empty + (not concealed and not outside)
        outsiders += outside
        size = "" if trial.size is None else f" ×{trial.size:g}"
        print(
            f"{trial.number:3d} {trial.kind:8s}{_line(concealed)}{size}{' (outside the catalogue)' if outside else ''}"
        )
        for e, (answer, judged) in results.items():
            t = total[e]
            t["hits"] += len(judged.hits)
            t["exact"] += len(judged.exact)
            t["false"] += bool(judged.false)
            t["clean"] += not concealed and not outside and not answer.names and not answer.unnamed
            t["unnamed"] += outside and answer.unnamed
            t["seconds"] += answer.seconds
            text = "; ".join(
                f"{'@'.join(n)}" + (f" (ties {_line(ts)})" if ts else "") for n, ts in answer.names.items()
            )
            extra = " + unnamed" if answer.unnamed else ""
            print(
                f"      {e}: {text or '–'}{extra}; false positives {_line(judged.false)}; {answer.seconds:.0f} s",
                flush=True,
            )
        if len(engines) == 2:
            gained += len(results["new"][1].hits - results["old"][1].hits)
            lost += len(results["old"][1].hits - results["new"][1].hits)
    for e, t in total.items():
        print(
            f"{e}: {t['hits']:.0f} of {effects} effects named or tied, {t['exact']:.0f} exactly; data sets with a false positive "
            f"{t['false']:.0f} of {given.trials}; nulls without any finding {t['clean']:.0f} of {empty}; outside the "
            f"catalogue and unnamed {t['unnamed']:.0f} of {outsiders}; {t['seconds'] / given.trials:.0f} s of processor each"
        )
    if len(engines) == 2:
        p = binomtest(gained, gained + lost).pvalue if gained + lost else 1.0
        print(f"names gained {gained}, lost {lost}, sign test p = {p:.2g}")
