"""MATLAB files, v4 to v7.3, to columns.

Layouts that are understood, several of them per file:

* plain vectors, in the workspace or in a struct: ``t``, ``u``, ``x1`` or ``run.t``, ``run.u``;
* Simulink's *structure with time*: ``S.time``, ``S.signals(k).values``, ``S.signals(k).label``; without time its ``time`` is
  empty, and the clock is the one of its length;
* timeseries turned into structs: ``ts.Time``, ``ts.Data``, ``ts.Name``;
* Simulink's *array*, ``[time value]``, by the name of its variable;
* a matrix beside a list of as many names, and ``x = [x1 x2]``; without names columns can be had by number, ``data:3``;
* ``Ts`` or ``fs`` where no vector tells the time.

Whatever else a workspace holds, such as a model's matrices, is passed over.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from identification.recordings.columns import read_label
from identification.recordings.errors import broken
from identification.recordings.matlab_tree import load_tree
from identification.recordings.table import Series, Table

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from datetime import datetime
    from pathlib import Path

    from flexdrive_gym.recording import FloatArray

_LABEL_VARIABLES = ("labels", "label", "names", "columns", "header", "headers", "colnames")
# scalars of a workspace that tell the sampling period [s], or the rate [Hz], within these bounds
_PERIODS, _RATES = ("ts", "dt", "sampletime", "sample_time"), ("fs", "samplerate", "sample_rate")
SHORTEST_PERIOD, LONGEST_PERIOD = 1e-5, 0.5
MOST_COLUMNS = 64  # of a matrix whose columns may be signals
FEWEST_ROWS = 20  # of such a matrix


def read_matlab(path: Path) -> Table:
    """Read the columns of a ``.mat`` file.

    Parameters
    ----------
    path
        Existing file of any MATLAB version from 4 to 7.3.

    Returns
    -------
    Table
        Vectors, and columns of matrices, with their clocks where the file pairs them.

    Raises
    ------
    RecordingError
        If the file is damaged or holds nothing that can be a signal.
    """
    tree, remarks, recorded = load_tree(path)
    return columns_of(tree, path.name, remarks, recorded)


def columns_of(
    tree: dict[str, Any], source: str, remarks: tuple[str, ...] = (), recorded: datetime | None = None
) -> Table:
    """Return the columns of a workspace: vectors by their names, and what its structs hold.

    Parameters
    ----------
    tree
        Variables; structs are dictionaries, cells and struct arrays are lists.
    source
        File name for messages.
    remarks, recorded
        As :class:`~identification.recordings.table.Table` has them.

    Raises
    ------
    RecordingError
        If it holds nothing that can be a signal.
    """
    series = tuple(_walk(tree, "", ""))
    counted = _counted(tree, series)
    notes = () if counted is None else (counted[1],)
    series += () if counted is None else (counted[0],)
    unnamed = dict.fromkeys(item.places[0].rpartition(":")[0] for item in series if not item.named)
    if unnamed:
        name = next(iter(unnamed))
        remarks = (
            *remarks,
            f"The columns of {', '.join(list(unnamed)[:6])} have no names; rig.toml calls the second of {name} '{name}:2'",
        )
    if not series:
        raise broken(
            source,
            "file",
            "must hold vectors, a structure with time or timeseries structs",
            f"variables {', '.join(list(tree)[:12]) or 'none'}" + "".join(f"; {hint}" for hint in remarks),
            "Save the run as vectors, for example "
            + ("save('run.mat', 't', 'u', 'v1', 'v2')." if source.lower().endswith(".mat") else "t, u, v1 and v2."),
        )
    return Table(series, notes=notes, remarks=remarks, recorded=recorded, in_lines=False)


def _walk(tree: dict[str, Any], name: str, group: str) -> Iterator[Series]:
    """Yield the columns of a struct, or of the workspace."""
    keys = {key.lower(): key for key in tree}
    if "signals" in keys and "time" in keys:
        yield from _structure_with_time(tree[keys["time"]], tree[keys["signals"]], name, group, tree)
        return
    if "time" in keys and "data" in keys:
        yield from _logged(
            tree[keys["data"]], _clock(tree[keys["time"]]), [tree.get(keys.get("name", "")), name], name, group
        )
        return
    for key, value in tree.items():
        inner = f"{group}.{key}" if group else key
        if isinstance(value, dict):
            yield from _walk(value, key, inner)
        elif isinstance(value, list) and value and all(isinstance(item, dict) for item in value):
            for k, item in enumerate(value, 1):
                yield from _walk(item, key, f"{inner}({k})")
        elif _numeric(value):
            yield from _array(value, key, inner, group, tree)


def _numeric(value: Any) -> bool:
    return isinstance(value, np.ndarray) and value.dtype.kind in "biuf" and value.size > 1


def _array(value: Any, key: str, place: str, group: str, siblings: dict[str, Any]) -> Iterator[Series]:
    """Yield a vector, or the columns of a matrix."""
    flat = np.squeeze(value)
    if flat.ndim == 1:
        yield Series(key, flat.astype(np.float64), group=group, places=(place,))
        return
    tall = flat if flat.ndim != 2 or flat.shape[0] >= flat.shape[1] else flat.T
    if tall.ndim != 2 or tall.shape[0] < FEWEST_ROWS or tall.shape[1] > MOST_COLUMNS:
        return
    columns = [np.ascontiguousarray(column, dtype=np.float64) for column in tall.T]
    names = _labels_of(key, len(columns), siblings)
    known = read_label(key)
    if names is None and len(columns) == 2 and known is not None and known.signal != "t" and _rises(columns[0]):
        yield Series(key, columns[1], clock=columns[0], group=group, places=(f"{place}:2",))
        yield Series(f"{key}:1", columns[0], group=group, places=(f"{place}:1",), named=False)
        return
    both = _of_both_carts(key) if names is None and len(columns) == 2 else None
    for k, column in enumerate(columns):
        spelt = (f"{place}:{k + 1}", f"{place}({k + 1})", f"{place}(:,{k + 1})")
        label = (names or both or [f"{key}:{n + 1}" for n in range(len(columns))])[k]
        yield Series(label, column, group=group, places=spelt, named=names is not None or both is not None)


def _of_both_carts(key: str) -> list[str] | None:
    """Return the names of two columns if the variable is one of positions or velocities that says no cart."""
    names = [f"{key}({cart})" for cart in (1, 2)]
    signals = [column.signal for column in map(read_label, names) if column is not None]
    return names if signals in (["x1", "x2"], ["v1", "v2"]) and not any(c.isdigit() for c in key) else None


def _counted(tree: dict[str, Any], series: Sequence[Series]) -> tuple[Series, str] | None:
    """Return the time that a sampling period in the workspace counts, and a note, where nothing else tells time."""
    known = [column for item in series if item.named and (column := read_label(item.label)) is not None]
    commands = [item for item in series if item.named and (c := read_label(item.label)) is not None and c.signal == "u"]
    if not commands or any(item.clock is not None for item in series) or any(c.signal == "t" for c in known):
        return None
    for key, value in tree.items():
        number = float(value) if isinstance(value, int | float | np.number) else 0.0
        period = number if key.lower() in _PERIODS else 1.0 / number if key.lower() in _RATES and number > 0.0 else 0.0
        if SHORTEST_PERIOD <= period <= LONGEST_PERIOD:
            t = np.arange(commands[0].values.size, dtype=np.float64) * period
            return Series("t", t, places=("t",)), f"time is counted: {key} = {number:g}"
    return None


def _rises(values: FloatArray) -> bool:
    return bool(np.all(np.isfinite(values)) and np.all(np.diff(values) > 0.0))


def _name(*candidates: Any) -> str:
    """Return the candidate that names a signal best: one with a cart's number before one without, else the first."""
    texts = [" ".join(item.split()).strip("<>") for item in candidates if isinstance(item, str) and item.strip("<> \n")]
    known = [(text, column) for text in texts if (column := read_label(text)) is not None]
    for text, column in known:
        if column.signal in ("t", "u", "xr") or any(mark in text for mark in "12"):
            return text
    return known[0][0] if known else texts[0] if texts else "unnamed"


