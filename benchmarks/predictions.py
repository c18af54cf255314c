"""How often the predicted interval of the critical gain holds what the concealed rig does, and how wide it is.

``python -m benchmarks predictions STUDY``: STUDY is a folder of ``flexdrive blind``. The drives of its answers predict the gain
at which the handout's first move grows on another run; the rig's own gain is in the outcome of its trial.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
from rich.progress import track
from scipy.stats import binomtest

from baselines.blind_study.plan import plan
from baselines.blind_study.study import outcomes, settings
from baselines.lab.uncertainty import Predicted, predict
from flexdrive_gym.drive.toml import loads

NAME = "critical_gain_x2_simulated"
DRIVES = {"free": "base model", "diagnosed": "diagnosed drive"}


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks predictions", description=__doc__)
    parser.add_argument("study", type=Path)
    study = parser.parse_args(sys.argv[2:]).study
    asked = settings(study)
    found = [o for o in outcomes(study, plan(asked["trials"], asked["seed"])) if o["answer"] and o["critical_gain"]]
    print(f"{len(found)} rigs, gain at which the first move grows:\n")
    print(
        "| | interval holds the rig's gain | where not extrapolated | median high/low | median error |\n|---|---|---|---|---|"
    )
    for key, words in DRIVES.items():
        told = [predict(loads(o["answer"]["drives"][key]), [NAME])[NAME] for o in track(found, description=words)]
        print(_row(words, told, [o["critical_gain"] for o in found]))


def _row(words: str, told: list[Predicted], gains: list[float]) -> str:
    held = [_holds(p, gain) for p, gain in zip(told, gains, strict=True)]
    near = [h for h, p in zip(held, told, strict=True) if p.extrapolated is None]
    ratios = [p.ci95[1] / p.ci95[0] for p in told if p.ci95 and p.ci95[0] and p.ci95[1]]
    errors = [abs(p.value / gain - 1.0) for p, gain in zip(told, gains, strict=True) if p.value]
    width = f"{np.median(ratios):.2f}" if ratios else "–"
    return f"| {words} | {_share(held)} | {_share(near)} | {width} | {np.median(errors):.1%} |"


def _holds(told: Predicted, gain: float) -> bool:
    if told.ci95 is None:
        return False
    low, high = told.ci95
    return (low is None or low <= gain) and (high is None or gain <= high)


def _share(held: list[bool]) -> str:
    if not held:
        return "–"
    low, high = binomtest(sum(held), len(held)).proportion_ci(method="wilson")
    return f"{sum(held)} of {len(held)} = {np.mean(held):.0%} ({low:.0%} … {high:.0%})"


if __name__ == "__main__":
    main()
