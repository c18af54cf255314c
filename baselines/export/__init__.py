"""Drives, controllers and agents for other tools: MATLAB and Octave, MuJoCo, plain C99."""

from __future__ import annotations

from baselines.export import arithmetic
from baselines.export.agent import export_agent
from baselines.export.exported import Exported, function_name, identifier
from baselines.export.linear import export_linear
from baselines.export.matlab import export_matlab
from baselines.export.mjcf import export_mujoco
from baselines.export.verify import Difference, Missing, verify_controller, verify_matlab, verify_mujoco

__all__ = [
    "Difference",
    "Exported",
    "Missing",
    "arithmetic",
    "export_agent",
    "export_linear",
    "export_matlab",
    "export_mujoco",
    "function_name",
    "identifier",
    "verify_controller",
    "verify_matlab",
    "verify_mujoco",
]
