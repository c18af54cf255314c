"""The present diagnosis against the answers of an earlier study, on the same concealed data sets.

``python -m benchmarks paired [STUDY] [--trials 60] [--jobs 2]`` makes the first data sets of a study again, diagnoses them, and
prints both answers. STUDY is a folder of ``flexdrive blind``, or ``REVISION:FOLDER`` of this repository's history
(docs/trial/studies.csv); default: the 200 data sets with seed 9. Their seed steered decisions: what is printed is a comparison
and no claim. Every answer is kept in the cache directory under the digest of the code.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import joblib
from platformdirs import user_cache_path

from baselines.blind_study.judge import Judged, judge
from baselines.blind_study.plan import Trial, plan
from baselines.blind_study.study import PACKED, engine, outcomes, settings
from baselines.rig_simulator.make import make_case
from flexdrive_gym.files import write_atomically
from identification import diagnose

ROOT = Path(__file__).parents[1]
STUDY = "81990b1:docs/trial/seed_9"
ROWS = (
    "single effects from half size on, named exactly or in a tie",
    "single effects from half size on, named exactly",
    "pairs, both named or tied",
    "effects outside the catalogue reported as unnamed, and nothing named",
    "effects outside the catalogue given a name",
    "nulls and faults alone with a name",
    "data sets with a false positive",
)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks paired", description=__doc__)
    parser.add_argument("study", nargs="?", default=STUDY, help="folder, or REVISION:FOLDER; default %(default)s")
    parser.add_argument("--trials", type=int, default=60)
    parser.add_argument("--jobs", type=int, default=2)
    given = parser.parse_args(sys.argv[2:])
    try:
        with study_folder(given.study) as study:
            asked = settings(study)
            published = outcomes(study, plan(asked["trials"], asked["seed"]))[: given.trials]
    except ValueError as error:
        parser.error(str(error))
    folder = user_cache_path("flexdrive") / "paired" / engine() / str(asked["seed"])
    joblib.Parallel(n_jobs=given.jobs)(
        joblib.delayed(one)(o["trial"], folder) for o in published if not _file(folder, o["trial"]).exists()
    )
    pairs = []
    for outcome in published:
        answer = json.loads(_file(folder, outcome["trial"]).read_text())
        now = {**outcome["answer"], "diagnosis": {**outcome["answer"]["diagnosis"], **answer["diagnosis"]}}
        pairs.append((judge(outcome), judge({**outcome, "answer": now, "seconds": answer["seconds"]})))
        print(_line(*pairs[-1]))
    print(f"\n| of {len(pairs)} data sets | before | present |\n|---|---|---|")
    before, after = (_figures([p[i] for p in pairs]) for i in (0, 1))
    for name, a, b in zip(ROWS, before, after, strict=True):
        print(f"| {name} | {a} | {b} |")


@contextmanager
def study_folder(study: str) -> Iterator[Path]:
    """Yield the folder of a study; one of the history is written to a temporary folder."""
    revision, _, inside = study.partition(":")
    if not inside or Path(study).is_dir():
        yield Path(study)
        return
    with tempfile.TemporaryDirectory(prefix="flexdrive-") as name:
        for file in ("study.json", PACKED):
            asked = ["git", "-C", ROOT, "show", f"{revision}:{inside}/{file}"]
            try:
                content = subprocess.run(asked, capture_output=True, check=True).stdout
            except (OSError, subprocess.CalledProcessError) as error:
                said = getattr(error, "stderr", b"").decode().strip().rstrip(".") or str(error)
                raise ValueError(
                    f"study: {study!r} must be in the history of this repository; git says: {said}. Fetch the whole "
                    "history (git fetch --unshallow), or give a folder of flexdrive blind."
                ) from None
            (Path(name) / file).write_bytes(content)
        yield Path(name)


def one(trial: Mapping[str, Any], folder: Path) -> None:
    """Diagnose one data set and keep the answer."""
    t = Trial(**trial)
    with tempfile.TemporaryDirectory(prefix="flexdrive-") as name:
        recordings = Path(name) / "recordings"
        make_case(recordings, Path(name) / "truth.json", t.seed, t.kind, t.size, t.effect)
        begin = time.process_time()
        found = diagnose(recordings, seed=t.seed, jobs=1).as_json()
    answer = {"diagnosis": {k: found[k] for k in ("findings", "unnamed")}, "seconds": time.process_time() - begin}
    folder.mkdir(parents=True, exist_ok=True)
    write_atomically(_file(folder, trial), json.dumps(answer))


def _file(folder: Path, trial: Mapping[str, Any]) -> Path:
    return folder / f"{trial['number']}.json"


def _figures(judged: Sequence[Judged]) -> list[str]:
    def share(found: Sequence[bool]) -> str:
        return f"{sum(found)} of {len(found)}"

    single = [j.concealed[0] for j in judged if j.kind == "effect" and j.concealed[0].size >= 0.5]
    outside = [j for j in judged if j.outside is not None]
    nothing = [j for j in judged if j.nothing]
    return [
        share([c.named != "missed" for c in single]),
        share([c.named == "exact" for c in single]),
        share([all(c.named != "missed" for c in j.concealed) for j in judged if j.kind == "pair"]),
        share([j.unnamed and not j.findings for j in outside]),
        share([bool(j.findings) for j in outside]),
        share([bool(j.findings) for j in nothing]),
        share([bool(j.false_names) for j in judged]),
    ]


def _line(published: Judged, present: Judged) -> str:
    hidden = ", ".join(f"{c.id}@{c.where} ×{c.size:g}" for c in published.concealed) or published.outside or "nothing"

    def said(j: Judged) -> str:
        how = {c.named for c in j.concealed}
        text = ", ".join(j.findings) + (", unnamed" if j.unnamed else "")
        return (text.strip(", ") or "nothing") + (" (in a tie)" if "tie" in how else "")

    return (
        f"{published.number:3d} {hidden}: before {said(published)}; present {said(present)} [{present.seconds:.0f} s]"
    )
