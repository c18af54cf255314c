"""``drive.toml``: a drive with units, intervals and provenance, for people and programs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, fields
from math import inf, isfinite
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit
from tomlkit.exceptions import TOMLKitError

from flexdrive_gym.drive import parameters
from flexdrive_gym.drive.drive import Covariance, Drive, Provenance, Recorded
from flexdrive_gym.drive.effects import LAYOUT
from flexdrive_gym.files import write_atomically
from flexdrive_gym.recording import FloatArray
from flexdrive_gym.schema import Schema
from flexdrive_gym.units import LAB, Units

SCHEMA = Schema(1, "Write one with 'flexdrive identify'.")
_UNITS = ("length", "command", "per_length", "per_command", "per_time")
# what says how far recordings reach, and the lab's units of it
_REACH = {f.name: f.metadata["unit"] for f in fields(Recorded)}
# from a rig's own units: Newton's law divided by the force, or on a turning rig the torque, that a volt gives
_CONVERSIONS = {
    "V s²/mm": "Convert: m [V s²/mm] = mass [kg] / (force per volt [N/V]) / 1000, or for an inertia "
    "J [kg m²] / (torque per volt [N m/V] · radius [m]) / 1000.",
    "V s/mm": "Convert: b [V s/mm] = damping [N s/m] / (force per volt [N/V]) / 1000, or for a turning one "
    "damping [N m s/rad] / (torque per volt [N m/V] · radius [m]) / 1000.",
    "V/mm": "Convert: k [V/mm] = stiffness [N/m] / (force per volt [N/V]) / 1000, or for a turning one "
    "stiffness [N m/rad] / (torque per volt [N m/V] · radius [m]) / 1000.",
    "V": "Convert: d [V] = force [N] / (force per volt [N/V]), or torque [N m] / (torque per volt [N m/V]).",
}


def _entry(drive: Drive, name: str) -> Any:
    spec = parameters.parameter(name)
    entry = tomlkit.inline_table()
    entry["value"], entry["unit"] = drive.units.of_rig(drive[name], spec.unit)
    if name in drive.intervals:
        entry["ci95"] = [drive.units.of_rig(float(x), spec.unit)[0] for x in drive.intervals[name]]
    return entry


def _sizes(names: Sequence[str], units: Units) -> FloatArray:
    """Return how many of the engine's units make one of the rig's, ndarray, shape (n,)."""
    return np.array([units.one(parameters.parameter(name).unit) for name in names])


def dumps(drive: Drive) -> str:
    """Return the drive as TOML text."""
    document = tomlkit.document()
    document.add(
        tomlkit.comment("A flexible drive. Units follow the Lab 3 handout: force is measured in volts of command.")
    )
    document["schema"] = SCHEMA.number
    document["name"] = drive.name
    document["carts"] = drive.carts
    if not drive.units.lab:
        units = tomlkit.table()
        units.comment("names, and how many mm, V and s of the lab one unit of the rig is simulated as")
        for key in _UNITS:
            units[key] = getattr(drive.units, key)
        document["units"] = units

    provenance = tomlkit.table()
    provenance["method"] = drive.provenance.method
    provenance["version"] = drive.provenance.version
    provenance["recordings"] = list(drive.provenance.recordings)
    if drive.provenance.note:
        provenance["note"] = drive.provenance.note
    document["provenance"] = provenance

    base, effects = tomlkit.table(), tomlkit.table(is_super_table=True)
    for name in drive.values:
        if "." not in name:
            base.add(name, _entry(drive, name))
            base[name].comment(parameters.parameter(name).meaning)
            continue
        slot = LAYOUT[name]
        if slot.effect.id not in effects:
            effects[slot.effect.id] = tomlkit.table(is_super_table=True)
        places = effects[slot.effect.id]
        if slot.where not in places:
            places[slot.where] = tomlkit.table()
        places[slot.where][slot.parameter.name] = _entry(drive, name)
    document["parameters"] = base
    if len(effects):
        document["effects"] = effects
    if drive.covariance is not None:
        document["covariance"] = _covariance(drive.covariance, _sizes(drive.covariance.names, drive.units))
    if drive.run_to_run is not None:
        spread = _covariance(drive.run_to_run, np.ones(len(drive.run_to_run.names)))
        document["run_to_run"] = spread.comment("of the logarithms: what differs between runs of the same rig")
    if drive.recorded is not None:
        reached = tomlkit.table()
        reached.comment(drive.units.name("how far the recordings reach: V, mm/s, mm, Hz, Hz, mm"))
        for name, value in asdict(drive.recorded).items():
            reached[name] = drive.units.of_rig(float(value), _REACH[name])[0]
        document["recorded"] = reached
    return tomlkit.dumps(document)


def _covariance(covariance: Covariance, sizes: FloatArray) -> Any:
    """Return a covariance as a table; ``sizes`` of the engine's units make one of the rig's."""
    table = tomlkit.table()
    table["names"] = list(covariance.names)
    if isfinite(covariance.degrees):
        table["degrees"] = float(covariance.degrees)
    rows = tomlkit.array().multiline(multiline=True)
    for row in covariance.matrix / np.outer(sizes, sizes):
        rows.append([float(x) for x in row])
    table["matrix"] = rows
    return table


def _read_covariance(table: dict[str, Any] | None, units: Units | None = None) -> Covariance | None:
    """Return the covariance in a table; of parameters in the rig's units, or of pure numbers."""
    if not table:
        return None
    names = tuple(table["names"])
    sizes = np.ones(len(names)) if units is None else _sizes(names, units)
    matrix = np.array(table["matrix"], dtype=np.float64) * np.outer(sizes, sizes)
    return Covariance(names, matrix, float(table.get("degrees", inf)))


