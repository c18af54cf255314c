"""``drive.toml``: a drive with units, intervals and provenance, for people and programs."""

from __future__ import annotations

from dataclasses import asdict
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

SCHEMA = 1


def _entry(drive: Drive, name: str) -> Any:
    spec = parameters.parameter(name)
    entry = tomlkit.inline_table()
    entry["value"] = drive[name]
    entry["unit"] = spec.unit
    if name in drive.intervals:
        entry["ci95"] = [float(x) for x in drive.intervals[name]]
    return entry


def dumps(drive: Drive) -> str:
    """Return the drive as TOML text."""
    document = tomlkit.document()
    document.add(
        tomlkit.comment("A flexible drive. Units follow the Lab 3 handout: force is measured in volts of command.")
    )
    document["schema"] = SCHEMA
    document["name"] = drive.name
    document["carts"] = drive.carts

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
        document["covariance"] = _covariance(drive.covariance)
    if drive.run_to_run is not None:
        spread = _covariance(drive.run_to_run)
        document["run_to_run"] = spread.comment("of the logarithms: what differs between runs of the same rig")
    if drive.recorded is not None:
        reached = tomlkit.table()
        reached.comment("how far the recordings reach: V, mm/s, mm, Hz")
        for name, value in asdict(drive.recorded).items():
            reached[name] = float(value)
        document["recorded"] = reached
    return tomlkit.dumps(document)


def _covariance(covariance: Covariance) -> Any:
    table = tomlkit.table()
    table["names"] = list(covariance.names)
    if isfinite(covariance.degrees):
        table["degrees"] = float(covariance.degrees)
    rows = tomlkit.array().multiline(multiline=True)
    for row in covariance.matrix:
        rows.append([float(x) for x in row])
    table["matrix"] = rows
    return table


def _read_covariance(table: dict[str, Any] | None) -> Covariance | None:
    if not table:
        return None
    matrix = np.array(table["matrix"], dtype=np.float64)
    return Covariance(tuple(table["names"]), matrix, float(table.get("degrees", inf)))


def save_drive(drive: Drive, path: str | Path) -> Path:
    """Write ``drive.toml``; see :func:`load_drive`."""
    return write_atomically(path, dumps(drive))


def _number(where: str, name: str, entry: Any, intervals: dict[str, tuple[float, float]]) -> float:
    table = entry if isinstance(entry, dict) else {"value": entry}
    unit = parameters.parameter(name).unit
    if table.get("unit", unit) != unit:
        raise ValueError(f"{where}: {name} must be given in {unit}; got {table['unit']!r}. Convert the value.")
    value = table.get("value")
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError(f"{where}: {name} needs a number as value; got {value!r}.")
    if "ci95" in table:
        low, high = table["ci95"]
        intervals[name] = (float(low), float(high))
    return float(value)


def loads(text: str, where: str = "drive.toml") -> Drive:
    """Return the drive in a TOML text; ``where`` names it in errors."""
    try:
        document = tomlkit.parse(text).unwrap()
    except TOMLKitError as error:
        raise ValueError(f"{where}: must be TOML; got {error}.") from error
    if document.get("schema") != SCHEMA or "parameters" not in document:
        raise ValueError(
            f"{where}: must have 'schema = {SCHEMA}' and a table [parameters]; got schema "
            f"{document.get('schema')!r}. Write one with 'flexdrive identify'."
        )
    values: dict[str, float] = {}
    intervals: dict[str, tuple[float, float]] = {}
    try:
        for name, entry in document["parameters"].items():
            values[name] = _number(where, name, entry, intervals)
        for effect_id, places in document.get("effects", {}).items():
            for place, entries in places.items():
                for short, entry in entries.items():
                    name = _key(effect_id, place, short)
                    values[name] = _number(where, name, entry, intervals)
    except KeyError as error:
        raise ValueError(f"{where}: {error.args[0]}") from error
    source = document.get("provenance", {})
    recorded = document.get("recorded")
    try:
        return Drive(
            values,
            intervals,
            _read_covariance(document.get("covariance")),
            Provenance(
                source.get("method", "values"),
                tuple(source.get("recordings", ())),
                source.get("version", ""),
                source.get("note", ""),
            ),
            document.get("name", "drive"),
            _read_covariance(document.get("run_to_run")),
            Recorded(**{k: float(v) for k, v in recorded.items()}) if recorded else None,
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
