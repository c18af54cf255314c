"""Error of the compiled step over step sizes, against event-driven integration by another library."""

from pathlib import Path

import numpy as np

from flexdrive_gym import Drive
from flexdrive_gym.files import write_atomically
from tests.drive.drives import RIG, true_states
from tests.drive.reference import TwoMasses

STEPS_MS = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
PAGE = Path(__file__).parents[1] / "docs" / "accuracy.md"
HEAD = """# Accuracy of the compiled step

Largest error of v1 and v2 over 4 s, relative to peak velocity, by step size:

"""
TAIL = """

The error falls with the fourth power of the step, through sticking and reversals too. A cart at rest below its friction
level does not move at all: `tests/drive/test_step.py` checks that over 10 s.

## How to

`python -m benchmarks accuracy` writes this page.

## Method

- The rig is that of `tests/drive/drives.py`: m1 = 7.6e-4, m2 = 3.4e-4 V s²/mm, b1 = 0.0096, b2 = 0.0032 V s/mm,
  d1 = 0.357, d2 = 0.241 V, k = 0.095 V/mm.
- Expected values come from an event-driven integration that shares no code with the package: scipy's DOP853 at 1e-11
  with one right-hand side per stick–slip mode (`tests/drive/reference.py`).
- The command is held for 8 ms in every column, so that all step sizes integrate the same input.
- The step locates the instants of sticking and reversal within itself (`flexdrive_gym/drive/step.py`).
"""


def excitations(t: np.ndarray) -> dict[str, np.ndarray]:
    return {
        "square ±1.5 V, 0.5 Hz": np.where(t % 2.0 < 1.0, 1.5, -1.5),
        "sine 2.5 V, 3 Hz": 2.5 * np.sin(2 * np.pi * 3 * t),
        "stick–slip ±0.6 V, 0.5 Hz": np.where(t % 2.0 < 1.0, 0.6, -0.6),
        "stick–slip sine 0.9 V, 1 Hz": 0.9 * np.sin(2 * np.pi * t),
    }


def table() -> list[tuple[str, list[float]]]:
    hold = 8e-3  # every step size divides the hold of the command, so that all integrate the same input
    t = np.arange(501) * hold
    rows = []
    for name, u in excitations(t).items():
        expected = TwoMasses(**RIG).run(t, u)
        peak = np.abs(expected[[1, 3]]).max()
        errors = []
        for step in STEPS_MS:
            found = true_states(Drive(RIG), u, hold, substeps=round(hold * 1e3 / step))
            errors.append(float(np.abs(found - expected)[[1, 3]].max() / peak))
        rows.append((name, errors))
    return rows


def main() -> None:
    rows = table()
    head = "| command | " + " | ".join(f"{s:g} ms" for s in STEPS_MS) + " | order 1 → 2 ms |"
    lines = [head, "|---|" + "---|" * (len(STEPS_MS) + 1)]
    for name, errors in rows:
        order = np.log2(errors[STEPS_MS.index(2.0)] / errors[STEPS_MS.index(1.0)])
        lines.append(f"| {name} | " + " | ".join(f"{e:.1e}" for e in errors) + f" | {order:.1f} |")
    text = "\n".join(lines)
    print(text)
    write_atomically(PAGE, HEAD + text + TAIL)
