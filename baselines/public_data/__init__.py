"""Public identification benchmarks: a rig description, a topology and a rule each; the diagnosis is the same for all."""

from baselines.public_data.benchmark import Benchmark, Published, Rule
from baselines.public_data.coupled_drives import COUPLED_DRIVES
from baselines.public_data.emps import EMPS
from baselines.public_data.run import Result, Score, run_benchmark
from baselines.public_data.silverbox import SILVERBOX

BENCHMARKS = {b.name: b for b in (EMPS, COUPLED_DRIVES, SILVERBOX)}

__all__ = [
    "BENCHMARKS",
    "COUPLED_DRIVES",
    "EMPS",
    "SILVERBOX",
    "Benchmark",
    "Published",
    "Result",
    "Rule",
    "Score",
    "run_benchmark",
]