def _clock(values: Any) -> FloatArray | None:
    """Return a time vector, or ``None`` where there is none."""
    if not _numeric(values):
        return None
    time = np.squeeze(values)
    return time.astype(np.float64) if time.ndim == 1 else None


def _structure_with_time(time: Any, signals: Any, name: str, group: str, fields: dict[str, Any]) -> Iterator[Series]:
    entries = [item for item in (signals if isinstance(signals, list) else [signals]) if isinstance(item, dict)]
    clock = _clock(time)
    for k, entry in enumerate(entries, 1):
        block = entry.get("blockName") or (fields.get("blockName") if len(entries) == 1 else "")
        block = block.rsplit("/", 1)[-1] if isinstance(block, str) else ""
        own = name if len(entries) == 1 else f"{name}.{k}"
        names = [entry.get("label"), name if len(entries) == 1 else None, block, entry.get("title")]
        yield from _logged(entry.get("values"), clock, names, own, group)


def _logged(values: Any, clock: FloatArray | None, names: list[Any], place: str, group: str) -> Iterator[Series]:
    """Yield the columns of one logged signal, which may be a vector signal labelled ``a, b``."""
    if not _numeric(values):
        return
    array = np.squeeze(values)
    if array.ndim == 2 and clock is not None and array.shape[0] != clock.size:
        array = array.T
    if array.ndim > 2 or (array.ndim == 2 and array.shape[1] > MOST_COLUMNS):
        return
    columns = [array.astype(np.float64)] if array.ndim == 1 else list(array.T.astype(np.float64))
    if len(columns) == 1:
        if clock is None or clock.size == columns[0].size:
            yield Series(_name(*names), columns[0], clock, group, (place,))
        return
    label = next((str(item) for item in names if isinstance(item, str) and "," in item), "")
    parts = [part.strip() for part in label.split(",")] if label else []
    if clock is not None and clock.size != columns[0].size:
        return
    for k, column in enumerate(columns):
        named = len(parts) == len(columns)
        spelt = (f"{place}:{k + 1}", f"{place}({k + 1})", f"{place}(:,{k + 1})")
        yield Series(parts[k] if named else f"{place}:{k + 1}", column, clock, group, spelt, named)


def _labels_of(name: str, count: int, siblings: dict[str, Any]) -> list[str] | None:
    """Return the list of as many names that lies beside a matrix, if there is one."""
    wanted = (f"{name}_labels".lower(), f"{name}_names".lower(), *_LABEL_VARIABLES)
    lists = {
        key.lower(): [item.strip() for item in value]
        for key, value in siblings.items()
        if isinstance(value, list) and len(value) == count and all(isinstance(item, str) for item in value)
    }
    best = next((lists[key] for key in wanted if key in lists), None)
    return best if best is not None or not lists else next(iter(lists.values()))
