"""Files and folders to complete recordings: units checked, excitation recognised, faults found."""

from __future__ import annotations

import difflib
from collections import Counter
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from flexdrive_gym.recording import CHANNELS, Recording
from identification.recordings.checks import check_excitation, check_units
from identification.recordings.columns import assign_columns, only_reference, require_columns
from identification.recordings.errors import RecordingError, broken
from identification.recordings.faults import find_faults, missing_samples
from identification.recordings.files import EXTENSIONS, extension, read_table
from identification.recordings.quantum import encoder_quantum, velocity_cutoff
from identification.recordings.recognise import recognise_excitation
from identification.recordings.recording_set import RecordingSet, Skipped
from identification.recordings.rig import Rig, load_rig
from identification.recordings.timing import Uniform, make_uniform

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flexdrive_gym.recording import FloatArray
    from identification.recordings.files import Table


class _NotARecordingError(RecordingError):
    """A readable file that is no recording, such as a reference trajectory."""


def read_recordings(
    paths: str | Path | Sequence[str | Path],
    *,
    rig: Rig | str | Path | None = None,
    strict: bool = False,
    only: Sequence[str] = (),
    skip: Sequence[str] = (),
) -> RecordingSet:
    """Read the recordings of one rig.

    Parameters
    ----------
    paths
        A folder, searched recursively for ``.csv``, ``.csv.gz`` and ``.mat`` in sorted order, a file, or
        several of either.
    rig
        What the columns mean: a description, or the ``rig.toml`` it stands in; default: the reader recognises names by itself.
    strict
        A file of a folder that cannot be read raises instead of being left out.
    only, skip
        Patterns, such as ``2-5/*``, of the files to read and of those to leave out.

    Returns
    -------
    RecordingSet
        A tuple of recordings with quanta, excitation, faults and notes, and with what was left out and why. Names are file
        names without extension, with the folder's in front where two files have the same.

    Raises
    ------
    RecordingError
        If a path does not exist, a file that was named itself cannot be read, or nothing can: with every file's reason. The
        message names the file, the column, the rule, the value and a remedy.
    """
    described = load_rig(rig) if isinstance(rig, str | Path) else rig or Rig()
    files = [
        (path, root)
        for path, root in _collect([paths] if isinstance(paths, str | Path) else list(paths))
        if _wanted(path if root is None else path.relative_to(root), only, skip)
    ]
    names = _names([path for path, _ in files])
    recordings = []
    skipped: list[Skipped] = []
    for (path, root), name in zip(files, names, strict=True):
        source = path.name if root is None else path.relative_to(root).as_posix()
        try:
            recordings.append(_read(path, name, source))
        except RecordingError as error:
            # folders repeat file names, so the message names the file from the folder down
            message = source + str(error).removeprefix(path.name)
            if root is None or (strict and not isinstance(error, _NotARecordingError)):
                raise RecordingError(message) from error
            skipped.append(Skipped(source, str(error).removeprefix(f"{path.name}: ")))
    if not recordings:
        listing = "".join(f"\n  {item.file}: {item.reason}" for item in skipped) or "no file that was asked for"
        raise broken(
            _shown(paths),
            "files",
            "at least one must be a recording",
            listing,
            "A recording has columns such as t_s,u_V,v1_mm_s,v2_mm_s; 'flexdrive check' says more.",
        )
    return RecordingSet(find_faults(_share_quantum(recordings)), skipped, described)


def _wanted(path: Path, only: Sequence[str], skip: Sequence[str]) -> bool:
    def matches(patterns: Sequence[str]) -> bool:
        return any(fnmatchcase(text, pattern) for pattern in patterns for text in (path.as_posix(), path.name))

    return (not only or matches(only)) and not matches(skip)


def _shown(paths: str | Path | Sequence[str | Path]) -> str:
    return str(paths) if isinstance(paths, str | Path) else ", ".join(map(str, paths))


def _collect(paths: list[str | Path]) -> list[tuple[Path, Path | None]]:
    """Return each file once, with the folder it was found in, or ``None`` if it was named itself."""
    found: dict[Path, tuple[Path, Path | None]] = {}
    if not paths:
        raise broken("recordings", "paths", "at least one file or folder is needed", "none", "Name one.")
    for item in paths:
        path = Path(item)
        if path.is_dir():
            for file in _folder(path):
                found.setdefault(file.resolve(), (file, path))
        elif path.exists():
            found[path.resolve()] = (path, None)
        else:
            raise _missing(path)
    return list(found.values())


def _folder(folder: Path) -> list[Path]:
    """Return the files of a folder that may be recordings, hidden ones aside."""
    every = sorted(path for path in folder.rglob("*") if path.is_file())
    visible = [p for p in every if not any(part.startswith(".") for part in p.relative_to(folder).parts)]
    files = [path for path in visible if extension(path) in EXTENSIONS]
    if not files:
        other = ", ".join(path.name for path in visible[:5]) or "nothing"
        raise broken(
            str(folder),
            "folder",
            f"must contain {', '.join(EXTENSIONS)} files",
            other,
            "Export the logs as .csv with a header line such as t_s,u_V,v1_mm_s,v2_mm_s.",
        )
    return files


