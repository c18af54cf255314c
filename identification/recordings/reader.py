"""Files and folders to complete recordings: units checked, excitation recognised, faults found."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from flexdrive_gym.recording import CHANNELS, Recording
from flexdrive_gym.units import Units
from identification.recordings.checks import check_excitation, check_units, scale_warnings
from identification.recordings.copies import find_copies
from identification.recordings.dates import seconds_of_stamps
from identification.recordings.errors import NotARecordingError, RecordingError, broken, left_out
from identification.recordings.faults import find_faults, missing_samples
from identification.recordings.files import read_tables
from identification.recordings.folders import collect, short_names, wanted
from identification.recordings.parsed import Parsed
from identification.recordings.quantum import encoder_quantum, velocity_cutoff
from identification.recordings.recognise import recognise_excitation
from identification.recordings.recording_set import RecordingSet, Skipped, reasons
from identification.recordings.rig import Rig, load_rig
from identification.recordings.roles import find_roles
from identification.recordings.scale import choose_units
from identification.recordings.sentinels import sentinel
from identification.recordings.stamps import experiments
from identification.recordings.timing import make_uniform
from identification.recordings.wraps import unwrapped

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from flexdrive_gym.recording import FloatArray
    from identification.recordings.rig import FileRule
    from identification.recordings.table import Table

MOST_REASONS = 20  # lines of a listing on a terminal
COUNTED = 1e-6  # by which counts that were converted and back may miss whole numbers


@dataclass(frozen=True)
class _File:
    """A file that may be a recording, with the folder it was found in and the rule it falls under."""

    path: Path
    root: Path | None
    name: str
    rule: FileRule | None
    rig: Rig

    @property
    def source(self) -> str:
        """Path from the folder down."""
        return _source(self.path, self.root)


def read_recordings(
    paths: str | Path | Sequence[str | Path],
    *,
    rig: Rig | str | Path | None = None,
    strict: bool = False,
    only: Sequence[str] = (),
    skip: Sequence[str] = (),
    units: Units | None = None,
) -> RecordingSet:
    """Read the recordings of one rig.

    Parameters
    ----------
    paths
        A folder, searched recursively for text (``.csv``, ``.txt`` and others, also compressed), ``.mat``, ``.npz``,
        ``.h5``, ``.xlsx`` and ``.parquet`` in sorted order, a file, or several of either.
    rig
        What the columns mean: a description, or the ``rig.toml`` it stands in; default: the reader recognises names by itself.
    strict
        A file that cannot be read raises instead of being left out.
    only, skip
        Patterns, such as ``2-5/*``, of the files to read and of those to leave out.
    units
        Units that the recordings are brought to, such as a drive's; default: chosen from the recordings themselves.

    Returns
    -------
    RecordingSet
        A tuple of recordings with quanta, excitation, faults and notes, and with what was left out and why. Names are file
        names without extension, with the folder's in front where two files have the same.

    Raises
    ------
    RecordingError
        If a path does not exist, nothing can be read (with every file's reason), or ``units`` are not the rig's. The message
        names the file, the column, the rule, the value and a remedy.
    """
    described = load_rig(rig) if isinstance(rig, str | Path) else rig or Rig()
    _check_names(described, units)
    given = collect([paths] if isinstance(paths, str | Path) else list(paths))
    files = _files(given, described, only, skip)
    skipped: dict[str, Skipped] = {}
    parsed: list[Parsed] = []
    errors: list[RecordingError] = []
    names = {file.name for file in files}
    for file, found in zip(files, _parse_all(files), strict=True):
        if not isinstance(found, RecordingError):
            parsed += [
                replace(p, name=f"{p.name}_of_{len(found)}") if len(found) > 1 and p.name in names else p for p in found
            ]
            continue
        error = _from_the_folder_down(file, found)
        if strict and not isinstance(error, NotARecordingError):
            raise error
        errors.append(error)
        skipped[file.name] = Skipped(file.source, str(error).removeprefix(f"{file.source}: "))
    scaled = choose_units(described, parsed) if units is None else units
    sound: dict[str, Recording] = {}
    for item in parsed:
        try:
            sound[item.name] = _recording(item, scaled)
        except RecordingError as error:
            if strict:
                raise
            errors.append(error)
            skipped[item.name] = Skipped(item.source, str(error).removeprefix(f"{item.source}: "))
    for copy, original in find_copies([item for item in parsed if item.name in sound]):
        # of one file its parts are told apart by their names
        same = copy.source == original.source
        reason = f"{copy.name} is the same run as {original.name}" if same else f"the same run as {original.source}"
        skipped[copy.name] = Skipped(copy.source, reason)
        del sound[copy.name]
    recordings = list(sound.values())
    if not recordings:
        raise _nothing(paths, files, skipped, errors)
    order = {file.source: k for k, file in enumerate(files)}
    listed = sorted(skipped.values(), key=lambda item: order[item.file])
    return RecordingSet(find_faults(_share_quantum(recordings)), listed, described, _idle(given, described))


def _check_names(rig: Rig, units: Units | None) -> None:
    """Refuse units that a rig is not measured in."""
    if units is None:
        return
    length, command = rig.unit_names()
    if (units.length, units.command) != (length, command):
        rule = f"must be measured in {units.length} and {units.command}, as the drive is"
        remedy = f'Give the factors to them in rig.toml: [units] x1 = {{ unit = "{units.length}", factor = … }}.'
        raise broken(rig.name or "recordings", "units", rule, f"{length} and {command}", remedy)


def _from_the_folder_down(file: _File, error: RecordingError) -> RecordingError:
    """Return an error that names the file from the folder down, because folders repeat file names."""
    text = str(error)
    return type(error)(file.source + text.removeprefix(file.path.name) if text.startswith(file.path.name) else text)


def _nothing(
    paths: str | Path | Sequence[str | Path],
    files: list[_File],
    skipped: dict[str, Skipped],
    errors: list[RecordingError],
) -> RecordingError:
    """Return the error for a set without any recording, with every file's reason."""
    if len(files) == 1 and files[0].root is None and errors:
        return errors[0]
    lines = [f"\n  {line}" for line in reasons(skipped.values(), MOST_REASONS)]
    got = f"none in {len(files)} file{'' if len(files) == 1 else 's'}. " if files else "no file that was asked for. "
    remedy = "A recording has columns such as t_s,u_V,v1_mm_s,v2_mm_s; a rig.toml says which columns of other names they are."
    return RecordingError(
        f"{_shown(paths)}: files: at least one must be a recording; got {got}{remedy}{''.join(lines)}"
    )


def _source(path: Path, root: Path | None) -> str:
    """Return a path from the folder down."""
    return path.name if root is None else path.relative_to(root).as_posix()


def _files(given: list[tuple[Path, Path | None]], rig: Rig, only: Sequence[str], skip: Sequence[str]) -> list[_File]:
    """Return the files that are asked for."""
    found = [(path, root) for path, root in given if wanted(Path(_source(path, root)), only, skip)]
    names = short_names([path for path, _ in found])
    files = []
    for (path, root), name in zip(found, names, strict=True):
        source = _source(path, root)
        files.append(_File(path, root, name, rig.rule(source), rig.for_file(source)))
    return files


def _idle(given: list[tuple[Path, Path | None]], rig: Rig) -> list[str]:
    """Return the patterns of the rules that hold for no file, for none fits or earlier rules hold."""
    used = [rig.rule(_source(path, root)) for path, root in given]
    return [rule.match for rule in rig.files if not any(rule is other for other in used)]


def _shown(paths: str | Path | Sequence[str | Path]) -> str:
    return str(paths) if isinstance(paths, str | Path) else ", ".join(map(str, paths))


def _parse_all(files: list[_File]) -> list[list[Parsed] | RecordingError]:
    """Understand each file by itself, in the order of the files."""
    return [_attempt(file) for file in files]


def _attempt(file: _File) -> list[Parsed] | RecordingError:
    try:
        return _parse(file)
    except RecordingError as error:
        return error


def _parse(file: _File) -> list[Parsed]:
    """Read one file; one item for every experiment in it. Of several sheets those are left out that are no recordings."""
    if file.rule is not None and not file.rule.use:
        raise NotARecordingError(f"{file.path.name}: left out by rig.toml")
    sheets: list[tuple[str, list[Parsed]]] = []
    errors: dict[str, RecordingError] = {}
    for table in read_tables(file.path):
        try:
            sheets.append((table.part, _of_table(file, table)))
        except RecordingError as error:
            errors[table.part] = error
    if not sheets:
        raise next(iter(errors.values()))
    notes = [left_out(file.path.name, sheet, error) for sheet, error in errors.items()]
    if len(sheets) == 1:
        return [replace(p, notes=(*p.notes, *notes)) for p in sheets[0][1]]
    titles = [re.sub(r"\W+", "_", sheet).strip("_") for sheet, _ in sheets]
    named = _of_sheets(file, dict(zip(titles, sheets, strict=True)), notes)
    if "" not in titles and len({p.name for p in named}) == sum(len(items) for _, items in sheets):
        return named
    # titles that would give two recordings one name are no names
    return _of_sheets(file, {str(k): sheet for k, sheet in enumerate(sheets, 1)}, notes)


def _of_sheets(file: _File, sheets: Mapping[str, tuple[str, list[Parsed]]], notes: Sequence[str]) -> list[Parsed]:
    """Return the recordings of all sheets, with what tells these apart in their names."""
    found = []
    for which, (sheet, items) in sheets.items():
        said = (f"sheet '{sheet}' of {file.source}", *notes)
        name = f"{file.name}_{which}"
        found += [replace(p, name=name + p.name.removeprefix(file.name), notes=(*said, *p.notes)) for p in items]
    return found


def _of_table(file: _File, table: Table) -> list[Parsed]:
    """Put the signals of a table on a uniform time base, in the rig's units; one item for every experiment in it."""
    source, rig = file.path.name, file.rig
    roles = find_roles(table, rig, source)
    signals, mended = _mended(roles.signals, roles.factors)
    t, recorded, dated = seconds_of_stamps(signals.pop("t"), roles.unit)
    pieces = experiments(t) if rig.sample_time is None else [slice(0, t.size)]
    found = []
    for k, piece in enumerate(pieces, 1):
        own = {name: values[piece] for name, values in signals.items()}
        # the grid of the counts is looked for before resampling and interpolation leave it
        steps: dict[str, float] = {name: _step(own[name], roles.factors[name]) for name in CHANNELS if name in own}
        uniform = make_uniform(t[piece], own, source, rig.sample_time)
        cutoff = _cutoff(own, steps, float(np.median(np.diff(uniform.t))), roles.filtered)
        part = (f"experiment {k} of {len(pieces)} in {file.source}",) if len(pieces) > 1 else ()
        notes = (*part, *table.notes, *roles.notes, *mended, *dated, *_filter_notes(roles.filtered, cutoff))
        found.append(
            Parsed(
                f"{file.name}_{k}" if part else file.name,
                file.source,
                uniform,
                own,
                steps,
                cutoff,
                notes,
                table.recorded or recorded,
                "" if file.rule is None else file.rule.session,
                () if file.rule is None or file.rule.held is None else file.rule.held,
            )
        )
    return found


def _mended(signals: Mapping[str, FloatArray], factors: Mapping[str, float]) -> tuple[dict[str, FloatArray], list[str]]:
    """Return signals that go on where a counter began again, without numbers that stand for missing values, and notes."""
    found, notes = dict(signals), list[str]()
    for name in CHANNELS:
        if name not in found:
            continue
        wraps = unwrapped(found[name] / factors[name]) if name[0] == "x" else None
        if wraps is not None:
            found[name] = wraps[0] * factors[name]
            notes.append(f"{name} begins again after {wraps[1]:.6g}: read on from there")
        mark = sentinel(found[name])
        if mark is not None:
            missing = found[name] == mark
            found[name] = np.where(missing, np.nan, found[name])
            said = f"{mark / factors[name]:.10g} in {np.count_nonzero(missing)} samples, far from all else"
            notes.append(f"{name} is {said}: no reading")
    return found, notes


def _step(values: FloatArray, factor: float) -> float:
    """Return the smallest step of a channel, sought among the numbers as they stand in the file."""
    size = abs(factor)
    raw = values / size
    step = encoder_quantum(raw)
    if step == 0.0 and size != 1.0 and np.unique(raw[np.isfinite(raw)]).size > 1:
        finite = raw[np.isfinite(raw)]
        step = 1.0 if bool(np.all(np.abs(finite - np.round(finite)) < COUNTED)) else 0.0
    return step * size


def _filter_notes(filtered: tuple[str, ...], cutoff: float | None) -> tuple[str, ...]:
    if not filtered:
        return ()
    if cutoff is None:
        return ("the cut-off of the velocities' filter is not known: it is fitted with the model",)
    return (f"the velocities' filter has a cut-off of {cutoff:.3g} Hz",)


def _quantum(steps: dict[str, float], Ts: float) -> tuple[float, float]:
    """Return the counts of both encoders, from positions or raw differences."""
    first, second = (steps.get(f"x{cart}") or steps.get(f"v{cart}", 0.0) * Ts for cart in (1, 2))
    return float(f"{first:.6g}"), float(f"{second:.6g}")


def _cutoff(
    signals: dict[str, FloatArray], steps: dict[str, float], Ts: float, filtered: tuple[str, ...]
) -> float | None:
    """Return how the velocities were made: 0 raw, a cut-off [Hz], or ``None`` if the data do not tell."""
    found: list[float | None] = []
    if "v1" not in signals and "v2" not in signals:
        return 0.0  # nothing was made from a position
    for cart in (1, 2):
        x, v = signals.get(f"x{cart}"), signals.get(f"v{cart}")
        if v is None or not np.nanmax(np.abs(v), initial=0.0) > 0.0:
            continue  # a cart that stands does not tell
        if steps[f"v{cart}"] > 0.0 and f"v{cart}" not in filtered:
            found.append(0.0)
        elif x is not None:
            good = np.isfinite(x) & np.isfinite(v)
            found.append(velocity_cutoff(x[good], v[good], Ts))
        else:
            found.append(None)
    known = [cutoff for cutoff in found if cutoff is not None]
    if not known or len(known) < len(found) or max(known) > 1.2 * min(known):
        return None
    return float(np.mean(known))


def _recording(parsed: Parsed, units: Units) -> Recording:
    """Return a recording in the engine's units, its signals checked."""
    one = {name: units.one("mm/s" if name[0] == "v" else "V" if name == "u" else "mm") for name in parsed.raw}
    uniform = replace(
        parsed.uniform,
        t=parsed.uniform.t * units.per_time,
        signals={name: values * one[name] for name, values in parsed.uniform.signals.items()},
        missing={
            name: [(first * units.per_time, last * units.per_time) for first, last in spans]
            for name, spans in parsed.uniform.missing.items()
        },
    )
    raw = {name: values * one[name] for name, values in parsed.raw.items()}
    steps = {name: step * one[name] for name, step in parsed.steps.items()}
    Ts = parsed.Ts * units.per_time
    check_units(raw, steps, Ts, parsed.source, units)
    signals = uniform.signals
    moved = any(np.ptp(signals[key]) > 0.0 for key in CHANNELS if key in signals)
    notes = (*check_excitation(signals["u"], moved, units, parsed.source), *scale_warnings(raw, steps, Ts, units))
    excitation = recognise_excitation(uniform.t, signals["u"], signals.get("x1"), signals.get("x2"), signals.get("xr"))
    channels: dict[str, Any] = {key: signals.get(key) for key in (*CHANNELS, "xr")}
    return Recording(
        name=parsed.name,
        t=uniform.t,
        u=signals["u"],
        **channels,
        quantum=_quantum(steps, Ts),
        velocity_cutoff=None if parsed.cutoff is None else parsed.cutoff / units.per_time,
        excitation=excitation,
        faults=missing_samples(uniform, parsed.name),
        notes=(*parsed.notes, *notes, *uniform.notes, *(() if moved else ("nothing moves",))),
        source=parsed.source,
        units=units,
        recorded=parsed.recorded,
        session=parsed.session,
        held=parsed.held,
    )


def _share_quantum(recordings: list[Recording]) -> list[Recording]:
    """Give a cart that never moved the count that its encoder shows in the other runs, if they agree."""
    known = [[r.quantum[k] for r in recordings if r.quantum[k] > 0.0] for k in (0, 1)]
    counts = [float(np.median(values)) if values and max(values) < 1.001 * min(values) else 0.0 for values in known]

    def shared(recording: Recording, k: int) -> float:
        channels = [values for name, values in recording.channels() if name[1] == str(k + 1)]
        still = bool(channels) and all(np.ptp(values) == 0.0 for values in channels)
        return counts[k] if still else recording.quantum[k]

    return [replace(r, quantum=(shared(r, 0), shared(r, 1))) for r in recordings]
