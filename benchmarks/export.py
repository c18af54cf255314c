"""How far exports are from our own runs: drives in Octave and MuJoCo, controllers and agents in C99 and Octave."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from baselines.controllers import FAMILIES, design
from baselines.export import (
    Difference,
    Missing,
    arithmetic,
    export_agent,
    export_linear,
    export_matlab,
    export_mujoco,
    verify_controller,
    verify_matlab,
    verify_mujoco,
)
from baselines.rl.agents import agent_names, find_agent
from flexdrive_gym import DEFAULT_DRIVE, Drive
from flexdrive_gym.files import write_atomically
from tests.drive.drives import RIG

PAGE = Path(__file__).parents[1] / "docs" / "export_measured.md"
# every kind of effect: friction, memory, states, delays, sensors
EFFECTS = {
    "stribeck.cart_1.extra": 0.1, "presliding.cart_2.fd": 0.1, "hardening_spring.k3": 4e-5, "amplifier_lag.tau": 0.003,
    "input_delay.tau": 0.0023, "motor_gear_backlash.mass": 1e-4, "base_recoil.compliance": 5e-3, "encoder_play.encoder_1.g": 0.2,
}  # fmt: skip


def _rows(verify: Callable[[], Sequence[Difference]]) -> list[list[str]]:
    try:
        return [
            [
                d.case,
                d.signal,
                f"{d.largest:.1e} {d.unit}",
                f"{d.relative:.1e}" if d.case != "at rest" else "–",
                f"{d.equal} of {d.samples}",
            ]
            for d in verify()
        ]
    except Missing as missing:
        return [[str(missing), "", "", "", ""]]


def _table(title: str, rows: Sequence[Sequence[str]]) -> list[str]:
    head = "| run | signal | largest difference | of the peak | samples equal in all bits |"
    return [f"## {title}", "", head, "|---|---|---|---|---|", *(f"| {' | '.join(row)} |" for row in rows), ""]


def _code(to: str) -> list[list[str]]:
    rows = []
    for name in FAMILIES:
        law = design(name, DEFAULT_DRIVE).controller
        made = export_linear(law, "controller", to)
        (row,) = _rows(lambda law=law, made=made: verify_controller(law, DEFAULT_DRIVE, made, "controller", to))
        rows.append([f"{name}, {row[0]}", *row[1:]])
    for name in agent_names():
        agent = find_agent(name)
        made = export_agent(agent, "controller", to, drive=DEFAULT_DRIVE)
        (row,) = _rows(lambda agent=agent, made=made: verify_controller(agent, DEFAULT_DRIVE, made, "controller", to))
        rows.append([f"agent {name}, {row[0]}", *row[1:]])
    return rows


def _tangent() -> str:
    x = np.concatenate([np.linspace(-22.0, 22.0, 200_001), np.geomspace(1e-300, 1.0, 100_000)])
    exact = np.tanh(x.astype(np.longdouble))
    unit = np.spacing(np.maximum(np.abs(exact.astype(float)), 1e-307))
    ours, library = (np.abs(y - exact) / unit for y in (arithmetic.tanh(x), np.tanh(x)))
    ours_most, library_most = float(ours.max()), float(library.max())
    return (
        f"The written-out tanh errs by at most {ours_most:.1f} units in the last place, numpy's by {library_most:.1f} "
        f"({len(x)} arguments, against extended precision)."
    )


def main() -> None:
    plain = Drive({**RIG, "saturation.limit": 8.0})
    rich = plain.replace(EFFECTS)
    lines = ["# Exports, measured", "", "Made by `python -m benchmarks export`; [what is compared](export.md).", ""]
    for title, drive in (("without further effects", plain), ("with eight effects", rich)):
        made = export_matlab(drive, "rig")
        lines += _table(f"Drive in Octave, {title}", _rows(lambda d=drive, m=made: verify_matlab(d, m, "rig")))
    made = export_mujoco(plain, "rig")
    lines += _table("Drive in MuJoCo, without further effects", _rows(lambda: verify_mujoco(plain, made)))
    for to, tool in (("c", "C99"), ("matlab", "Octave")):
        lines += _table(f"Controllers and agents in {tool}", _code(to))
    lines += [_tangent(), ""]
    text = "\n".join(lines)
    print(text)
    write_atomically(PAGE, text)
