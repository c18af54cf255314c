"""Experiments on a rig: what every rig can do, the loop that drives one safely, and adapters over UDP and serial lines."""

from baselines.rig.addresses import open_rig
from baselines.rig.bench import RigBench
from baselines.rig.loop import Run, run
from baselines.rig.protocol import Description, Limits, Reading, Rig, RigStopped
from baselines.rig.remote import RemoteRig
from baselines.rig.simulated import SimulatedRig

__all__ = [
    "Description",
    "Limits",
    "Reading",
    "RemoteRig",
    "Rig",
    "RigBench",
    "RigStopped",
    "Run",
    "SimulatedRig",
    "open_rig",
    "run",
]