def _missing(path: Path) -> RecordingError:
    parent = path.parent
    siblings = [item.name for item in parent.iterdir()] if parent.is_dir() else []
    near = difflib.get_close_matches(path.name, siblings, n=1, cutoff=0.6)
    remedy = f"Did you mean {near[0]}?" if near else "Check the spelling and the working directory."
    return broken(str(path), "path", "must exist", "no such file or folder", remedy)


def _stem(path: Path) -> str:
    return path.name[: len(path.name) - len(extension(path))] or path.name


def _names(files: list[Path]) -> list[str]:
    """Return short names, with as many folders in front as it takes to tell equal ones apart."""
    names = [_stem(path) for path in files]
    parts = [path.resolve().parts for path in files]
    for depth in range(1, max((len(p) for p in parts), default=1)):
        counts = Counter(names)
        if max(counts.values()) == 1:
            break
        names = [
            "_".join((*parts[k][-1 - depth : -1], _stem(files[k]))) if counts[name] > 1 else name
            for k, name in enumerate(names)
        ]
    # one folder may hold the same run as .csv and as .mat, which no folder in front tells apart
    counts = Counter(names)
    return [
        f"{_stem(path)}_{extension(path)[1:].replace('.', '_')}" if counts[name] > 1 else name
        for name, path in zip(names, files, strict=True)
    ]


def _read(path: Path, name: str, source: str) -> Recording:
    """Read one file; ``name`` is the recording's, ``source`` what messages call the file."""
    table = read_table(path)
    signals, notes = _signals(table, path.name)
    # the grid of the counts is looked for before resampling and interpolation leave it
    steps: dict[str, float] = {key: encoder_quantum(signals[key]) for key in CHANNELS if key in signals}
    uniform = make_uniform(signals.pop("t"), signals, path.name)
    Ts = float(np.median(np.diff(uniform.t)))
    check_units(signals, steps, Ts, path.name)
    notes += check_excitation(uniform.signals["u"], path.name)
    return _recording(name, source, uniform, _quantum(steps, Ts), _cutoff(signals, steps, Ts), notes)


def _signals(table: Table, source: str) -> tuple[dict[str, FloatArray], tuple[str, ...]]:
    """Return the recognised signals in s, V, mm and mm/s."""
    columns, notes = assign_columns(table.labels, source)
    if only_reference(columns.values()):
        raise _NotARecordingError(
            f"{source}: columns: must contain the command and a position or velocity; got time and reference "
            "only. This is a reference trajectory, not a recording; leave it out."
        )
    require_columns(columns.values(), table.labels, source)
    signals: dict[str, FloatArray] = {
        column.signal: np.where(np.isfinite(table.values[k]), table.values[k] * column.factor, np.nan)
        for k, column in columns.items()
    }
    size = signals["t"].size
    for k, column in columns.items():
        if table.values[k].size != size:
            raise broken(
                source,
                f"column {column.label}",
                "must have as many values as time",
                f"{table.values[k].size} values for {size} instants",
                "Save both from the same run.",
            )
    return signals, (*table.notes, *notes)


def _quantum(steps: dict[str, float], Ts: float) -> tuple[float, float]:
    """Return the counts of both encoders [mm], from positions or raw differences."""
    first, second = (steps.get(f"x{cart}") or steps.get(f"v{cart}", 0.0) * Ts for cart in (1, 2))
    return float(f"{first:.6g}"), float(f"{second:.6g}")


def _cutoff(signals: dict[str, FloatArray], steps: dict[str, float], Ts: float) -> float | None:
    """Return how the velocities were made: 0 raw, a cut-off [Hz], or ``None`` if the data do not tell."""
    found: list[float | None] = []
    if "v1" not in signals and "v2" not in signals:
        return 0.0  # nothing was made from a position
    for cart in (1, 2):
        x, v = signals.get(f"x{cart}"), signals.get(f"v{cart}")
        if v is None or not np.nanmax(np.abs(v)) > 0.0:
            continue  # a cart that stands does not tell
        if steps[f"v{cart}"] > 0.0:
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


def _recording(
    name: str,
    source: str,
    uniform: Uniform,
    quantum: tuple[float, float],
    cutoff: float | None,
    notes: tuple[str, ...],
) -> Recording:
    signals = uniform.signals
    channels: dict[str, Any] = {key: signals.get(key) for key in (*CHANNELS, "xr")}
    excitation = recognise_excitation(uniform.t, signals["u"], signals.get("x1"), signals.get("x2"), signals.get("xr"))
    moved = any(np.ptp(signals[key]) > 0.0 for key in CHANNELS if key in signals)
    return Recording(
        name=name,
        t=uniform.t,
        u=signals["u"],
        **channels,
        quantum=quantum,
        velocity_cutoff=cutoff,
        excitation=excitation,
        faults=missing_samples(uniform, name),
        notes=(*notes, *uniform.notes, *(() if moved else ("nothing moves",))),
        source=source,
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
