"""``python -m baselines.rl.make_agents [NAME ...]``: train the ready-trained agents that are missing, or those named."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from baselines.rl.agents import FOLDER
from baselines.rl.training import AGENT, CARD, Plan, train
from flexdrive_gym import DEFAULT_DRIVE
from flexdrive_gym.files import write_atomically

SEEDS = range(5)
PLANS = {f"{feedback}-{seed}": Plan(feedback, seed) for feedback in ("x2", "x1") for seed in SEEDS}


def main() -> None:
    """Train one after the other on the documented default drive; write each with its card."""
    for name in sys.argv[1:] or [name for name in PLANS if not (FOLDER / f"{name}.npz").exists()]:
        with tempfile.TemporaryDirectory() as scratch:
            folder = Path(scratch)
            score = train(DEFAULT_DRIVE, PLANS[name], folder, name=name).agent.card["score"]
            write_atomically(FOLDER / f"{name}.toml", (folder / CARD).read_bytes())
            write_atomically(FOLDER / f"{name}.npz", (folder / AGENT).read_bytes())
        print(f"{name}: {score}", flush=True)


if __name__ == "__main__":
    main()
