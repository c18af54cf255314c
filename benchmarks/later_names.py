"""Which names are wrong, and how much names that follow others gain of what these gained.

``python -m benchmarks later_names STUDY [STUDY ...]``: each is a folder of ``flexdrive blind``; those of older studies are in the
history (docs/trial/studies.csv says where). Data sets that conceal what is outside the catalogue are left out: every name is
that of what is near there. A gain is told by the share of the squared error that it takes of what was left.
"""

import argparse
import sys
from pathlib import Path
from typing import Any

from baselines.blind_study.judge import Judged, judge
from baselines.blind_study.plan import plan
from baselines.blind_study.study import outcomes, settings


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks later_names", description=__doc__)
    parser.add_argument("study", type=Path, nargs="+")
    first, later = list[bool](), list[tuple[float, bool, str]]()
    for study in parser.parse_args(sys.argv[2:]).study:
        asked = settings(study)
        for outcome in outcomes(study, plan(asked["trials"], asked["seed"])):
            verdict = judge(outcome)
            if outcome["answer"] and verdict.outside is None:
                of = f"{study.name}, {outcome['trial']['number']}"
                for i, (share, right, name) in enumerate(_names(verdict, outcome["answer"]["diagnosis"]["findings"])):
                    if i == 0:
                        first.append(right)
                    else:
                        later.append((share, right, f"{name} ({of})"))
    print(f"first names: {len(first) - sum(first)} of {len(first)} wrong")
    print(
        f"later names: {sum(not right for _, right, _ in later)} of {len(later)} wrong; gain of what was gained before:\n"
    )
    print("| share | | name |\n|---|---|---|")
    for share, right, name in sorted(later):
        print(f"| {share:.2%} | {'right' if right else 'wrong'} | {name} |")


def _names(verdict: Judged, findings: list[dict[str, Any]]) -> list[tuple[float, bool, str]]:
    """Return every finding's gain over that of all before it, whether it is right, and its name."""
    gained, left, found = 0.0, 1.0, []
    for f in findings:
        own, name = left * f["share_of_error_explained"], f"{f['id']}@{f['where']}"
        found.append((own / gained if gained else 1.0, name not in verdict.false_names, name))
        gained, left = gained + own, left - own
    return found
