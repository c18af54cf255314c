"""One rig from its folder to a row of the page: diagnose, judge, compare parameters, and repeat with the control's base model."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from baselines.real_rigs.entry import Figure, RealRig
from baselines.real_rigs.judge import claims, judge
from flexdrive_gym import Drive
from flexdrive_gym.drive.parameters import parameter
from identification import diagnose
from identification.recordings import RecordingSet
from identification.topology import Topology


def absent(rig: RealRig, data: Path) -> dict[str, Any]:
    """Return the row of a rig whose folder is not there."""
    return {"rig": rig.name, "title": rig.title, "status": "absent", "reason": f"no folder {data / rig.name}"}


def examine(
    rig: RealRig,
    data: Path,
    *,
    seed: int = 0,
    jobs: int | None = None,
    say: Callable[[str], None] = lambda _: None,
) -> dict[str, Any]:
    """Diagnose a rig without what its documentation says is there, and judge what was found.

    Parameters
    ----------
    rig
        Entry of the rig.
    data
        Folder that holds the rig's own folder.
    seed, jobs
        Of the diagnosis.
    say
        Called with a few words at every stage.

    Returns
    -------
    dict
        The rig's object of ``rigs.json``, in the rig's units; ``status`` is ``absent`` without a folder and ``failed``, with the
        reason, where the recordings tell nothing.
    """
    if not (data / rig.name).is_dir():
        return absent(rig, data)
    begin = time.perf_counter()
    row: dict[str, Any] = {"rig": rig.name, "title": rig.title, "citation": rig.citation}
    try:
        recordings = rig.read(data)
        found, drive = _diagnosed(recordings, rig.topology, seed, jobs, say)
    except ValueError as error:
        return {**row, "status": "failed", "reason": str(error), "seconds": time.perf_counter() - begin}
    judged = judge(rig, found)
    fit = found["fit"]
    return {
        **row,
        "status": "examined",
        "recordings": len(recordings),
        "skipped": len(recordings.skipped),
        "verdict": found["verdict"],
        **judged,
        "errors": {key: fit[f"{key}_rms"] for key in ("before", "after", "floor")} | {"unit": fit["unit"]},
        "parameters": [compared(figure, drive) for figure in rig.figures],
        "control": _control(rig, recordings, seed, jobs, say),
        "unnamed": found["unnamed"],
        "notes": found["notes"],
        "seconds": time.perf_counter() - begin,
    }


def _diagnosed(
    recordings: RecordingSet, topology: Topology | None, seed: int, jobs: int | None, say: Callable[[str], None]
) -> tuple[dict[str, Any], Drive]:
    found = diagnose(recordings, topology=topology, seed=seed, jobs=jobs, say=say)
    return found.as_json(), found.drive


def _control(
    rig: RealRig, recordings: RecordingSet, seed: int, jobs: int | None, say: Callable[[str], None]
) -> dict[str, Any] | None:
    """Diagnose with the base model of the look-alike: what is documented of this rig may be named, and nothing else."""
    if rig.control is None:
        return None
    say(f"control: base model of {rig.control.of}")
    found, _ = _diagnosed(recordings, rig.control.topology, seed, jobs, say)
    documented = {name for item in rig.concealed for name in item.names}
    return {
        "base_model_of": rig.control.of,
        "named": [f"{f['id']} at {f['where']}" for f in found["findings"]],
        "claims": claims(found["findings"], documented, rig.denied),
    }


def compared(figure: Figure, drive: Drive) -> dict[str, Any]:
    """Return a documented parameter beside the one that was found; ``None`` where the drive has no such effect."""
    value: float | None = None
    interval = None
    if callable(figure.found):
        value = figure.found(drive)
    elif figure.found in drive.values:
        unit = parameter(figure.found).unit
        value = drive.units.of_rig(drive[figure.found], unit)[0]
        if figure.found in drive.intervals:
            interval = [_finite(drive.units.of_rig(end, unit)[0]) for end in drive.intervals[figure.found]]
    value = _finite(value)
    return {
        "label": figure.label,
        "unit": figure.unit,
        "documented": figure.documented,
        "found": value,
        "ci95": interval,
        "deviation": None if value is None else value / figure.documented - 1.0,
        "source": figure.source,
    }


def _finite(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)
