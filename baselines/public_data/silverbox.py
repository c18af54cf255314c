"""Silverbox: an electronic circuit that behaves as a mass on a spring to the ground with a cubic term."""

from __future__ import annotations

from dataclasses import replace

from baselines.public_data.benchmark import Benchmark, Published, Rule
from flexdrive_gym.recording import Recording
from identification.recordings import Rig
from identification.recordings.rig import Unit
from identification.topology import grounded

# one volt of output as 100 mm and one of input as 20 V make the spring and its deflection those of the lab; three times slower, a
# sample is 5 ms and the resonance lies at 22 Hz
RIG = Rig(
    name="Silverbox",
    columns={"x1": ("y_V",)},
    units={"x1": Unit("V")},
    scale={"length": 100.0, "command": 20.0, "time": 3.0},
)


def known(recording: Recording) -> Recording:
    """Say that the command was continuous."""
    return replace(recording, hold="band_limited")


SILVERBOX = Benchmark(
    name="silverbox",
    title="Silverbox",
    citation="T. Wigren, J. Schoukens, Three free data sets for development and benchmarking in nonlinear system "
    "identification, ECC 2013",
    train=("*train*",),
    test=("*test*", "*arrow*"),
    rig=RIG,
    known=known,
    topology=grounded("linear oscillator", {"m1": 1e-5, "b1": 1e-4, "k": 0.2}),
    rule=Rule(window=50, unit="mV", per_output=1000.0),
    columns=("multisine", "arrow", "arrow within range"),
    published=(
        Published("linear state space", (6.96, 14.4, 6.58)),
        Published("linear ARX", (6.95, 14.2, 6.59)),
        Published("polynomial NARX", (0.640, 2.25, 0.571)),
        Published("MLP NARX", (2.80, 5.18, 2.40)),
        Published("LSTM", (1.50, 2.68, 0.960)),
        Published("best reported", (0.36, 0.26, 0.32)),
    ),
    blocks=5,
    column_of=lambda r: int("arrow" in r.name),
    without_extrapolation={1: 2},
)
