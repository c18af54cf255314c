"""Recordings to the rig's own CSV format."""

from __future__ import annotations

import gzip
import io
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import tomlkit

from flexdrive_gym.files import write_atomically
from identification.recordings.errors import broken
from identification.recordings.files import extension

if TYPE_CHECKING:
    from flexdrive_gym.recording import FloatArray, Recording
    from flexdrive_gym.units import Units

_UNITS = {"xr": "mm", "x1": "mm", "x2": "mm", "v1": "mm_s", "v2": "mm_s"}
_UNIT = {"t": "s", "u": "V", **_UNITS}


def _column(name: str, units: Units) -> str:
    """Return the name of a column in the rig's units."""
    return f"{name} [{units.name(_UNIT[name].replace('_', '/'))}]"


def write_recording(recording: Recording, path: str | Path) -> Path:
    """Write a run as the rig would have.

    Open-loop files of velocities have the columns ``t_s,u_V,v1_mm_s,v2_mm_s``, closed-loop ones
    ``t_s,u_V,xr_mm,x1_mm,x2_mm``; a run with other channels gets all it has, in the order xr, x1, x2, v1,
    v2. A run of a rig with units of its own is written in these, ``t [s],u [N m],v1 [rad/s]``; :func:`write_rig` describes
    them. The file appears complete or not at all.

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
    lab, recording = recording.units.lab, recording.in_rig_units()
    columns: dict[str, FloatArray] = {}
    for name in ("t", "u", *_UNITS):
        values = getattr(recording, name)
        if values is not None and lab:
            # rounding first, and adding zero, keeps "-0.0000" out
            columns[f"{name}_{_UNIT[name]}"] = values if name in ("t", "u") else np.round(values, 4) + 0.0
        elif values is not None:
            columns[_column(name, recording.units)] = values + 0.0
    # milliseconds are the rig's grain; a finer or odd sampling period needs more decimals to survive
    grain = 1e3 * recording.t
    time = "%.3f" if np.max(np.abs(grain - np.round(grain))) < 1e-6 else "%.6f"
    stream = io.StringIO()
    np.savetxt(
        stream,
        np.column_stack(list(columns.values())),
        fmt=[time, "%.6g" if lab else "%.9g", *["%.4f" if lab else "%.9g"] * (len(columns) - 2)],
        delimiter=",",
        header=",".join(columns),
        comments="",
    )
    data = stream.getvalue().encode()
    return write_atomically(target, gzip.compress(data, mtime=0) if kind == ".csv.gz" else data)


def write_rig(units: Units, carts: int, path: str | Path, name: str = "") -> Path:
    """Write the ``rig.toml`` by which recordings that :func:`write_recording` wrote in a rig's own units are read back.

    Parameters
    ----------
    units
        The rig's.
    carts
        1 or 2.
    path
        Target; parent directories are made.
    name
        Of the rig.
    """
    document, rig = tomlkit.document(), tomlkit.table()
    document.add(tomlkit.comment("What the columns of the recordings beside it mean; commands take it with --rig."))
    rig["name"], rig["carts"] = name, carts
    document["rig"] = rig
    own = tomlkit.table()
    roles = {"u": "u", "x1": "x1", "v1": "v1", "x2": "x2", "v2": "v2", "xr": "reference"}
    for signal, role in roles.items():
        if carts == 2 or signal not in ("x2", "v2"):
            own[role] = units.name(_UNIT[signal].replace("_", "/"))
    document["units"] = own
    if units.per_time != 1.0:
        document["scale"] = {"time": units.per_time}
    return write_atomically(path, tomlkit.dumps(document))
