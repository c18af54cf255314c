"""What the diagnosis says of the real rigs and of the fourteen blind data sets.

``python -m benchmarks diagnosis [DATA SET ...]`` looks for them in ``../shared/recordings`` beside the repository.
"""

import resource
import sys
from pathlib import Path

from baselines.lab.predictions import predictions
from baselines.report import words
from identification import Diagnosis, diagnose, read_recordings

ROOT = Path(__file__).parents[1]
DATA = ROOT.parent / "shared" / "recordings"
COLUMNS = (
    "data set",
    "verdict",
    "findings",
    "cannot be told from",
    "rms of report recordings, before → after (floor)",
    "critical gain, simulated, before → after [95 %]",
    "lab's critical gain, before → after [95 %]; rig",
    "faults",
    "s",
    "most memory so far [MB]",
)


def data_sets() -> list[str]:
    blind = DATA / "blind"
    return ["mte360_2022", "mte360_2025", *sorted(f"blind/{p.name}" for p in blind.glob("case_*"))]


def main() -> None:
    names = sys.argv[2:] or data_sets()
    print("| " + " | ".join(COLUMNS) + " |")
    print("|---" * len(COLUMNS) + "|")
    for name in names:
        if not (DATA / name).is_dir():
            print(f"| {name} | skipped: no {DATA / name} |")
            continue
        print("| " + " | ".join(row(name, diagnose(read_recordings(DATA / name)))) + " |", flush=True)


def row(name: str, found: Diagnosis) -> tuple[str, ...]:
    by = {p.name: p for p in predictions(found)}
    simulated = by.get("critical_gain_x2_simulated")
    lab = by.get("critical_gain_x2_trajectory")
    unnamed = [] if found.unnamed is None else [f"unnamed on {found.unnamed.where}: {found.unnamed.acts_on}"]
    return (
        name,
        found.verdict.replace("_", " "),
        "; ".join(
            [f"{f.id}@{f.where} " + ", ".join(f"{n} = {e}" for n, e in f.parameters.items()) for f in found.findings]
            + unnamed
        )
        or "–",
        "; ".join(f"{t.id}@{t.where}" for f in found.findings for t in f.ties) or "–",
        f"{found.before_rms:.2f} → {found.after_rms:.2f} ({found.floor_rms:.2f}) {found.unit}",
        "–" if simulated is None else f"{words.interval(simulated.before)} → {words.interval(simulated.after)}",
        "–"
        if lab is None
        else f"{words.interval(lab.before)} → {words.interval(lab.after)}; {lab.measured or 'not tried'}",
        str(len([f for f in found.faults if f.id != "saturation"])),
        f"{found.seconds:.0f}",
        # in kB on Linux
        f"{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f}",
    )
