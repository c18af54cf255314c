"""MATLAB files to a tree of dictionaries, lists, strings and arrays, the same for every version.

Versions 4 to 7.2 are read by :func:`scipy.io.loadmat`. Version 7.3 is HDF5: groups are structs, character
arrays are ``uint16`` with the attribute ``MATLAB_class``, cells and struct arrays are arrays of references,
and matrices are stored transposed.
"""

from __future__ import annotations

import struct
import zlib
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
import scipy.io
from scipy.io.matlab import MatlabFunction, MatlabOpaque, MatReadError

from identification.recordings.errors import broken

if TYPE_CHECKING:
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


def load_tree(path: Path) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Read a ``.mat`` file.

    Parameters
    ----------
    path
        Existing file.

    Returns
    -------
    tree : dict
        Variables; structs are dictionaries, cells and struct arrays are lists.
    notes : tuple of str
        Variables that only MATLAB itself can read.

    Raises
    ------
    RecordingError
        If the file is damaged or not a MATLAB file.
    """
    try:
        if h5py.is_hdf5(path):
            with h5py.File(path, "r") as file:
                tree = {name: _hdf5(item, file) for name, item in file.items() if not name.startswith("#")}
        else:
            raw = scipy.io.loadmat(path, simplify_cells=True)
            tree = {name: _scipy(value) for name, value in raw.items() if not name.startswith("__")}
    # what a damaged file raises depends on the byte that is damaged
    except _DAMAGED as error:
        raise broken(
            path.name,
            "file",
            "must be a complete MATLAB file",
            f"{type(error).__name__}: {error}",
            "Copy the file again, or save it again with save('run.mat', '-v7').",
        ) from error
    opaque = [name for name, value in tree.items() if value is _OPAQUE]
    notes = tuple(
        f"variable {name} is an object that only MATLAB reads; save its Time, Data and Name as a struct"
        for name in opaque
    )
    return {name: value for name, value in tree.items() if value is not _OPAQUE}, notes


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


def _hdf5(item: Any, file: Any) -> Any:
    if isinstance(item, h5py.Group):
        return _group(item, file)
    kind = item.attrs.get("MATLAB_class", b"")
    kind = kind.decode() if isinstance(kind, bytes) else str(kind)
    if item.attrs.get("MATLAB_empty", 0):
        return "" if kind == "char" else np.empty(0)
    if item.dtype == h5py.ref_dtype:
        items = [_hdf5(file[reference], file) for reference in item[()].ravel()]
        return items[0] if len(items) == 1 else items
    values = item[()]
    if kind == "char":
        return "".join(chr(int(code)) for code in np.asarray(values).T.ravel())
    if item.attrs.get("MATLAB_object_decode", 0) or item.dtype.kind not in "biuf":
        return _OPAQUE
    return np.asarray(values).T


def _group(group: Any, file: Any) -> Any:
    """Return a struct as a dictionary, or a struct array as a list of them."""
    if "MATLAB_object_decode" in group.attrs:
        return _OPAQUE
    fields = dict(group.items())
    arrays = {
        name: item
        for name, item in fields.items()
        # a field of a struct array is an array of references without a class of its own; a cell has one
        if isinstance(item, h5py.Dataset) and item.dtype == h5py.ref_dtype and "MATLAB_class" not in item.attrs
    }
    if fields and len(arrays) == len(fields):
        columns = {
            name: [_hdf5(file[reference], file) for reference in item[()].ravel()] for name, item in arrays.items()
        }
        count = min(len(items) for items in columns.values())
        return [{name: items[k] for name, items in columns.items()} for k in range(count)]
    return {name: _hdf5(item, file) for name, item in fields.items()}
