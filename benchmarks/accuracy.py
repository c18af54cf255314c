"""Error of the compiled step over step sizes, against event-driven integration by another library; of fast effects, by itself."""

from pathlib import Path

import numpy as np

from flexdrive_gym import Drive
from flexdrive_gym.drive import parameters
from flexdrive_gym.files import write_atomically
from identification.replay.output_error import PHYSICS_S, Run, prepare, simulate_run
from tests.drive.drives import RIG, true_states
from tests.drive.reference import TwoMasses

STEPS_MS = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
PAGE = Path(__file__).parents[1] / "docs" / "accuracy.md"
HEAD = """# Accuracy of the compiled step

Largest error of v1 and v2 over 4 s, relative to peak velocity, by step size:

"""
MIDDLE = """

The error falls with the fourth power of the step, through sticking and reversals too. A cart at rest below its friction
level does not move at all: `tests/drive/test_step.py` checks that over 10 s.

## Fast effects

Effects that are faster than the drive take shorter steps, as many as their fastest rate asks for (`fastest_rate`). Error of the
means over 5 ms of v1 and v2 [mm/s], rms per drive, over drives that are drawn:

"""
TAIL = """

An encoder of 0.026 mm per count rounds such a mean by 2 mm/s rms. The contact of a motor behind its gap opens and closes within
steps, which no event bounds.

## How to

`python -m benchmarks accuracy` writes this page.

## Method

- The rig is that of `tests/drive/drives.py`: m1 = 7.6e-4, m2 = 3.4e-4 V s²/mm, b1 = 0.0096, b2 = 0.0032 V s/mm,
  d1 = 0.357, d2 = 0.241 V, k = 0.095 V/mm.
- Expected values come from an event-driven integration that shares no code with the package: scipy's DOP853 at 1e-11
  with one right-hand side per stick–slip mode (`tests/drive/reference.py`).
- The command is held for 8 ms in every column, so that all step sizes integrate the same input.
- The step locates the instants of sticking and reversal within itself (`flexdrive_gym/drive/step.py`).
- Drives with fast effects are drawn around that rig, masses and friction within a factor of three, until their fastest rate is
  between 1,000 and 5,000 1/s, which is the fastest that a search follows. They are compared with the same step, sixteen times
  as short at least.
"""
# ranges of fast effects, drawn evenly by their logarithms: (lowest, highest)
FAST = {
    "extra_mode": {"mass_1": (1e-5, 1e-3), "frequency": (2.0, 200.0), "zeta": (0.01, 1.0)},
    "base_recoil": {"compliance": (1e-3, 0.2), "frequency": (10.0, 200.0), "zeta": (0.01, 1.0)},
    "amplifier_lag": {"tau": (3e-5, 2e-3)},
    "motor_gear_backlash": {"mass": (1e-5, 5e-4), "gap": (0.01, 1.0), "kc": (1.0, 500.0)},
    "spring_hysteresis": {"level": (0.01, 0.5), "xs": (0.13, 3.0)},
}
SLOWEST, FASTEST = 1e3, 5e3


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


def drawn(effect: str, rng: np.random.Generator) -> dict[str, float]:
    """Return a drive that an effect makes fast."""
    while True:
        rig = {name: value * float(np.exp(rng.uniform(-1.1, 1.1))) for name, value in RIG.items()}
        own = {k: float(np.exp(rng.uniform(*np.log(limits)))) for k, limits in FAST[effect].items()}
        values = {**rig, **{(f"{effect}.{k}"): v for k, v in own.items()}}
        if SLOWEST < parameters.fastest(values)[0] <= FASTEST:
            return values


def motions() -> list[Run]:
    t = np.arange(2000) * 1e-3
    commands = [2.5 * np.sin(2 * np.pi * 5 * t), np.where(t % 0.5 < 0.25, 2.0, -2.0)]
    return [prepare(Drive(RIG).simulate(t, u)) for u in commands]


def rows(values: dict[str, float], run: Run, step: float) -> np.ndarray:
    return np.array([v.reshape(-1, 5).mean(axis=1) for v in simulate_run(values, run, step)])


def fast_errors(effect: str, draws: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Return rms errors of drives that are drawn, and what the effect changes, shape (draws,) each [mm/s]."""
    rng, runs, errors, changes = np.random.default_rng(seed), motions(), [], []
    for _ in range(draws):
        values = drawn(effect, rng)
        without = {k: v for k, v in values.items() if "." not in k}
        parts = [
            [rows(drive, run, step) for run in runs]
            for drive, step in ((values, PHYSICS_S), (values, PHYSICS_S / 80.0), (without, PHYSICS_S))
        ]
        found, exact, plain = (np.concatenate(part, axis=1) for part in parts)
        errors.append(np.sqrt(np.mean((found - exact) ** 2)))
        changes.append(np.sqrt(np.mean((plain - exact) ** 2)))
    return np.array(errors), np.array(changes)


def fast_table(draws: int = 200) -> str:
    lines = ["| effect | median | 90 % | largest | median of what the effect changes |", "|---|---|---|---|---|"]
    for effect in FAST:
        errors, changes = fast_errors(effect, draws)
        numbers = [*np.quantile(errors, [0.5, 0.9]), errors.max(), np.median(changes)]
        lines.append(f"| `{effect}` | " + " | ".join(f"{x:.2g}" for x in numbers) + " |")
    return "\n".join(lines)


def main() -> None:
    rows = table()
    head = "| command | " + " | ".join(f"{s:g} ms" for s in STEPS_MS) + " | order 1 → 2 ms |"
    lines = [head, "|---|" + "---|" * (len(STEPS_MS) + 1)]
    for name, errors in rows:
        order = np.log2(errors[STEPS_MS.index(2.0)] / errors[STEPS_MS.index(1.0)])
        lines.append(f"| {name} | " + " | ".join(f"{e:.1e}" for e in errors) + f" | {order:.1f} |")
    text = "\n".join(lines)
    fast = fast_table()
    print(text, fast, sep="\n\n")
    write_atomically(PAGE, HEAD + text + MIDDLE + fast + TAIL)
