"""EMPS: one carriage on a prismatic joint under closed-loop position control.

The linear carriage is a mass with viscous friction; dry friction and all the rest are for the engine to find.
"""

from __future__ import annotations

from baselines.public_data.benchmark import Benchmark, Published, Rule
from identification.recordings import Rig
from identification.topology import Topology

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
    blocks=4,
    horizon=0.3,
)
