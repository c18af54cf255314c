"""``python docs/studies.py`` writes the figures of the studies in docs/trial to docs/trial/studies.csv, one row a study.

Rows of other studies stay as they are. The column ``outcomes`` says where the history of this repository has their outcomes.
"""

import csv
import io
from pathlib import Path

from baselines.blind_study.judge import judge
from baselines.blind_study.plan import plan
from baselines.blind_study.study import outcomes, settings
from baselines.blind_study.summary import headline, summarise
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


def main() -> None:
    known = {r["study"]: r for r in rows()} if TABLE.exists() else {}
    for folder in sorted(p.parent for p in FOLDER.glob("*/study.json")):
        known[folder.name] = {**known.get(folder.name, {}), **row(folder)}
    out = io.StringIO()
    writer = csv.DictWriter(out, list(dict.fromkeys(name for r in known.values() for name in r)), lineterminator="\n")
    writer.writeheader()
    writer.writerows(known.values())
    write_atomically(TABLE, out.getvalue())


if __name__ == "__main__":
    main()
