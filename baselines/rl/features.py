"""What the network is fed: a fixed linear map of the last observations, so that its inputs are of the size of one.

The drive does not care where on the rail it is, so the map holds differences only: the error, the way ahead of the reference,
velocities and commands. It is folded into the first layer when an agent is made; nobody but the training needs it.
"""

from __future__ import annotations

import numpy as np

from flexdrive_gym.recording import FloatArray
from flexdrive_gym.task import Task

ERROR_MM = 5.0
SPEED_MM_S = 100.0
STEP_MM_S = 10.0


def features(task: Task, history: int) -> FloatArray:
    """Return the map from the last observations, newest first, to the network's inputs, ndarray, shape (m, history * entries)."""
    names = [name for name, _unit, _bound in task.names()]
    place, width = {name: i for i, name in enumerate(names)}, len(names)
    speeds = [name for name in names if name in ("v1", "v2")]
    error = next(name for name in names if name.startswith("xr - "))
    rows = [{error: 1.0 / ERROR_MM}, *({v: 1.0 / SPEED_MM_S} for v in speeds)]
    if "x1" in place and "x2" in place:
        rows.append({"x1": 1.0 / ERROR_MM, "x2": -1.0 / ERROR_MM})
    rows += [{f"xr in {a:g} s": 1.0 / (SPEED_MM_S * a), "xr": -1.0 / (SPEED_MM_S * a)} for a in task.preview if a > 0.0]
    rows.append({"last u": 4.0 / task.voltage})
    found = []
    for row in rows:
        line = np.zeros(history * width)
        for name, factor in row.items():
            line[place[name]] = factor
        found.append(line)
    for lag in range(1, history):
        for name in speeds:
            line = np.zeros(history * width)
            line[(lag - 1) * width + place[name]], line[lag * width + place[name]] = 1.0 / STEP_MM_S, -1.0 / STEP_MM_S
            found.append(line)
        line = np.zeros(history * width)
        line[lag * width + place["last u"]] = 4.0 / task.voltage
        found.append(line)
    return np.array(found)
