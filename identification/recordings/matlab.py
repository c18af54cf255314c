"""MATLAB files, v4 to v7.3, to named columns.

Four layouts are understood, several of them per file:

* plain vectors, in the workspace or in a struct: ``t``, ``u``, ``x1`` or ``run.t``, ``run.u``;
* Simulink's *structure with time*: ``S.time``, ``S.signals(k).values``, ``S.signals(k).label``;
* timeseries turned into structs: ``ts.Time``, ``ts.Data``, ``ts.Name``;
* a matrix whose first column is time (Simulink's *array*), where a list of as many names lies beside it.

Signals logged at different rates are joined on the time base of the command: measurements by linear
interpolation, the command and the reference held, because that is what the digital-to-analogue converter
does.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from identification.recordings.columns import recognise_column
from identification.recordings.errors import broken
from identification.recordings.matlab_tree import load_tree

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from flexdrive_gym.recording import FloatArray

_LABEL_VARIABLES = ("labels", "label", "names", "columns", "header", "headers", "colnames")


@dataclass(frozen=True)
class _Piece:
    """Signals that share one time base; ``time`` is in s, or ``None`` where the file gives none."""

    time: FloatArray | None
    labels: list[str]
    values: list[FloatArray]


def read_matlab(path: Path) -> tuple[tuple[str, ...], tuple[FloatArray, ...], tuple[str, ...]]:
    """Read the signals of a ``.mat`` file.

    Parameters
    ----------
    path
        Existing file of any MATLAB version from 4 to 7.3.

    Returns
    -------
    labels : tuple of str
        Names, the time first where there is one.
    values : tuple of ndarray, each of shape (n,)
    notes : tuple of str

    Raises
    ------
    RecordingError
        If the file is damaged, holds no signals, or holds a matrix whose columns nobody names.
    """
    tree, notes = load_tree(path)
    pieces = list(_pieces(tree, "", path.name))
    if not pieces:
        raise broken(
            path.name,
            "file",
            "must hold vectors, a structure with time or timeseries structs",
            f"variables {', '.join(tree) or 'none'}" + "".join(f"; {note}" for note in notes),
            "Save the run as vectors, for example save('run.mat', 't', 'u', 'v1', 'v2').",
        )
    return _join(pieces, notes, path.name)


def _pieces(tree: dict[str, Any], name: str, source: str) -> Iterator[_Piece]:
    """Yield the groups of signals of a struct or of the workspace."""
    keys = {key.lower(): key for key in tree}
    if "signals" in keys and "time" in keys:
        yield _structure_with_time(tree[keys["time"]], tree[keys["signals"]], name, source)
        return
    if "time" in keys and "data" in keys:
        yield _timeseries({low: tree[key] for low, key in keys.items()}, name, source)
        return
    vectors = {key: _vector(value) for key, value in tree.items()}
    plain = {key: value for key, value in vectors.items() if value is not None}
    if plain:
        yield _plain(plain)
    for key, value in tree.items():
        if isinstance(value, dict):
            yield from _pieces(value, key, source)
        elif isinstance(value, list) and value and all(isinstance(item, dict) for item in value):
            for item in value:
                yield from _pieces(item, key, source)
        elif isinstance(value, np.ndarray) and value.ndim == 2 and min(value.shape) > 1:
            yield from _matrix(value, key, tree, source)


def _vector(value: Any) -> FloatArray | None:
    """Return a numeric vector of more than one element as float, else ``None``."""
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "biuf":
        return None
    flat = np.squeeze(value)
    return flat.astype(np.float64) if flat.ndim == 1 and flat.size > 1 else None


def _plain(vectors: dict[str, FloatArray]) -> _Piece:
    time = None
    labels, values = [], []
    for label, vector in vectors.items():
        column = recognise_column(label)
        if time is None and column is not None and column.signal == "t":
            time = vector * column.factor
        else:
            labels.append(label)
            values.append(vector)
    return _Piece(time, labels, values)


def _name(*candidates: Any) -> str:
    """Return the first candidate that is a known column name, else the first that says anything."""
    texts = [str(item).strip().strip("<>") for item in candidates if isinstance(item, str) and item.strip()]
    known = (text for text in texts if recognise_column(text) is not None)
    return next(known, texts[0] if texts else "unnamed")


def _split(values: Any, time: FloatArray, label: str, source: str) -> tuple[list[str], list[FloatArray]]:
    """Return the columns of one logged signal, which may be a vector signal labelled ``a, b``."""
    array = np.squeeze(np.asarray(values, dtype=np.float64))
    if array.ndim == 2 and array.shape[0] != time.size:
        array = array.T
    if array.ndim <= 1:
        return [label], [np.atleast_1d(array)]
    names = [part.strip() for part in label.split(",")]
    if array.ndim > 2 or len(names) != array.shape[1]:
        raise broken(
            source,
            f"signal {label}",
            "each column of a vector signal needs a name",
            f"shape {array.shape}",
            "Log scalar signals, or label the signal with one name per column, separated by commas.",
        )
    return names, list(array.T)


def _time(values: Any, name: str, source: str) -> FloatArray:
    time = np.atleast_1d(np.squeeze(np.asarray(values, dtype=np.float64)))
    if time.ndim != 1 or time.size < 2:
        raise broken(
            source,
            f"struct {name}",
            "its time must be a vector",
            f"shape {time.shape}",
            "Choose the format 'Structure With Time' in the To Workspace block.",
        )
    return time


def _structure_with_time(time: Any, signals: Any, name: str, source: str) -> _Piece:
    base = _time(time, name, source)
    entries = signals if isinstance(signals, list) else [signals]
    labels: list[str] = []
    values: list[FloatArray] = []
    for entry in entries:
        fallback = name if len(entries) == 1 else None
        label = _name(entry.get("label"), fallback, str(entry.get("blockName", "")).rsplit("/", 1)[-1])
        found = _split(entry.get("values"), base, label, source)
        labels += found[0]
        values += found[1]
    return _Piece(base, labels, values)


def _timeseries(fields: dict[str, Any], name: str, source: str) -> _Piece:
    base = _time(fields["time"], name, source)
    labels, values = _split(fields["data"], base, _name(fields.get("name"), name), source)
    return _Piece(base, labels, values)


def _matrix(matrix: Any, name: str, siblings: dict[str, Any], source: str) -> Iterator[_Piece]:
    """Yield the columns of a matrix that a list of names lies beside."""
    if matrix.dtype.kind not in "biuf":
        return
    tall = matrix if matrix.shape[0] >= matrix.shape[1] else matrix.T
    names = _labels_of(name, tall.shape[1], siblings)
    if names is not None:
        yield _plain(dict(zip(names, tall.T.astype(np.float64), strict=True)))
        return
    known = {column.signal for key in siblings if (column := recognise_column(key)) is not None}
    if {"t", "u"} <= known:
        return  # the signals stand beside it as vectors; the matrix is something else
    raise broken(
        source,
        f"matrix {name}",
        "its columns must be named",
        f"shape {matrix.shape} and no list of {tall.shape[1]} names",
        f"Save a cell array with one name per column beside {name}, for example labels = {{'t','u','v1','v2'}}.",
    )


def _labels_of(name: str, count: int, siblings: dict[str, Any]) -> list[str] | None:
    wanted = (f"{name}_labels".lower(), f"{name}_names".lower(), *_LABEL_VARIABLES)
    lists = {
        key.lower(): [str(item).strip() for item in value]
        for key, value in siblings.items()
        if isinstance(value, list) and len(value) == count and all(isinstance(item, str) for item in value)
    }
    best = next((lists[key] for key in wanted if key in lists), None)
    return best if best is not None or not lists else next(iter(lists.values()))


def _same(first: FloatArray, second: FloatArray) -> bool:
    return first.shape == second.shape and bool(np.allclose(first, second, rtol=0.0, atol=1e-9))


def _join(
    pieces: list[_Piece], notes: tuple[str, ...], source: str
) -> tuple[tuple[str, ...], tuple[FloatArray, ...], tuple[str, ...]]:
    """Put all signals on one time base."""
    timed = [piece for piece in pieces if piece.time is not None]
    labels: list[str] = []
    values: list[FloatArray] = []
    base = None if not timed else _base(timed)
    full = base
    if base is not None:
        base = _overlap(base, timed, source)
        labels.append("t_s")
        values.append(base)
    joined = 0
    for piece in pieces:
        for label, vector in zip(piece.labels, piece.values, strict=True):
            if base is None or piece.time is None or _same(piece.time, base):
                values.append(vector)
            else:
                values.append(_on_base(base, piece.time, vector, label, source))
                joined += int(full is not None and not _same(piece.time, full))
            labels.append(label)
    if joined:
        notes = (*notes, f"{joined} signals joined on one time base")
    return tuple(labels), tuple(values), notes


def _base(timed: list[_Piece]) -> FloatArray:
    """Return the time base of the command, else the finest one."""
    for piece in timed:
        for label in piece.labels:
            column = recognise_column(label)
            if column is not None and column.signal == "u" and piece.time is not None:
                return piece.time
    times = [piece.time for piece in timed if piece.time is not None]
    return max(times, key=len)


def _overlap(base: FloatArray, timed: list[_Piece], source: str) -> FloatArray:
    times = [piece.time for piece in timed if piece.time is not None and not _same(piece.time, base)]
    if not times:
        return base
    start, end = max(time[0] for time in times), min(time[-1] for time in times)
    inside: FloatArray = base[(base >= start - 1e-9) & (base <= end + 1e-9)]
    if inside.size < 2:
        raise broken(
            source,
            "time",
            "all signals must cover a common span",
            f"no samples between {start:g} s and {end:g} s",
            "Save the signals of one run only.",
        )
    return inside


def _on_base(base: FloatArray, time: FloatArray, values: FloatArray, label: str, source: str) -> FloatArray:
    if time.shape != values.shape:
        raise broken(
            source,
            f"column {label}",
            "must have as many values as its time",
            f"{values.size} values for {time.size} instants",
            "Save both from the same run.",
        )
    column = recognise_column(label)
    if column is not None and column.signal in ("u", "xr"):
        held = np.searchsorted(time, base + 1e-9, side="right") - 1
        return values[np.clip(held, 0, values.size - 1)]
    return np.interp(base, time, values)
