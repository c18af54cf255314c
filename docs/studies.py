"""``python docs/studies.py`` writes the figures of the studies in docs/trial to docs/trial/studies.csv, one row a study.

Rows of other studies stay as they are. The column ``outcomes`` says where the history of this repository has their outcomes.
``python docs/studies.py --together begun_25 begun_26`` prints what studies of that table count together, with 95 % intervals;
``--by-effect begun_25 begun_26`` how many of their concealed effects are named, alone and in pairs, by effect and size.
"""

import argparse
import csv
import gzip
import io
import json
import re
import subprocess
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from baselines.blind_study.judge import judge
from baselines.blind_study.plan import plan
from baselines.blind_study.study import outcomes, settings
from baselines.blind_study.summary import headline, summarise
from baselines.evaluation.proportions import share
from flexdrive_gym.files import write_atomically

FOLDER = Path(__file__).with_name("trial")
TABLE = FOLDER / "studies.csv"


def row(folder: Path) -> dict[str, str]:
    """The figures of a study by their names, as ``flexdrive blind --report`` prints them."""
    asked = settings(folder)
    judged = [judge(outcome) for outcome in outcomes(folder, plan(asked["trials"], asked["seed"]))]
    figures = {what: value for what, value, _aim in headline(summarise(judged))}
    return {"study": folder.name, "seed": str(asked["seed"]), "trials": str(len(judged)), **figures}


def rows() -> list[dict[str, str]]:
    """The rows that the table has."""
    with TABLE.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def together(studies: Iterable[str]) -> dict[str, str]:
    """The shares that studies count together, with their 95 % intervals, by their names."""
    chosen = [r for r in rows() if r["study"] in set(studies)]
    found = {}
    for what in chosen[0]:
        counts = [re.match(r"(\d+) of (\d+)", r[what] or "") for r in chosen]
        # a study without a trial of that kind has a dash
        if any(counts) and all(c or r[what] == "–" for c, r in zip(counts, chosen, strict=True)):
            hits, of = (sum(int(c[i]) for c in counts if c) for i in (1, 2))
            found[what] = str(share([True] * hits + [False] * (of - hits)))
    return found


def kept(study: str) -> Sequence[Mapping[str, Any]]:
    """The outcomes of a study, of a folder that is there or from the history of this repository."""
    command = next(r["outcomes"] for r in rows() if r["study"] == study)
    if not command.startswith("git show "):
        asked = settings(FOLDER / study)
        return outcomes(FOLDER / study, plan(asked["trials"], asked["seed"]))
    packed = subprocess.run(  # noqa: S603
        ["git", "show", command.split()[2]],  # noqa: S607
        cwd=FOLDER,
        capture_output=True,
        check=True,
    ).stdout
    return [json.loads(line) for line in gzip.decompress(packed).splitlines()]


def by_effect(studies: Iterable[str]) -> dict[str, dict[tuple[str, float], list[bool]]]:
    """Whether each concealed effect is named, exactly or in a tie: effect to alone or in a pair, and size."""
    found: dict[str, dict[tuple[str, float], list[bool]]] = defaultdict(lambda: defaultdict(list))
    for study in studies:
        for one in map(judge, kept(study)):
            for effect in one.concealed:
                with_another = "in a pair" if len(one.concealed) > 1 else "alone"
                found[effect.id][with_another, effect.size].append(effect.named in {"exact", "tie"})
    return found


def print_by_effect(studies: Iterable[str]) -> None:
    """Print the table of :func:`by_effect`, from half size on."""
    sizes = [(a, s) for a in ("alone", "in a pair") for s in (0.5, 1.0, 2.0)]
    found = by_effect(studies)
    everything = {key: [hit for each in found.values() for hit in each.get(key, [])] for key in sizes}
    print("| effect | " + " | ".join(f"{a}, size {s:g}" for a, s in sizes) + " |\n|" + "---|" * (1 + len(sizes)))
    for name, each in [*sorted(found.items()), ("all", everything)]:
        cells = (each.get(key, []) for key in sizes)
        print(
            f"| {name.replace('_', ' ')} | " + " | ".join(f"{sum(c)} of {len(c)}" if c else "–" for c in cells) + " |"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--together", nargs="+", choices=[r["study"] for r in rows()], metavar="STUDY")
    there = [r["study"] for r in rows() if r["outcomes"].startswith("git show") or (FOLDER / r["study"]).is_dir()]
    parser.add_argument("--by-effect", nargs="+", choices=there, metavar="STUDY")
    given = parser.parse_args()
    if given.by_effect:
        print_by_effect(given.by_effect)
        return
    if asked := given.together:
        print("\n".join(f"| {what} | {value} |" for what, value in together(asked).items()))
        return
    known = {r["study"]: r for r in rows()}
    for folder in sorted(p.parent for p in FOLDER.glob("*/study.json")):
        known[folder.name] = {**known.get(folder.name, {}), **row(folder)}
    out = io.StringIO()
    writer = csv.DictWriter(out, list(dict.fromkeys(name for r in known.values() for name in r)), lineterminator="\n")
    writer.writeheader()
    writer.writerows(known.values())
    write_atomically(TABLE, out.getvalue())


if __name__ == "__main__":
    main()
