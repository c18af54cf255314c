"""Recordings to the rig's own CSV format."""

from __future__ import annotations

import gzip
import io
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from flexdrive_gym.files import write_atomically
from identification.recordings.errors import broken
from identification.recordings.files import extension

if TYPE_CHECKING:
    from flexdrive_gym.recording import FloatArray, Recording

_UNITS = {"xr": "mm", "x1": "mm", "x2": "mm", "v1": "mm_s", "v2": "mm_s"}


def write_recording(recording: Recording, path: str | Path) -> Path:
    """Write a run as the rig would have.

    Open-loop files of velocities have the columns ``t_s,u_V,v1_mm_s,v2_mm_s``, closed-loop ones
    ``t_s,u_V,xr_mm,x1_mm,x2_mm``; a run with other channels gets all it has, in the order xr, x1, x2, v1,
    v2. The file appears complete or not at all.

    Parameters
    ----------
    recording
        The run. Its faults and notes are not written; reading finds them again.
    path
        Target ending in ``.csv`` or ``.csv.gz``; parent directories are made.

    Returns
    -------
    pathlib.Path

    Raises
    ------
    RecordingError
        If the extension is another.
    """
    target = Path(path)
    kind = extension(target)
    if kind not in (".csv", ".csv.gz"):
        raise broken(
            target.name,
            "extension",
            "recordings are written as .csv or .csv.gz",
            kind or "none",
            f"Name the file {target.stem}.csv.",
        )
    columns: dict[str, FloatArray] = {"t_s": recording.t, "u_V": recording.u}
    for name, unit in _UNITS.items():
        values = getattr(recording, name)
        if values is not None:
            # rounding first, and adding zero, keeps "-0.0000" out
            columns[f"{name}_{unit}"] = np.round(values, 4) + 0.0
    # milliseconds are the rig's grain; a finer or odd sampling period needs more decimals to survive
    grain = 1e3 * recording.t
    time = "%.3f" if np.max(np.abs(grain - np.round(grain))) < 1e-6 else "%.6f"
    stream = io.StringIO()
    np.savetxt(
        stream,
        np.column_stack(list(columns.values())),
        fmt=[time, "%.6g", *["%.4f"] * (len(columns) - 2)],
        delimiter=",",
        header=",".join(columns),
        comments="",
    )
    data = stream.getvalue().encode()
    return write_atomically(target, gzip.compress(data, mtime=0) if kind == ".csv.gz" else data)
