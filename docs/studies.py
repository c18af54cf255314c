"""``python docs/studies.py`` writes the figures of the studies in docs/trial to docs/trial/studies.csv, one row a study.

Rows of other studies stay as they are. The column ``outcomes`` says where the history of this repository has their outcomes.
``python docs/studies.py --together begun_25 begun_26`` prints what studies of that table count together, with 95 % intervals.
"""

import argparse
import csv
import io
import re
from collections.abc import Iterable
from pathlib import Path

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
        if all(counts):
            hits, of = (sum(int(c[i]) for c in counts if c) for i in (1, 2))
            found[what] = str(share([True] * hits + [False] * (of - hits)))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--together", nargs="+", choices=[r["study"] for r in rows()], metavar="STUDY")
    if asked := parser.parse_args().together:
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
