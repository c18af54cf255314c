"""A linear controller as difference equations in MATLAB or C99, in the rig's own units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from baselines.export.exported import Exported
from baselines.export.templating import fill
from flexdrive_gym import LinearController
from flexdrive_gym.units import LAB, Units
from flexdrive_gym.version import __version__


def in_units(controller: LinearController, units: Units) -> LinearController:
    """Return the same controller for positions, commands and times in the rig's units."""
    if units.lab:
        return controller
    length, command, speed = units.one("mm"), units.one("V"), units.one("mm/s")
    assert controller.L is not None
    outputs = np.array([[1.0 / command], [1.0 / speed]])
    return replace(
        controller,
        B=controller.B * length,
        C=controller.C * outputs,
        D=controller.D * length * outputs,
        L=controller.L * command,
        limit=controller.limit / command,
        friction=controller.friction / command,
        threshold=controller.threshold / speed,
        sample_time=controller.sample_time / units.per_time,
    )


def export_linear(
    controller: LinearController,
    name: str,
    to: str,
    *,
    units: Units = LAB,
    about: Sequence[str] = (),
    command: str = "flexdrive export",
) -> Exported:
    """Write a linear controller as a function of one sample.

    Parameters
    ----------
    controller
        In the engine's units (mm, V).
    name
        Of the function.
    to
        ``matlab`` or ``c``.
    units
        Of the rig, for which it is written.
    about
        Lines on what it was designed for.
    command
        How the file was made.

    Returns
    -------
    Exported
        For C with a header.
    """
    own = in_units(controller, units)
    content: dict[str, Any] = {
        "name": name,
        "title": f"{controller.name}: a linear controller of order {own.order}",
        "about": list(about),
        "period": repr(own.sample_time),
        "length": units.length,
        "command": units.command,
        "order": own.order,
        "outputs": 2 if own.friction != 0.0 else 1,
        "limit": own.limit,
        "friction": own.friction,
        "threshold": own.threshold,
        "shaper": own.shaper,
        "past": 1 + max(delay for delay, _weight in own.shaper),
        "version": __version__,
        "made": command,
        **{matrix: getattr(own, matrix) for matrix in "ABL"},
        **{matrix: getattr(own, matrix)[: 2 if own.friction != 0.0 else 1] for matrix in "CD"},
    }
    held = (f"order {own.order}, reads {own.reads or 'nothing'}, every {own.sample_time:g} s",)
    if to == "c":
        return Exported(fill("linear.c.j2", **content), held, header=fill("linear.h.j2", **content))
    return Exported(fill("linear.m.j2", **content), held)
