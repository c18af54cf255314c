"""``rig.toml``: what the columns of a folder mean, in which units, and what is known of the rig.

A role (``t``, ``u``, ``x1``, ``x2``, ``v1``, ``v2``, ``reference``) is given the name that it has in the files, or a list of
names of which the first that a file has is taken. ``"3"`` is the third column of a file without a header, ``"data:3"`` the third
column of the matrix ``data``, and ``"a + b"`` or ``"a - b"`` a sum, as where the second encoder measures the spring's deflection.
A unit has a name and the factor by which one file unit reads in it: counts, units of a digital-to-analogue converter; a
negative factor turns the sign.
"""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from math import isfinite
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.exceptions import TOMLKitError

from flexdrive_gym.drive.effects import LAYOUT
from flexdrive_gym.units import Units
from identification.recordings.errors import RecordingError, broken

ROLES = ("t", "u", "x1", "x2", "v1", "v2", "reference")
SIGNAL = {role: "xr" if role == "reference" else role for role in ROLES}
_TABLES = ("rig", "columns", "units", "files", "scale")
_RIG = ("name", "carts", "known", "sample_time")
_FILE = ("match", "use", "session", "held", "sample_time", "columns", "units")
_SCALE = ("length", "command", "time")


@dataclass(frozen=True)
class Unit:
    """Unit of a role: its name, and how one file unit reads in it; ``None`` where the column's own name is to say that."""

    name: str
    factor: float | None = None


@dataclass(frozen=True)
class FileRule:
    """What holds for the files that match a pattern instead of what holds for all.

    Attributes
    ----------
    match
        Pattern of the path from the folder down, or of the name, such as ``21-Feb*``.
    use
        False to leave the files out.
    session
        Name of their session.
    held
        Carts that were held in place.
    sample_time
        Sampling period [s] of these files.
    columns, units
        Roles that differ.
    """

    match: str
    use: bool = True
    session: str = ""
    held: tuple[int, ...] | None = None
    sample_time: float | None = None
    columns: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    units: Mapping[str, Unit] = field(default_factory=dict)

    def matches(self, path: str) -> bool:
        """Whether a path from the folder down, or its last part, matches."""
        return fnmatchcase(path, self.match) or fnmatchcase(path.rsplit("/", 1)[-1], self.match)


@dataclass(frozen=True)
class Rig:
    """A rig description.

    Attributes
    ----------
    name
        Of the rig, for titles.
    carts
        1 or 2, or ``None``: as the recordings tell.
    known
        Effects that the base model already has, by their ids; ``id@place`` for one of several places.
    sample_time
        Sampling period [s], or ``None``: from the files' clock.
    columns
        Role to the names it may have in the files.
    units
        Role to its unit.
    files
        Rules for some of the files; the first that matches holds.
    scale
        Units of the engine in one of the rig's, by ``length``, ``command`` and ``time``; what is missing is chosen from the data.
    """

    name: str = ""
    carts: int | None = None
    known: tuple[str, ...] = ()
    sample_time: float | None = None
    columns: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    units: Mapping[str, Unit] = field(default_factory=dict)
    files: tuple[FileRule, ...] = ()
    scale: Mapping[str, float] = field(default_factory=dict)

    def rule(self, path: str) -> FileRule | None:
        """Return the first rule that a path matches."""
        return next((rule for rule in self.files if rule.matches(path)), None)

    def for_file(self, path: str) -> Rig:
        """Return the description as it holds for one file, its rule merged in."""
        rule = self.rule(path)
        if rule is None:
            return self
        return replace(
            self,
            columns={**self.columns, **rule.columns},
            units={**self.units, **rule.units},
            sample_time=self.sample_time if rule.sample_time is None else rule.sample_time,
        )

    def unit_names(self) -> tuple[str, str]:
        """Return the names of the units of position and command; rules for some files name them where nothing else does."""
        tables = [self.units, *(rule.units for rule in self.files)]
        names = [units[role].name for units in tables for role in ("x1", "x2", "reference") if role in units]
        speeds = [units[role].name for units in tables for role in ("v1", "v2") if role in units]
        commands = [units["u"].name for units in tables if "u" in units]
        length = names[0] if names else speeds[0].removesuffix("/s") if speeds else "mm"
        return length, commands[0] if commands else "V"


