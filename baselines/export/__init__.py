"""Drives, controllers and agents for other tools: MATLAB and Octave, MuJoCo, plain C99."""

from __future__ import annotations

from baselines.export.agent import export_agent
from baselines.export.exported import Exported, function_name
from baselines.export.linear import export_linear
from baselines.export.matlab import export_matlab
from baselines.export.mjcf import export_mujoco

__all__ = ["Exported", "export_agent", "export_linear", "export_matlab", "export_mujoco", "function_name"]
