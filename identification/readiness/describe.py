"""A ``rig.toml`` of what was understood, ready to edit."""

from __future__ import annotations

import glob
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.items import Table

from flexdrive_gym.files import write_atomically
from identification.readiness.report import Check, Understood
from identification.recordings.rig import ROLES, FileRule, Rig, Unit

_EXAMPLES = {
    "t": '"Time"',
    "u": '"Control Effort"',
    "x1": '"Encoder 1 Pos"   # or a list of alternatives, or "3" for the third column of a file without header',
    "x2": '"Encoder 2 Pos"',
}
_UNITS = {
    "u": '{ unit = "V", factor = 1.0 }',
    "x1": '{ unit = "mm", factor = 1.0 }',
    "x2": '{ unit = "mm", factor = 1.0 }',
}


def describe(found: Check, name: str = "") -> str:
    """Return a rig description as TOML text, by which the same files give the same recordings.

    Parameters
    ----------
    name
        Of the rig, where its description has none.
    """
    rig = found.read.rig
    document = tomlkit.document()
    document.add(
        tomlkit.comment("What a folder's columns mean; every command that reads recordings takes it with --rig.")
    )
    document.add(tomlkit.comment(found.line()))
    for warning in found.warnings:
        document.add(tomlkit.comment(f"warning: {warning}"))
    document["rig"] = _rig(rig, found, name)
    document["columns"] = _columns(rig.columns, "without it the reader recognises names by itself, as it did here")
    document["units"] = _units(rig.units, "how one file unit reads in the rig's unit; a negative factor turns the sign")
    if rig.scale:
        scale = tomlkit.table()
        for key, value in rig.scale.items():
            scale[key] = value
        document["scale"] = scale
    files = tomlkit.aot()
    for table in _files(rig, found):
        files.append(table)
    if len(files):
        document["files"] = files
    for item in found.read.skipped:
        document.add(tomlkit.comment(f"left out: {item.file}: {_line(item.reason)}"))
    return tomlkit.dumps(document)


def write_description(found: Check, path: str | Path, name: str = "") -> Path:
    """Write :func:`describe` to a file, atomically; missing folders are made."""
    return write_atomically(path, describe(found, name))


def _line(text: str) -> str:
    """Return a text on one line, as a comment must be."""
    return " ".join(text.split())


def _rig(rig: Rig, found: Check, name: str) -> Table:
    table = tomlkit.table()
    table["name"] = rig.name or name
    carts = rig.carts or (found.found.fit.drive.carts if found.found is not None else None)
    if rig.carts is not None:
        table["carts"] = rig.carts
    else:
        table.add(tomlkit.comment(f"carts = {carts or 2}   # 1 or 2; default: as the recordings tell"))
    table["known"] = list(rig.known)
    table["known"].comment('effects that the base model already has, such as ["ground_spring"]')
    if rig.sample_time is not None:
        table["sample_time"] = rig.sample_time
    else:
        periods = [item.recording.sample_time / item.recording.units.one("s") for item in found.recordings]
        table.add(tomlkit.comment(f"sample_time = {periods[0]:.6g}   # s; default: from the files' clock"))
    return table


def _columns(columns: Mapping[str, tuple[str, ...]], remark: str = "") -> Table:
    table = tomlkit.table()
    if remark:
        table.comment(remark)
    for role in ROLES:
        if role in columns:
            names = columns[role]
            table[role] = names[0] if len(names) == 1 else list(names)
        elif remark and role in _EXAMPLES and not columns:
            table.add(tomlkit.comment(f"{role} = {_EXAMPLES[role]}"))
    return table


def _units(units: Mapping[str, Unit], remark: str = "") -> Table:
    table = tomlkit.table()
    if remark:
        table.comment(remark)
    for role in ROLES:
        if role in units:
            entry = tomlkit.inline_table()
            entry["unit"] = units[role].name
            if units[role].factor is not None:
                entry["factor"] = units[role].factor
            table[role] = entry
        elif remark and role in _UNITS and not units:
            table.add(tomlkit.comment(f"{role} = {_UNITS[role]}"))
    return table


def _files(rig: Rig, found: Check) -> list[Table]:
    """Return the rules for some files: what was found of single files first, because the first match holds."""
    tables = []
    for item in found.recordings:
        rule = rig.rule(item.recording.source)
        # a file's own rule replaces the one that it matched, so it says again what that one said
        if (item.held and (rule is None or rule.held is None)) or item.reference is not None:
            tables.append(_file(item, rule))
    return [*tables, *(_rule(rule) for rule in rig.files)]


def _file(item: Understood, rule: FileRule | None) -> Table:
    table = _rule(rule, glob.escape(item.recording.source)) if rule else tomlkit.table()
    table["match"] = glob.escape(item.recording.source)
    if item.held:
        table["held"] = list(item.held)
        table["held"].comment(f"{item.words()}; left out of fits, because the model has two carts that move")
    if item.reference is not None:
        what = f"the command is a reference: {item.reference.channel} follows it with gain {item.reference.gain:.2f}"
        table.add(tomlkit.comment(what))
        table.add(tomlkit.comment('columns = { reference = "that column", u = "the column of the command" }'))
        table.add(tomlkit.comment("use = false   # where no column holds the command"))
    return table


def _rule(rule: FileRule, match: str = "") -> Table:
    table = tomlkit.table()
    table["match"] = match or rule.match
    values: dict[str, Any] = {
        "use": None if rule.use else False,
        "session": rule.session or None,
        "held": None if rule.held is None else list(rule.held),
        "sample_time": rule.sample_time,
    }
    for key, value in values.items():
        if value is not None:
            table[key] = value
    for key, part in (("columns", _columns(rule.columns)), ("units", _units(rule.units))):
        if part:
            inline = tomlkit.inline_table()
            inline.update(part.unwrap())
            table[key] = inline
    return table