def scaled(rig: Rig, per_length: float, per_command: float) -> Units:
    """Return the units of a rig, with what its description does not fix given by two sizes of the data."""
    length, command = rig.unit_names()
    return Units(
        length,
        command,
        rig.scale.get("length", 1.0 if length == "mm" else per_length),
        rig.scale.get("command", 1.0 if command == "V" else per_command),
        rig.scale.get("time", 1.0),
    )


def load_rig(path: str | Path) -> Rig:
    """Read a ``rig.toml``.

    Raises
    ------
    RecordingError
        If there is no such file, or it says what a rig description cannot say; the message names the table, the rule, the value
        and a remedy.
    """
    file = Path(path)
    try:
        text = file.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise broken(str(file), "file", "must be a readable rig description", f"{error.strerror}", _WRITE) from error
    except UnicodeDecodeError as error:
        raise broken(str(file), "file", "must be text in UTF-8", f"{error.reason}", _WRITE) from error
    return parse_rig(text, str(file))


_WRITE = "Write one with 'flexdrive check RECORDINGS -o rig.toml'."


def parse_rig(text: str, where: str = "rig.toml") -> Rig:
    """Return the rig description in a TOML text; ``where`` names it in errors."""
    try:
        document = tomlkit.parse(text).unwrap()
    except (TOMLKitError, ValueError, RecursionError) as error:
        raise broken(where, "file", "must be TOML", str(error), "Mend that line.") from error
    _known_keys(where, "file", document, _TABLES)
    rig = _table(where, "rig", document.get("rig", {}))
    _known_keys(where, "[rig]", rig, _RIG)
    carts = rig.get("carts")
    if carts is not None and carts not in (1, 2):
        raise broken(where, "[rig] carts", "must be 1 or 2", repr(carts), "Write the number of moving carts.")
    columns, units = _columns(where, document.get("columns", {})), _units(where, document.get("units", {}))
    files = document.get("files", [])
    if not isinstance(files, list):
        raise broken(
            where, "[[files]]", "must be a list of tables", repr(files)[:60], "Write [[files]] in double brackets."
        )
    found = Rig(
        name=_text(where, "[rig] name", rig.get("name", "")),
        carts=carts,
        known=_effects(where, rig.get("known", [])),
        sample_time=_period(where, "[rig] sample_time", rig.get("sample_time")),
        columns=columns,
        units=units,
        files=tuple(_file(where, i, item) for i, item in enumerate(files, 1)),
        scale=_scale(where, document.get("scale", {})),
    )
    _agree(where, "[units]", units, found)
    for i, rule in enumerate(found.files, 1):
        _agree(where, f"[[files]] {i} units", rule.units, found)
    return found


def _table(where: str, what: str, value: Any) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise broken(where, what, "must be a table", repr(value)[:60], f"Write [{what}] above its lines.")
    return value


def _known_keys(where: str, what: str, table: Mapping[str, Any], known: Sequence[str]) -> None:
    for key in table:
        if key not in known:
            near = difflib.get_close_matches(key, known, n=1, cutoff=0.6)
            hint = f"Did you mean {near[0]}?" if near else "Remove it."
            raise broken(where, what, f"may have {', '.join(known)}", repr(key), hint)


def _text(where: str, what: str, value: Any) -> str:
    if not isinstance(value, str):
        raise broken(where, what, "must be a text", repr(value)[:60], "Put it in quotes.")
    return value


def _period(where: str, what: str, value: Any) -> float | None:
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float) or not 1e-6 <= value <= 0.5:
        raise broken(where, what, "must be a period between 1e-6 and 0.5 s", repr(value), "Write it in seconds.")
    return float(value)


def _effects(where: str, value: Any) -> tuple[str, ...]:
    ids = sorted({slot.effect.id for slot in LAYOUT.values() if slot.effect is not None})
    if not isinstance(value, list):
        raise broken(
            where, "[rig] known", "must be a list of effects", repr(value)[:60], 'Write known = ["ground_spring"].'
        )
    for item in value:
        if str(item).partition("@")[0] not in ids:
            near = difflib.get_close_matches(str(item), ids, n=1, cutoff=0.6)
            hint = f"Did you mean {near[0]}?" if near else "See docs/physics.md for the catalogue."
            raise broken(where, "[rig] known", "must name effects of the catalogue", repr(item), hint)
    return tuple(value)


