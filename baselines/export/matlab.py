"""A drive as a MATLAB function file: parameters with units, the linear model, and one step with friction and all effects."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from baselines.export.exported import Exported, number
from baselines.export.templating import fill
from baselines.export.translation import Translator, constants_in, field_name, first_sample, one_sample
from flexdrive_gym import Drive
from flexdrive_gym.drive import parameters
from flexdrive_gym.drive.effects import EFFECTS, LAYOUT
from flexdrive_gym.drive.sample import MEMORY
from flexdrive_gym.drive.step import step
from flexdrive_gym.version import __version__

_PHYSICS_STEP_S = 1e-3


def present_effects(drive: Drive) -> list[tuple[str, str]]:
    """Return (id, place) of the effects beyond the base that a drive has."""
    off_null = {
        (slot.effect.id, slot.where)
        for key, slot in LAYOUT.items()
        if slot.switches and not slot.effect.base and drive[key] != slot.parameter.null
    }
    return [(e.id, where) for e in EFFECTS for where in e.where if (e.id, where) in off_null]


def described(drive: Drive, which: Sequence[tuple[str, str]]) -> list[str]:
    """Return a line per effect: its place, equation and parameters in the rig's units."""
    lines = []
    for item in EFFECTS:
        for where in item.where:
            if (item.id, where) in which:
                values = ", ".join(
                    f"{q.name} = {drive.units.text(drive[item.key(where, q.name)], q.unit)}" for q in item.parameters
                )
                lines.append(f"{item.id} at {where}: {drive.units.name(item.equation)}; {values}")
    return lines


def export_matlab(drive: Drive, name: str, *, sample_time: float = 1e-3, command: str = "flexdrive export") -> Exported:
    """Write a drive as a MATLAB function file, which Octave takes as well.

    Parameters
    ----------
    drive
        With all its effects.
    name
        Of the function, and so of the file.
    sample_time
        Of the rig, over which a command is held [s of the rig].
    command
        How the file was made, for its header.

    Returns
    -------
    Exported
        Its numbers are in the rig's own units.

    Raises
    ------
    ValueError
        For a delay or an effect that does not fit the sample time.
    """
    units = drive.units
    engine_time = sample_time * units.per_time
    parameters.check_delays(drive.values, engine_time)
    substeps = parameters.substeps(drive.values, engine_time, _PHYSICS_STEP_S)
    which = present_effects(drive)
    translation = Translator(which, constants_in(units.one)).translate(first_sample, one_sample, step=step)
    rows = _parameters(drive, translation.parameters)
    widest = max(len(row["field"]) + len(row["value"]) for row in rows)
    for row in rows:
        row["pad"] = widest - len(row["field"]) - len(row["value"])
    two = drive.carts == 2
    held = described(drive, which)
    text = fill(
        "drive.m.j2",
        name=name,
        title=f"{drive.name}: the two-mass flexible drive" if two else f"{drive.name}: a drive of one cart",
        units=f"positions {units.length}, velocities {units.length}/s, commands and forces {units.command}",
        u=units.command,
        x=units.length,
        ts=number(sample_time),
        substeps=substeps,
        ts_pad=max(0, widest - 2 - len(number(sample_time))),
        steps_pad=max(0, widest - 8 - len(str(substeps))),
        present=held or ["Coulomb and viscous friction, spring, command limit, encoders; no further effect"],
        version=__version__,
        command=command,
        provenance=provenance(drive),
        parameters=rows,
        carts=[1, 2] if two else [1],
        states="x1, v1, x2, v2" if two else "x1, v1",
        outputs="x1, x2, v1, v2" if two else "x1, v1",
        memory=MEMORY,
        cells=max(translation.cells, default=0),
        cell_names=list(translation.cells.items()) if which else [],
        first_call=translation.entries[0],
        next_call=translation.entries[1],
        code=units.name(translation.functions),
    )
    return Exported(text, ("masses, viscous and Coulomb friction, spring, command limit, delay, encoders", *held))


def _parameters(drive: Drive, keys: Sequence[str]) -> list[dict[str, Any]]:
    """Return what the file tells of each parameter, in the rig's units."""
    # the linear model is written with these, whatever the step reads
    wanted = [*keys, *(key for key in ("b1", "b2", "k", "C") if key not in keys)]
    order = {key: i for i, key in enumerate(["m1", "m2", *LAYOUT])}
    rows = []
    for key in sorted(wanted, key=order.__getitem__):
        about, units = parameters.parameter(key), drive.units
        value, unit = units.of_rig(drive[key], about.unit)
        bounds = drive.intervals.get(key)
        interval = ""
        if bounds is not None:
            low, high = (units.of_rig(b, about.unit)[0] for b in bounds)
            interval = f"; 95 % interval {low:.4g} ... {high:.4g}"
        rows.append(
            {
                "field": field_name(key),
                "value": number(value),
                "unit": unit,
                "meaning": about.meaning,
                "interval": interval,
            }
        )
    return rows


def provenance(drive: Drive) -> list[str]:
    """Return where a drive comes from, line by line."""
    origin = drive.provenance
    lines = [f"Identified by {origin.method}" + (f" with flexdrive {origin.version}" if origin.version else "")]
    if origin.recordings:
        shown = ", ".join(origin.recordings[:5]) + (
            f" and {len(origin.recordings) - 5} more" if len(origin.recordings) > 5 else ""
        )
        lines.append(f"from {shown}")
    if origin.note:
        lines.append(" ".join(origin.note.split()))
    return lines
