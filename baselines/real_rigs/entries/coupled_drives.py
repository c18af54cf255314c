"""CE8 coupled electric drives: two motors, a belt, and a pulse counter behind an analogue filter."""

from baselines.public_data import COUPLED_DRIVES as BENCHMARK
from baselines.real_rigs.entry import Documented, Figure, RealRig

_REPORT = "Wigren, Schoukens, 2017"

COUPLED_DRIVES = RealRig(
    name="coupled_drives",
    title="CE8 coupled drives",
    citation=BENCHMARK.citation,
    rig=BENCHMARK.rig,
    topology=BENCHMARK.topology,
    only=BENCHMARK.train,
    told=BENCHMARK.known,
    concealed=(
        Documented("counter without sign", (("rectified_sensor", "encoder_2"),), f"{_REPORT}: pulse counter"),
        Documented(
            "filter behind the counter",
            (("velocity_processing", "encoder_2"),),
            f"{_REPORT}: analogue low-pass filter",
        ),
    ),
    figures=(Figure("filter", "Hz", 12.0, "velocity_processing.encoder_2.cutoff", f"{_REPORT}: about 12 Hz"),),
)
