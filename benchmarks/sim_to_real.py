"""Agents trained on the tied, the free and the diagnosed drive, on concealed rigs: ``python -m benchmarks sim_to_real --rigs N``.

Each rig costs a diagnosis and three trainings per seed. What is done already is kept in the folder, so a run goes on where it was
stopped. ``--study DIR`` takes the rigs and diagnoses of a concealed trial (``flexdrive blind -o DIR``, or one that lies in
``docs/trial``) instead of making its own.
"""

import argparse
import json
import time
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

from baselines.blind_study.one import conduct, opened
from baselines.blind_study.plan import Trial, plan
from baselines.blind_study.sim_to_real import Gap, closings, gaps, mean_gaps
from baselines.blind_study.study import outcomes, settings
from baselines.rig_simulator.truth import Truth, draw_truth
from baselines.rl.agents import load_agent
from flexdrive_gym import Drive
from flexdrive_gym.drive.toml import loads

DRIVES = ("tied", "free", "diagnosed")
# a plan depends on its length; with a fixed one, what a folder holds stays the same rig's however many are asked for
TRIALS = 400


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks sim_to_real", description=__doc__)
    parser.add_argument("name", help=argparse.SUPPRESS)
    parser.add_argument("--rigs", type=int, default=4, help="how many concealed rigs")
    parser.add_argument("--steps", type=int, default=500_000, help="of each training")
    parser.add_argument("--seeds", type=int, default=1, help="trainings on each drive; errors are means over them")
    parser.add_argument("--study", type=Path, help="folder of a concealed trial, whose diagnoses are taken")
    parser.add_argument(
        "--seed", type=int, default=0, help="of the rigs and the trainings; each needs a folder of its own"
    )
    parser.add_argument("--folder", type=Path, default=Path("sim_to_real"), help="for what is found on the way")
    given = parser.parse_args()
    found = []
    print(
        "| rig | conceals | drive | promised [mm] | on the rig [mm] | gap [mm] | stable |\n" + "|---" * 7 + "|",
        flush=True,
    )
    answered = {} if given.study is None else _answered(given.study)
    for trial, truth in _rigs(given.rigs, given.seed, given.study, answered):
        outcome = answered.get(trial.number) or _conducted(trial, given.folder)
        if outcome["answer"] is None:
            print(f"| {trial.number} | no drives: {outcome['failed']} | | | | | |", flush=True)
            continue
        drives = {name: loads(outcome["answer"]["drives"][name]) for name in DRIVES}
        one = _one(trial, truth, drives, given.folder, given.steps, range(given.seed, given.seed + given.seeds))
        found.append(one)
        conceals = ", ".join(f"{e.id} at {e.where}" for e in truth.effects)
        for g in one:
            reached, gap = ("–", "–") if g.reached is None or g.gap is None else (f"{g.reached:.2f}", f"{g.gap:.2f}")
            print(
                f"| {trial.number} | {conceals} | {g.drive} | {g.promised:.2f} | {reached} | {gap} | "
                f"{'yes' if g.stable else 'no'} |",
                flush=True,
            )
    for c in closings(found):
        print(
            f"{c.better} against {c.other}, {c.closed.n} rigs: share of the gap closed {c.closed} (aim 0.5), "
            f"rms on the rig {c.ratio} times as large"
        )


def _answered(study: Path) -> dict[int, Mapping[str, Any]]:
    """Return the outcomes of a study by the trials' numbers."""
    asked = settings(study)
    return {o["trial"]["number"]: o for o in outcomes(study, plan(asked["trials"], asked["seed"]))}


def _conducted(trial: Trial, folder: Path) -> Mapping[str, Any]:
    """Return the outcome of a trial that this benchmark conducts itself, or has."""
    if not opened(folder, trial.number).is_file():
        conduct(trial, folder)
    found: Mapping[str, Any] = json.loads(opened(folder, trial.number).read_text())
    return found


def _rigs(number: int, seed: int, study: Path | None, answered: Collection[int]) -> list[tuple[Trial, Truth]]:
    """Return the first trials whose rig conceals effects of the catalogue, as the study's payoff takes them."""
    found: list[tuple[Trial, Truth]] = []
    asked = {"trials": TRIALS, "seed": seed} if study is None else settings(study)
    for t in plan(asked["trials"], asked["seed"]):
        if study is not None and t.number not in answered:
            continue
        truth = draw_truth(t.seed, t.kind, size=t.size, effect=t.effect)
        if len(found) < number and truth.effects and all(e.where != "outside" for e in truth.effects):
            found.append((t, truth))
    return found


def _one(
    trial: Trial, truth: Truth, drives: Mapping[str, Drive], folder: Path, steps: int, seeds: Sequence[int]
) -> tuple[Gap, ...]:
    """Train on each of a rig's drives, and run the agents on it."""
    from baselines.rl.training import AGENT, Plan, train  # torch is needed for trainings only

    found = []
    for seed in seeds:
        agents = {}
        for name, drive in drives.items():
            place = folder / "agents" / f"{trial.number:04d}-{name}-{steps}-{seed}"
            if not (place / AGENT).is_file():
                begin = time.perf_counter()
                train(drive, Plan(steps=steps, seed=seed), place, name=name)
                print(
                    f"<!-- rig {trial.number}, {name}: trained for {time.perf_counter() - begin:.0f} s -->", flush=True
                )
            agents[name] = load_agent(place / AGENT)
        found.append(gaps(truth, drives, agents))
    return mean_gaps(found)
