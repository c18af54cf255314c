"""CE8 coupled electric drives: two motors drive a pulley through a flexible belt; a pulse counter sees the pulley.

Motors and pulley are the two inertias, the belt is the spring. The counter sits on the second one. From one speed the transfer
function from u has four coefficients, for the five numbers m1, m2, b1, b2 and k, so the bearing of the pulley is taken to be
free of friction: b2 = 0. The PRBS records are left out: for the same command their speeds are several times those of the uniform
records, so one drive cannot be both.
"""

from __future__ import annotations

import re
from dataclasses import replace

from baselines.public_data.benchmark import Benchmark, Hypothesis, Published, Rule
from flexdrive_gym.drive.effects import Where
from flexdrive_gym.recording import Recording
from identification.recordings import Rig
from identification.recordings.rig import Unit
from identification.topology import Topology

Effects = tuple[tuple[str, Where], ...]

# one tick per second as 100 mm/s
RIG = Rig(
    name="CE8",
    columns={"v2": ("speed_ticks_s",)},
    units={"v2": Unit("ticks/s")},
    scale={"length": 100.0},
)


def known(recording: Recording) -> Recording:
    """Say that nobody knows how the speed was made from the pulses."""
    return replace(recording, velocity_cutoff=None, quantum=(0.0, 0.0))


def column_of(recording: Recording) -> int:
    """Return 1 for record 2, which is told by its name."""
    return 1 if re.search(r"(^|[^0-9])2([^0-9]|$)", recording.name) else 0


# The residuals of a straight counter behind a slow filter oscillate twice as fast as the belt wherever the speed goes through
# zero, so the filter must be faster (12 Hz by the documentation) and something else slow: the motors, which follow their command
# in 0.15 s. The steady speed grows almost with the square of the command: friction that saturates, or a counter that is bent.
_COUNTER: Effects = (("rectified_sensor", "encoder_2"), ("velocity_processing", "encoder_2"))
_SLOW: Effects = (*_COUNTER, ("amplifier_lag", "actuator"), ("saturating_friction", "cart_1"))
_START = {
    "rectified_sensor.encoder_2.share": 1.0,
    "rectified_sensor.encoder_2.e": 0.2,
    "amplifier_lag.tau": 0.15,
    "velocity_processing.encoder_2.cutoff": 12.0,
    "saturating_friction.cart_1.d": 1.3,
    "saturating_friction.cart_1.v0": 100.0,
    "m1": 2e-4,
    "m2": 2e-4,
    "b1": 4e-3,
    "k": 0.1,
}
HYPOTHESES = (
    Hypothesis("slow motors, saturating friction", _SLOW, _START),
    Hypothesis(
        "bent counter and dry friction",
        (*_COUNTER, ("coulomb_friction", "cart_1")),
        {
            "rectified_sensor.encoder_2.share": 1.0,
            "velocity_processing.encoder_2.cutoff": 4.6,
            "rectified_sensor.encoder_2.e": 0.75,
            "d1": 0.3,
            "m1": 1e-3,
            "m2": 1.3e-3,
            "b1": 1.1e-2,
            "k": 0.38,
        },
    ),
)

COUPLED_DRIVES = Benchmark(
    name="coupled_drives",
    title="CE8 coupled electric drives",
    citation="T. Wigren, M. Schoukens, Coupled electric drives data set and reference models, 2017",
    train=("*train*",),
    test=("*test*",),
    rig=RIG,
    known=known,
    topology=Topology(
        "two inertias and a belt",
        2,
        ("m1", "m2", "b1", "k"),
        {"b2": 0.0},
        frozenset({"encoder_1"}),
        {"m1": 1e-3, "m2": 5e-4, "b1": 1e-2, "k": 0.1},
    ),
    rule=Rule(window=10, unit="ticks/s"),
    columns=("record 1", "record 2"),
    published=(
        Published("linear state space", (0.224, 0.384)),
        Published("linear ARX", (0.291, 0.331)),
        Published("polynomial NARX", (0.10, 0.141)),
        Published("MLP NARX", (0.142, 0.101)),
        Published("LSTM", (0.303, 0.145)),
        Published("best reported", (0.115, 0.074)),
    ),
    blocks=4,
    column_of=column_of,
    hypotheses=HYPOTHESES,
)
