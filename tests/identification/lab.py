"""A small simulated data set for the tests of identification: known truth, encoder counts, rough track."""

from dataclasses import replace

import numpy as np

from flexdrive_gym import Drive, Excitation
from flexdrive_gym.references import sine, square
from tests.drive.drives import RIG

QUANTUM = 0.0046592
T = np.arange(4001) * 1e-3
COUNTS = {f"encoder_quantisation.encoder_{i}.quantum": QUANTUM for i in (1, 2)}


def run(drive: Drive, kind: str, amplitude: float, frequency: float, *, t=T, force=0.0, seed=0, name=""):
    """One open-loop recording; ``force`` is the rms of a white force that the command does not show [V]."""
    u = (square if kind == "square" else sine)(t, amplitude, frequency)
    noise = force * np.random.default_rng(seed).normal(size=len(t))
    made = drive.simulate(t, u + noise, name=name or f"{kind}_{amplitude}V_{frequency}Hz_{seed}")
    return replace(made, u=u, x1=None, x2=None, excitation=Excitation(kind, amplitude, frequency))


def data_set(drive: Drive | None = None, *, force=0.1):
    rig = drive or Drive({**RIG, **COUNTS})
    runs = [run(rig, "square", a, 0.5, force=force, seed=i) for i, a in enumerate((1.5, 2.0))]
    return runs + [run(rig, "sine", 2.5, f, force=force, seed=10 + i) for i, f in enumerate((0.5, 2.0, 3.0, 5.0))]
