"""Write the bundled sample again: ``python -m baselines.lab.sample.make [FOLDER]``.

A simulated rig with ratios of its own, friction that differs from run to run, a rough track (a coloured force the
recorded command does not show), encoder counts, two encoder faults, and one effect that nobody told the diagnosis of: the
Stribeck effect on cart 1. All from one seed.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from baselines.lab.experiments import FREQUENCIES_HZ, P_CONTROL_S, TRAVEL_MM
from baselines.lab.sample import FOLDER
from baselines.loop_analysis.stability_limit import critical_gain, with_rig
from flexdrive_gym import Drive, Excitation, Observation, Recording
from flexdrive_gym.drive.default import HANDOUT_LIMIT_V
from flexdrive_gym.references import handout_trajectory, sine, square
from identification.recordings import write_recording

SEED = 20
SAMPLE_TIME_S = 1e-3
RIG = Drive(
    {
        "m1": 6.8e-4,
        "m2": 3.3e-4,
        "b1": 0.0098,
        "b2": 0.0024,
        "d1": 0.37,
        "d2": 0.15,
        "k": 0.085,
        # what the diagnosis of the sample has to find
        "stribeck.cart_1.extra": 0.3,
        "stribeck.cart_1.vs": 40.0,
    },
    name="rig of the bundled sample",
)
# sizes of the nuisance are those seen between replicates on real rigs
FRICTION_SPREAD = 0.06
FORCE_V, CORRELATION_S = 0.03, 0.05


class _Disturbed:
    """P-control whose command reaches the drive with a disturbance added; keeps the command itself."""

    def __init__(self, gain: float, feedback: str, force: np.ndarray) -> None:
        self.gain, self.feedback, self.force, self.commands = gain, feedback, force, list[float]()

    def reset(self) -> None:
        self.commands.clear()

    def __call__(self, observation: Observation, /) -> float:
        x = observation.x1 if self.feedback == "x1" else observation.x2
        self.commands.append(float(np.clip(self.gain * (observation.xr - x), -HANDOUT_LIMIT_V, HANDOUT_LIMIT_V)))
        return self.commands[-1] + float(self.force[len(self.commands) - 1])


def coloured_force(n: int, rng: np.random.Generator) -> np.ndarray:
    """Return the force of a rough track that no command shows [V], ndarray, shape (n,)."""
    a = np.exp(-SAMPLE_TIME_S / CORRELATION_S)
    force = np.empty(n)
    force[0] = FORCE_V * rng.normal()
    for i in range(1, n):
        force[i] = a * force[i - 1] + FORCE_V * np.sqrt(1.0 - a * a) * rng.normal()
    return force


def _today(rng: np.random.Generator) -> Drive:
    """The rig as it is in this run: friction differs from run to run."""
    rig = with_rig(RIG)
    return rig.replace({name: rig[name] * (1.0 + FRICTION_SPREAD * rng.normal()) for name in ("d1", "d2", "b1")})


def _open_loop(kind: str, amplitude: float, frequency: float, name: str, rng: np.random.Generator) -> Recording:
    t = np.arange(8001) * SAMPLE_TIME_S
    u = square(t, amplitude, frequency) if kind == "square" else sine(t, amplitude, frequency)
    run = _today(rng).simulate(t, u + coloured_force(len(t), rng), name=name)
    return replace(run, u=u, x1=None, x2=None)


def _p_control(gain: float, feedback: str, name: str, rng: np.random.Generator) -> Recording:
    t = np.arange(round(P_CONTROL_S / SAMPLE_TIME_S) + 1) * SAMPLE_TIME_S
    controller = _Disturbed(gain, feedback, coloured_force(len(t), rng))
    run = _today(rng).simulate_closed_loop(t, handout_trajectory(t), controller, travel_limit=TRAVEL_MM, name=name)
    u = np.array(controller.commands[: run.n])
    return replace(run, u=u, v1=None, v2=None, excitation=Excitation("closed_loop"))


def _frozen(run: Recording, start: float, end: float) -> Recording:
    """Encoder 1 reports nothing for a while, as a loose plug does."""
    assert run.v1 is not None
    dead = (run.t >= start) & (run.t <= end)
    return replace(run, v1=np.where(dead, 0.0, run.v1))


def data_set(seed: int = SEED) -> list[Recording]:
    """Return the recordings of the sample."""
    rng = np.random.default_rng(seed)
    limit = critical_gain(RIG)
    assert limit is not None
    below, above = round(0.85 * limit, 4), round(1.06 * limit, 4)
    runs = [
        _p_control(0.05, "x2", "pctrl_x2_kp0.05", rng),
        _p_control(below, "x2", f"pctrl_x2_kp{below}_critical", rng),
        _p_control(above, "x2", f"pctrl_x2_kp{above}_unstable", rng),
        _p_control(above, "x1", f"pctrl_x1_kp{above}_collocated", rng),
    ]
    runs += [_open_loop("square", a, 0.5, f"square_{a}V_0.5Hz_{c}", rng) for a in (1.5, 2.0) for c in "ab"]
    runs += [_open_loop("sine", 2.5, f, f"sine_2.5V_{f}Hz", rng) for f in FREQUENCIES_HZ]
    names = [r.name for r in runs]
    for name, start, end in (("sine_2.5V_1.0Hz", 2.18, 2.31), ("square_2.0V_0.5Hz_a", 5.30, 5.46)):
        runs[names.index(name)] = _frozen(runs[names.index(name)], start, end)
    return runs


def main() -> None:
    """Write the sample."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER
    for run in data_set():
        write_recording(run, folder / f"{run.name}.csv.gz")


if __name__ == "__main__":
    main()
