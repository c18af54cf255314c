"""NumPy's ``.npz`` archives to columns: arrays by their names, as the variables of a workspace."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any
from zipfile import BadZipFile

import numpy as np

from identification.recordings.errors import RecordingError, damaged
from identification.recordings.matlab import columns_of
from identification.recordings.table import require_unpacked_size

if TYPE_CHECKING:
    from pathlib import Path

    from identification.recordings.table import Table


def read_npz(path: Path) -> Table:
    """Read the columns of an ``.npz`` file; objects that Python would have to run are passed over.

    Raises
    ------
    RecordingError
        If the file is damaged, too large, or holds nothing that can be a signal.
    """
    try:
        require_unpacked_size(path, "Split the run.")
        tree = {}
        with np.load(path, allow_pickle=False) as archive:
            for name in archive.files:
                try:
                    tree[name] = _plain(archive[name])
                except ValueError as error:
                    if "pickle" not in str(error):
                        raise
    except RecordingError:
        raise
    except (OSError, EOFError, KeyError, TypeError, ValueError, MemoryError, BadZipFile, SyntaxError) as error:
        remedy = "Save it again with numpy.savez('run.npz', t=t, u=u, x1=x1, x2=x2)."
        raise damaged(path.name, ".npz", error, remedy) from error
    return columns_of(tree, path.name)


def _plain(values: Any) -> Any:
    """Return an array, a number or a list of names."""
    if values.dtype.names is not None:
        return {name: values[name] for name in values.dtype.names}
    if values.dtype.kind in "US":
        return [str(item) for item in values.ravel()]
    return values.item() if values.ndim == 0 else values
