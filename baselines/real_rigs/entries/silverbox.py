"""Silverbox: an electronic oscillator, the equation of a mass on a spring with a cubic term."""

from baselines.public_data import SILVERBOX as BENCHMARK
from baselines.real_rigs.entry import Documented, RealRig

_CIRCUIT = "an electronic circuit has no such part"

SILVERBOX = RealRig(
    name="silverbox",
    title="Silverbox",
    citation=BENCHMARK.citation,
    rig=BENCHMARK.rig,
    topology=BENCHMARK.topology,
    only=BENCHMARK.train,
    told=BENCHMARK.known,
    concealed=(
        Documented(
            "cubic spring", (("hardening_spring", "spring"),), "Wigren, Schoukens, 2013: equation of the circuit"
        ),
    ),
    denied=dict.fromkeys(
        ("coulomb_friction", "stribeck", "presliding", "breakaway", "coupling_backlash", "coil_bind", "encoder_play"),
        _CIRCUIT,
    ),
)
