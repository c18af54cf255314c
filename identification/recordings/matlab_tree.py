"""MATLAB files to a tree of dictionaries, lists, strings and arrays, the same for every version.

Versions 4 to 7.2 are read by :func:`scipy.io.loadmat`. Version 7.3 is HDF5: groups are structs, character
arrays are ``uint16`` with the attribute ``MATLAB_class``, cells and struct arrays are arrays of references,
and matrices are stored transposed.
"""

from __future__ import annotations

import io
import struct
import warnings
import zlib
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
import scipy.io
from scipy.io.matlab import MatlabFunction, MatlabOpaque, MatReadError

from identification.recordings.dates import date_of_header
from identification.recordings.errors import damaged
from identification.recordings.matlab_sizes import DEEPEST, check_sizes
from identification.recordings.table import LARGEST

if TYPE_CHECKING:
    from datetime import datetime
    from pathlib import Path

_DAMAGED = (
    OSError,
    ValueError,
    TypeError,
    KeyError,
    IndexError,
    EOFError,
    RuntimeError,
    MemoryError,
    OverflowError,
    AttributeError,
    struct.error,
    zlib.error,
    MatReadError,
)


def load_tree(path: Path) -> tuple[dict[str, Any], tuple[str, ...], datetime | None]:
    """Read a ``.mat`` file, or another of HDF5.

    Parameters
    ----------
    path
        Existing file.

    Returns
    -------
    tree : dict
        Variables; structs are dictionaries, cells and struct arrays are lists.
    remarks : tuple of str
        Variables that only MATLAB itself can read.
    recorded : datetime or None
        When MATLAB saved it, as its header says.

    Raises
    ------
    RecordingError
        If the file is damaged or not a MATLAB file.
    """
    matlab = path.suffix.lower() == ".mat"
    try:
        with path.open("rb") as file:
            head = file.read(116)
        tree = _load(path) if matlab and not h5py.is_hdf5(path) else _load_7_3(path)
    except _DAMAGED as error:
        remedy = "Copy the file again" + (", or save it again with save('run.mat', '-v7')." if matlab else ".")
        raise damaged(path.name, "MATLAB" if matlab else "HDF5", error, remedy) from error
    opaque = [name for name, value in tree.items() if value is _OPAQUE and name != "None"]
    remarks = tuple(
        f"variable {name} is an object that only MATLAB reads; save its Time, Data and Name as a struct"
        for name in opaque[:6]
    )
    return {name: value for name, value in tree.items() if value is not _OPAQUE}, remarks, date_of_header(head)


def _load(path: Path) -> dict[str, Any]:
    """Read versions 4 to 7.2."""
    size = path.stat().st_size
    if size > LARGEST:
        raise ValueError(f"{size >> 20} MB, more than {LARGEST >> 20} MB")
    data = path.read_bytes()
    check_sizes(data)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of variables that are there twice or are objects
        raw = scipy.io.loadmat(io.BytesIO(data), simplify_cells=True)  # type: ignore[arg-type]
    return {name: _scipy(value) for name, value in raw.items() if not name.startswith("__")}


def _load_7_3(path: Path) -> dict[str, Any]:
    """Read version 7.3."""
    with h5py.File(path, "r") as file:
        budget = _Budget(1 << 20 | 1100 * path.stat().st_size)
        return {name: _hdf5(file[name], file, budget) for name in file if not name.startswith("#")}


class _Budget:
    """How much may still be read of a file: no compression packs numbers more than a thousandfold."""

    def __init__(self, size: int) -> None:
        self.left = min(size, LARGEST)
        self.depth = 0

    def take(self, item: Any) -> None:
        self.left -= item.size * item.dtype.itemsize
        if self.left < 0:
            raise ValueError(f"{item.name} declares {item.size} values, more than the file can hold")


_OPAQUE = object()


def _scipy(value: Any) -> Any:
    if isinstance(value, MatlabOpaque | MatlabFunction):
        return _OPAQUE
    if isinstance(value, dict):
        return {key: _scipy(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_scipy(item) for item in value]
    if isinstance(value, np.ndarray) and value.dtype.kind in "OU":
        items = [_scipy(item) for item in value.ravel()]
        # a one-element cell or struct array is what it holds
        return items[0] if len(items) == 1 else items
    return value


def _hdf5(item: Any, file: Any, budget: _Budget) -> Any:
    budget.depth += 1
    if budget.depth > DEEPEST:
        raise ValueError(f"more than {DEEPEST} structs within each other")
    try:
        return _group(item, file, budget) if isinstance(item, h5py.Group) else _dataset(item, file, budget)
    finally:
        budget.depth -= 1


def _refers(item: Any) -> bool:
    # texts of other programs are of the same type as references
    return h5py.check_ref_dtype(item.dtype) is not None


def _dataset(item: Any, file: Any, budget: _Budget) -> Any:
    if not isinstance(item, h5py.Dataset) or item.shape is None:
        return _OPAQUE
    budget.take(item)
    kind = item.attrs.get("MATLAB_class", b"")
    kind = kind.decode() if isinstance(kind, bytes) else str(kind)
    if item.attrs.get("MATLAB_empty", 0):
        return "" if kind == "char" else np.empty(0)
    if _refers(item):
        items = [_hdf5(file[reference], file, budget) for reference in item[()].ravel()]
        return items[0] if len(items) == 1 else items
    values = item[()]
    if kind == "char":
        return "".join(chr(int(code)) for code in np.asarray(values).T.ravel())
    if item.attrs.get("MATLAB_object_decode", 0) or item.dtype.kind not in "biuf":
        return _OPAQUE
    return np.asarray(values).T


def _group(group: Any, file: Any, budget: _Budget) -> Any:
    """Return a struct as a dictionary, or a struct array as a list of them."""
    if "MATLAB_object_decode" in group.attrs:
        return _OPAQUE
    fields = dict(group.items())
    arrays = {
        name: item
        for name, item in fields.items()
        # a field of a struct array is an array of references without a class of its own; a cell has one
        if isinstance(item, h5py.Dataset) and _refers(item) and "MATLAB_class" not in item.attrs
    }
    if fields and len(arrays) == len(fields):
        for item in arrays.values():
            budget.take(item)
        columns = {
            name: [_hdf5(file[reference], file, budget) for reference in item[()].ravel()]
            for name, item in arrays.items()
        }
        count = min(len(items) for items in columns.values())
        return [{name: items[k] for name, items in columns.items()} for k in range(count)]
    return {name: _hdf5(item, file, budget) for name, item in fields.items()}
