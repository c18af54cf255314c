"""A trained agent as a function of one control period in MATLAB or C99: observation, network and command."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from baselines.export import arithmetic
from baselines.export.exported import Exported
from baselines.export.templating import fill
from baselines.rl.agents import Agent
from flexdrive_gym import Drive
from flexdrive_gym.version import __version__


def export_agent(
    agent: Agent,
    name: str,
    to: str,
    *,
    drive: Drive | None = None,
    about: Sequence[str] = (),
    command: str = "flexdrive export",
) -> Exported:
    """Write an agent as a function of one control period.

    Parameters
    ----------
    agent
        A trained policy; positions are in mm and commands in V, the units it was trained in.
    name
        Of the function.
    to
        ``matlab`` or ``c``.
    drive
        It will run on, from which the bounds of the observation follow; ``None`` for the documented default.
    about
        Lines on where it comes from.
    command
        How the file was made.

    Returns
    -------
    Exported
        For C with a header.
    """
    task = agent.made_for(drive)
    carts = {"collocated": [1], "non_collocated": [2], "full_state": [1, 2]}[task.sensing]
    names = task.names()
    cutoffs = [task.rig[f"velocity_processing.encoder_{cart}.cutoff"] for cart in carts]
    keep = [float(np.exp(-2.0 * np.pi * f * task.control_period)) if f > 0.0 else 0.0 for f in cutoffs]
    unread = "" if len(carts) == 2 else f" x{3 - carts[0]} is not read."
    content: dict[str, Any] = {
        "name": name,
        "title": f"{agent.name}: a trained agent, {' x '.join(str(np.size(b)) for _W, b in agent.layers)} neurons",
        "about": list(about),
        "period": task.control_period,
        "voltage": task.voltage,
        "ahead": [float(a) for a in task.preview],
        "history": agent.history,
        "inputs": agent.history * len(names),
        "entries": [{"name": n, "unit": unit, "bound": bound} for n, unit, bound in names],
        "bounds": [bound for _name, _unit, bound in names],
        "keep": keep,
        "carts": carts,
        "unread": unread,
        "layers": [(np.asarray(W), np.asarray(b)) for W, b in agent.layers],
        "activation": agent.activation,
        "coefficients": arithmetic.COEFFICIENTS,
        "largest": arithmetic.LARGEST,
        "per_ln2": arithmetic.PER_LN2,
        "ln2_high": arithmetic.LN2_HIGH,
        "ln2_low": arithmetic.LN2_LOW,
        "version": __version__,
        "made": command,
    }
    weights = sum(np.asarray(W).size + np.asarray(b).size for W, b in agent.layers)
    reads = " and ".join(f"x{c}" for c in carts)
    held = (f"{weights} weights, reads {reads}, every {task.control_period:g} s, up to {task.voltage:g} V",)
    notes = (f"the reference is needed {math.ceil(1e3 * max(task.preview)):d} ms ahead",) if task.preview else ()
    if to == "c":
        return Exported(fill("agent.c.j2", **content), held, notes=notes, header=fill("agent.h.j2", **content))
    return Exported(fill("agent.m.j2", **content), held, notes=notes)
