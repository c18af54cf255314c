"""The table of docs/recordings.md: what ``flexdrive check`` understands of folders as their owners left them.

``python -m benchmarks recordings`` looks for them in ``../shared/recordings`` beside the repository. What a rig's columns mean
stands in its entry of :mod:`baselines.real_rigs`; the ECP's spring to the frame, which is concealed there, is known here.
"""

import time
from collections import Counter
from pathlib import Path

from baselines.real_rigs.entries import RIGS as ENTRIES
from identification import Check, check, identify, read_recordings
from identification.readiness.identifiability import short
from identification.recordings.rig import parse_rig

ROOT = Path(__file__).parents[1]
DATA = ROOT.parent / "shared" / "recordings"

ECP = """
[rig]
known = ["ground_spring"]                       # cart 1 has a spring to the frame
[units]
u = { unit = "V", factor = 0.001221 }           # 819 units of the converter per volt
x1 = { unit = "mm", factor = 0.004413 }         # 226.6 counts per millimetre
x2 = { unit = "mm", factor = 0.004413 }
"""
RIGS = {
    "mte360_2025_raw": "",
    "ecp210_2025": ECP,
    **{name: str(ENTRIES[name].rig) for name in ("lugre_servo", "quanser_2dsfl", "hsm150")},
    "mte360_2022": "",
    "emps": "",
}
TWICE = ("mte360_2025", "mte360_2025_raw")
BOTH = ("mte360_2022", "mte360_2025")
MANY = 100


def main() -> None:
    if not DATA.is_dir():
        print("skipped: no recordings in ../shared/recordings")
        return
    titles = [
        "folder",
        "rig.toml, lines",
        "read",
        "left out",
        "experiments",
        "sessions",
        "fitted",
        "determined",
        "ready",
        "time [s]",
    ]
    print("| " + " | ".join(titles) + " |")
    print("|---" * len(titles) + "|")
    for name, rig in RIGS.items():
        print("| " + " | ".join(row(name, rig)) + " |")
    print()
    twice()
    merged()
    many()


def row(name: str, rig: str) -> list[str]:
    begin = time.perf_counter()
    found = check(DATA / name, rig=parse_rig(rig))
    seconds = time.perf_counter() - begin
    lines = sum(1 for line in rig.splitlines() if line.strip() and not line.startswith("["))
    sessions = ", ".join(f"{session}: {n}" for session, n in found.sessions.items())
    yes, no = ([short(n) for n, ok in determined(found).items() if ok is wanted] for wanted in (True, False))
    return [
        f"`{name}`",
        str(lines),
        str(len(found.recordings)),
        str(len(found.read.skipped)),
        experiments(found),
        sessions,
        "0" if found.found is None else str(found.found.available),
        (", ".join(yes) or "nothing") + (f"; not {', '.join(no)}" if no else ""),
        "yes" if found.ready else found.line(),
        f"{seconds:.1f}",
    ]


def determined(found: Check) -> dict[str, bool]:
    return {} if found.found is None else found.found.determined


def experiments(found: Check) -> str:
    """Say which experiments there are and how many of each."""
    words = {"p_control": "P-control", "closed_loop": "closed loop", "free_decay": "free decay"}
    kinds: Counter[str] = Counter()
    for item in found.recordings:
        held = "".join(f", cart {cart} held" for cart in item.held)
        kind = "reference as command" if item.reference else words.get(item.experiment, item.experiment)
        kinds[kind + held] += 1
    return "; ".join(f"{n} {kind}" for kind, n in kinds.items())


def twice() -> None:
    """Print that a folder as it was left gives what the same recordings give after somebody tidied them."""
    tidy, raw = (identify(DATA / name).quantities for name in TWICE)
    apart = {n: abs(raw[n].value - q.value) / (0.5 * (q.ci95[1] - q.ci95[0])) for n, q in tidy.items() if q.ci95}
    worst = max(apart, key=lambda n: apart[n])
    print(
        f"`identify` of {TWICE[1]} and of {TWICE[0]} differ most in {worst}, by {apart[worst]:.2g} of its 95 % half width."
    )


def merged() -> None:
    found = check([DATA / name for name in BOTH])
    assert found.comparison is not None
    header, rows = found.comparison.table(found.units)
    print(f"\n`flexdrive check {' '.join(BOTH)}`: {found.comparison.sentence()}\n")
    print("| " + " | ".join(header) + " |")
    print("|---" * len(header) + "|")
    for cells in rows:
        print("| " + " | ".join(cells) + " |")
    print(f"\n{found.line()}")


def many() -> None:
    """Print how long a check of a hundred recordings takes, reading included."""
    begin, busy = time.perf_counter(), time.process_time()
    folders = sorted((DATA / "blind").iterdir())
    files = [path for folder in folders for path in sorted(folder.glob("*.csv.gz"))][:MANY]
    runs = read_recordings(files)
    found = check(runs)
    took, used = time.perf_counter() - begin, time.process_time() - busy
    print(f"\nA check of {len(found.recordings)} recordings took {took:.1f} s and {used:.1f} s of processor time.")