def _read_recorded(table: dict[str, Any] | None, units: Units) -> Recorded | None:
    if not table:
        return None
    return Recorded(**{name: float(value) * units.one(_REACH.get(name, "")) for name, value in table.items()})


def save_drive(drive: Drive, path: str | Path) -> Path:
    """Write ``drive.toml``; see :func:`load_drive`."""
    return write_atomically(path, dumps(drive))


def _units(where: str, table: Any) -> Units:
    """Return the rig's units; the lab's where the file names none."""
    if table is None:
        return LAB
    unknown = sorted(set(table) - set(_UNITS))
    if unknown:
        raise ValueError(f"{where}: [units] has {', '.join(_UNITS)}; got {unknown[0]!r}. Remove it.")
    for key in _UNITS[2:]:
        value = table.get(key, 1.0)
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 < value < np.inf:
            raise ValueError(
                f"{where}: [units] {key} must be a positive number; got {value!r}. Write 1.0 for the lab's."
            )
    return Units(**table)


def _number(where: str, name: str, entry: Any, intervals: dict[str, tuple[float, float]], units: Units) -> float:
    table = entry if isinstance(entry, dict) else {"value": entry}
    spec = parameters.parameter(name).unit
    unit, one = units.name(spec), units.one(spec)
    if table.get("unit", unit) != unit:
        raise ValueError(
            f"{where}: {name} must be given in {unit}; got {table['unit']!r}. {_CONVERSIONS.get(unit, 'Convert the value.')}"
        )
    value = table.get("value")
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError(f"{where}: {name} needs a number as value; got {value!r}.")
    if "ci95" in table:
        low, high = table["ci95"]
        intervals[name] = (float(low) * one, float(high) * one)
    return float(value) * one


def loads(text: str, where: str = "drive.toml") -> Drive:
    """Return the drive in a TOML text; ``where`` names it in errors."""
    try:
        document = tomlkit.parse(text).unwrap()
    except TOMLKitError as error:
        raise ValueError(f"{where}: must be TOML; got {error}.") from error
    document = SCHEMA.current(document, where)
    if "parameters" not in document:
        raise ValueError(f"{where}: must have a table [parameters]; got none. {SCHEMA.remedy}")
    values: dict[str, float] = {}
    intervals: dict[str, tuple[float, float]] = {}
    units = _units(where, document.get("units"))
    try:
        for name, entry in document["parameters"].items():
            values[name] = _number(where, name, entry, intervals, units)
        for effect_id, places in document.get("effects", {}).items():
            for place, entries in places.items():
                for short, entry in entries.items():
                    name = _key(effect_id, place, short)
                    values[name] = _number(where, name, entry, intervals, units)
    except KeyError as error:
        raise ValueError(f"{where}: {error.args[0]}") from error
    source = document.get("provenance", {})
    try:
        return Drive(
            values,
            intervals,
            _read_covariance(document.get("covariance"), units),
            Provenance(
                source.get("method", "values"),
                tuple(source.get("recordings", ())),
                source.get("version", ""),
                source.get("note", ""),
            ),
            document.get("name", "drive"),
            units,
            _read_covariance(document.get("run_to_run")),
            _read_recorded(document.get("recorded"), units),
        )
    except (TypeError, ValueError) as error:
        raise ValueError(f"{where}: {error}") from error


def _key(effect_id: str, place: str, short: str) -> str:
    for name, slot in LAYOUT.items():
        if (slot.effect.id, slot.where, slot.parameter.name) == (effect_id, place, short):
            return name
    return parameters.parameter(f"{effect_id}.{place}.{short}").name  # raises with near matches


def load_drive(path: str | Path) -> Drive:
    """Read a ``drive.toml``.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If the file is not a drive; the message names file, rule and value.
    """
    file = Path(path)
    if not file.is_file():
        raise FileNotFoundError(f"drive: no file {file}. Write one with 'flexdrive identify RECORDINGS -o {file}'.")
    return loads(file.read_text(encoding="utf-8"), str(file))
