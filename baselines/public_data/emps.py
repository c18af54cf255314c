"""EMPS: one carriage on a prismatic joint under closed-loop position control.

The linear carriage is a mass with viscous friction; dry friction and all the rest are for the engine to find.
"""

from __future__ import annotations

from collections.abc import Sequence

from baselines.public_data.benchmark import Benchmark, Published, Rule, piece
from flexdrive_gym.recording import Recording
from identification.recordings import Rig
from identification.topology import Topology


def hold_out(recordings: Sequence[Recording]) -> tuple[tuple[Recording, ...], tuple[Recording, ...]]:
    """Keep the last third of every recording."""
    learn = tuple(piece(r, 0, 2 * r.n // 3, f"{r.name}, first two thirds") for r in recordings)
    return learn, tuple(piece(r, 2 * r.n // 3, r.n, f"{r.name}, last third") for r in recordings)


EMPS = Benchmark(
    name="emps",
    title="Electro-mechanical positioning system",
    citation="A. Janot, M. Gautier, M. Brunot, Data set and reference models of EMPS, 2019",
    train=("*train*",),
    test=("*test*",),
    rig=Rig(name="EMPS", carts=1),
    topology=Topology("linear carriage", 1, ("m1", "b1")),
    rule=Rule(window=20, unit="mm"),
    columns=("EMPS",),
    published=(
        Published("linear state space", (5.53,)),
        Published("linear ARX", (12.6,)),
        Published("polynomial NARX", (5.17,)),
        Published("MLP NARX", (133.0,)),
        Published("LSTM", (74.1,)),
        Published("best reported", (2.64,)),
    ),
    hold_out=hold_out,
)