def _columns(where: str, value: Any) -> dict[str, tuple[str, ...]]:
    table = _table(where, "columns", value)
    _known_keys(where, "[columns]", table, ROLES)
    found = {}
    for role, names in table.items():
        listed = names if isinstance(names, list) else [names]
        if not listed or not all(isinstance(name, str | int) and not isinstance(name, bool) for name in listed):
            rule = "must be a column's name, its number, or a list of such"
            raise broken(where, f"[columns] {role}", rule, repr(names)[:60], f'Write {role} = "the column\'s name".')
        found[role] = tuple(str(name) for name in listed)
    return found


def _units(where: str, value: Any) -> dict[str, Unit]:
    table = _table(where, "units", value)
    _known_keys(where, "[units]", table, ROLES)
    found = {}
    for role, entry in table.items():
        unit = {"unit": entry} if isinstance(entry, str) else entry
        if not isinstance(unit, dict) or "unit" not in unit:
            remedy = f'Write {role} = {{ unit = "mm", factor = 0.0044 }}.'
            raise broken(where, f"[units] {role}", "must have a unit and may have a factor", repr(entry)[:60], remedy)
        _known_keys(where, f"[units] {role}", unit, ("unit", "factor"))
        factor = unit.get("factor")
        number = isinstance(factor, int | float) and not isinstance(factor, bool) and isfinite(factor) and factor != 0.0
        if factor is not None and not number:
            rule = "must be a finite number other than 0"
            raise broken(
                where, f"[units] {role} factor", rule, repr(factor), "Write how one file unit reads in the rig's unit."
            )
        found[role] = Unit(
            _text(where, f"[units] {role} unit", unit["unit"]), None if factor is None else float(factor)
        )
    return found


def _file(where: str, place: int, value: Any) -> FileRule:
    what = f"[[files]] {place}"
    table = _table(where, what, value)
    _known_keys(where, what, table, _FILE)
    if "match" not in table:
        raise broken(where, what, "must say which files it is about", "no match", 'Write match = "21-Feb*".')
    use, held = table.get("use", True), table.get("held")
    if not isinstance(use, bool):
        raise broken(where, f"{what} use", "must be true or false", repr(use), "Write use = false to leave files out.")
    if held is not None:
        held = held if isinstance(held, list) else [held]
        if not all(isinstance(cart, int) and cart in (1, 2) for cart in held):
            raise broken(where, f"{what} held", "must be carts 1 or 2", repr(held), "Write held = [2].")
    return FileRule(
        match=_text(where, f"{what} match", table["match"]),
        use=use,
        session=_text(where, f"{what} session", table.get("session", "")),
        held=None if held is None else tuple(held),
        sample_time=_period(where, f"{what} sample_time", table.get("sample_time")),
        columns=_columns(where, table.get("columns", {})),
        units=_units(where, table.get("units", {})),
    )


def _scale(where: str, value: Any) -> dict[str, float]:
    table = _table(where, "scale", value)
    _known_keys(where, "[scale]", table, _SCALE)
    for key, number in table.items():
        if isinstance(number, bool) or not isinstance(number, int | float) or not (number > 0.0 and isfinite(number)):
            raise broken(
                where, f"[scale] {key}", "must be a positive number", repr(number), "Remove it to let the data choose."
            )
    return {key: float(number) for key, number in table.items()}


def _agree(where: str, what: str, units: Mapping[str, Unit], rig: Rig) -> None:
    """Both carts and the reference are measured in one unit, and velocities in that per second, in all files of a rig."""
    length, command = rig.unit_names()
    for role, unit in units.items():
        expected = {"t": "s", "u": command}.get(role, f"{length}/s" if role[0] == "v" else length)
        if unit.name != expected:
            remedy = f"Give {role} a factor that turns it into {expected}."
            raise broken(where, f"{what} {role}", f"must be in {expected}, as the other signals are", unit.name, remedy)


__all__ = ["ROLES", "SIGNAL", "FileRule", "RecordingError", "Rig", "Unit", "load_rig", "parse_rig", "scaled"]
