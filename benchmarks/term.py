"""A term whose truth is known: hand-ins of simulated rigs of the independent program, examined, and compared with the truth.

``python -m benchmarks term -o DIR [--groups 12] [--seed 1] [--no-diagnose] [--backend dask --scheduler ADDRESS]``

Rigs of one course differ by 2 % in masses and spring, 5 % in viscous and 8 % in dry friction (assumed); their data sets
are as rough as those of the blind study. Four things are wrong on purpose, and one rig conceals an effect;
``DIR/truth.json`` says which.
"""

import argparse
import json
import shutil
import subprocess
import sys
import time
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from baselines.rig_simulator.recordings import as_text, data_set, write_data_set
from baselines.rig_simulator.truth import draw_truth

NOMINAL = {"m1": 7.6e-4, "m2": 3.4e-4, "b1": 9.5e-3, "b2": 3.2e-3, "k": 0.096, "d1": 0.36, "d2": 0.25}
SPREAD = {"m": 0.02, "k": 0.02, "b": 0.05, "d": 0.08}
FRICTION = 1.8
EFFECT = ("ground_spring", "guide")
LEAST = 6


def make_term(folder: Path, groups: int, seed: int) -> dict:
    """Write the hand-ins of a term into a folder; return the truth."""
    rng = np.random.default_rng([seed, 32])
    stiff, swapped, copied, broken, conceals = 3, 4, 5, 6, 2
    truth: dict = {"groups": {}, "expected": {}}
    first = ()
    for n in range(1, groups + 1):
        name, home = f"group {n}", folder / f"group {n}"
        drive = {k: v * float(np.exp(SPREAD[k[0]] * rng.standard_normal())) for k, v in NOMINAL.items()}
        if n == stiff:
            drive["d1"] *= FRICTION
            truth["expected"][name] = ["parameter", "d1"]
        effect = EFFECT if n == conceals else None
        made = draw_truth(int(rng.integers(2**31)), "effect" if effect else "null", size=2.0, effect=effect)
        made, logs = data_set(replace(made, drive=drive))
        truth["groups"][name] = {"drive": drive, "effect": effect, "nuisance": vars(made.nuisance)}
        if n == swapped:
            logs = tuple(replace(log, counts=log.counts * np.array([[1], [-1]])) for log in logs)
            truth["expected"][name] = ["sign", "encoder_2"]
        if n == copied:
            # under other names, as text, in a folder of their own
            logs = first
            truth["expected"][name] = ["copy", "group 1"]
        for log in logs if n == copied else ():
            home.mkdir(parents=True, exist_ok=True)
            (
                home / f"our_{log.experiment.kind}_{log.experiment.frequency:g}_{len(list(home.iterdir()))}.csv"
            ).write_text(as_text(log))
        if n != copied:
            write_data_set(made, logs, home / ("lab session" if n % 3 == 1 else ""))
        if n == 1:
            first = logs
        if n == broken or n % 4 == 0:
            _zip(home, cut=n == broken, nested=n % 8 == 0)
        if n == broken:
            truth["expected"][name] = ["skipped", ""]
    return truth


def _zip(home: Path, *, cut: bool, nested: bool) -> None:
    archive = home.with_suffix(".zip")
    with zipfile.ZipFile(archive, "w") as made:
        for file in sorted(home.rglob("*.gz")):
            made.write(file, file.relative_to(home.parent))
    shutil.rmtree(home)
    if cut:
        archive.write_bytes(archive.read_bytes()[: archive.stat().st_size // 2])
    if nested:
        home.mkdir()
        with zipfile.ZipFile(home / "submission.zip", "w") as outer:
            outer.write(archive, archive.name)
        archive.unlink()


def compared(found: dict, truth: dict) -> tuple[list[str], bool]:
    """Return what was found of what is wrong on purpose, and whether that and nothing else stands out."""
    stood = {(o["group"], o["kind"], o["what"]) for o in found["outliers"]}
    stood |= {(g["name"], "skipped", "") for g in found["groups"] if g["status"] == "skipped"}
    wanted = {(name, *what) for name, what in truth["expected"].items()}
    lines = [f"{'found ' if w in stood else 'MISSED'} {' '.join(w).strip()}" for w in sorted(wanted)]
    lines += [f"FALSE  {' '.join(s)}" for s in sorted(stood - wanted)]
    inside = total = 0
    for g in found["groups"]:
        if g["status"] != "ok" or g["name"] in [n for n, w in truth["expected"].items() if w[0] == "copy"]:
            continue
        for name, p in g["parameters"].items():
            low, high = p["ci95"]
            inside += low <= truth["groups"][g["name"]]["drive"][name] <= high
            total += 1
    lines.append(f"true parameters within their 95 % intervals: {inside} of {total}")
    for s in found["random_effects"]:
        lines.append(
            f"sd of {s['parameter']} between {s['between']}: {s['sd_log']:.3f} [{s['ci95'][0]:.3f}, {s['ci95'][1]:.3f}]"
            + (f", true {_true_rig_spread(truth, s['parameter']):.3f}" if s["between"] == "rigs" else "")
        )
    named = {g["name"]: [f["id"] for f in g["findings"]] for g in found["groups"] if g["findings"]}
    lines.append(
        f"named: {named}; concealed: { {n: g['effect'][0] for n, g in truth['groups'].items() if g['effect']} }"
    )
    return lines, stood == wanted


def _true_rig_spread(truth: dict, name: str) -> float:
    out = {"copy", "skipped"}
    rigs = [g["drive"][name] for n, g in truth["groups"].items() if truth["expected"].get(n, [""])[0] not in out]
    return float(np.std(np.log(rigs), ddof=1))


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks term", description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=Path("term_benchmark"))
    parser.add_argument("--groups", type=int, default=12)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--no-run", action="store_true", help="make the hand-ins only")
    given, more = parser.parse_known_args(sys.argv[2:])
    if given.groups < LEAST:
        parser.error(f"--groups: must be at least {LEAST}, for as many things are done to them; got {given.groups}")
    hand_ins = given.output / "hand-ins"
    if not (given.output / "truth.json").exists():
        begin = time.perf_counter()
        truth = make_term(hand_ins, given.groups, given.seed)
        (given.output / "truth.json").write_text(json.dumps(truth, indent=1))
        print(f"made {given.groups} hand-ins in {time.perf_counter() - begin:.0f} s")
    if given.no_run:
        return
    command = [
        sys.executable,
        "-m",
        "baselines.cli",
        "term",
        str(hand_ins),
        "-o",
        str(given.output / "out"),
        "--plan",
        "60",
        *more,
    ]
    begin = time.perf_counter()
    subprocess.run(command, check=True)
    print(f"took {time.perf_counter() - begin:.0f} s")
    found = json.loads((given.output / "out" / "term.json").read_text())
    lines, right = compared(found, json.loads((given.output / "truth.json").read_text()))
    print("\n".join(lines))
    print("what stands out is what is wrong" if right else "what stands out is NOT what is wrong")
