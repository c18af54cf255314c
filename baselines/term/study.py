"""All groups of a term: on all cores or a cluster, each kept as soon as it is done, so that an interrupted run goes on."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from baselines.evaluation.parallel import Backend, code_digest, workers
from baselines.term.examine import Settings, examine
from baselines.term.groups import Group, Parcel, parcel
from baselines.term.unpack import HandInError
from flexdrive_gym.files import write_atomically

# what a row is made by; comparisons are made anew every time
_MAKERS = ("examine", "evidence", "copies", "groups", "unpack")
_DECIDES = (
    "flexdrive_gym",
    "identification",
    "baselines.lab.uncertainty",
    "baselines.loop_analysis.stability_limit",
    *(f"baselines.term.{module}" for module in _MAKERS),
)
Row = Mapping[str, Any]
Told = Callable[[int, int, str], None]


def kept_in(folder: Path) -> Path:
    """Return where rows are kept."""
    return folder / "groups"


def examine_all(
    groups: Sequence[Group],
    folder: Path,
    settings: Settings,
    *,
    backend: Backend = "loky",
    jobs: int = -1,
    scheduler: str | None = None,
    told: Told = lambda _done, _all, _name: None,
) -> list[Row]:
    """Examine the groups that are not kept yet; return the rows of all, in order.

    A row is kept under a digest of the group's files, of the settings and of the code: what has changed is done again, what has
    only been renamed is not, and a copied hand-in is examined once.

    Parameters
    ----------
    groups
        As found.
    folder
        Rows are kept in its subfolder ``groups``; only this process writes there, so workers need not see it.
    settings
        What is done.
    backend, jobs, scheduler
        Where; the rows do not depend on it.
    told
        Called with the number done, of all, and the label of the one that was done last.

    Raises
    ------
    ValueError
        If the workers cannot be reached; nothing is examined then.
    """
    code = code_digest(_DECIDES)
    with workers(backend, jobs, scheduler) as run:
        parcels: dict[str, tuple[str, Parcel]] = {}
        keys: list[str] = []
        rows: dict[str, Row] = {}
        for group in groups:
            try:
                found = parcel(group)
            except (HandInError, OSError) as error:
                # nothing to examine, and nothing to keep: the folder may be mended
                keys.append(f"refused {group.path}")
                rows[keys[-1]] = {"status": "skipped", "reason": str(error), "notes": []}
                continue
            key = _key(found, settings, code)
            keys.append(key)
            kept = _kept(folder, key)
            if kept is not None:
                rows[key] = kept
            else:
                parcels.setdefault(key, (group.label, found))
        todo = list(parcels.items())
        total = len(rows) + len(todo)
        told(len(rows), total, "")

        def keep(place: int, row: Row) -> None:
            key, (label, _) = todo[place]
            text = json.dumps(clean(row), ensure_ascii=False) + "\n"
            rows[key] = json.loads(text)
            if not row.get("passing"):
                write_atomically(_file(folder, key), text)
            told(len(rows), total, label)

        run([(examine, (found, settings)) for _, (_, found) in todo], lambda _done, _all: None, keep)
    return [rows[key] for key in keys]


def _key(found: Parcel, settings: Settings, code: str) -> str:
    what = json.dumps([found.digest(), asdict(settings), code])
    return hashlib.sha256(what.encode()).hexdigest()[:32]


def _file(folder: Path, key: str) -> Path:
    return kept_in(folder) / f"{key}.json"


def _kept(folder: Path, key: str) -> Row | None:
    """Return a row that was kept; ``None`` where there is none, or one that cannot be read, which is made again."""
    try:
        found: Row = json.loads(_file(folder, key).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return found if found.get("status") in ("ok", "skipped") else None


def clean(value: Any) -> Any:
    """Return a value as JSON knows it: not-a-number and infinity become null."""
    if isinstance(value, Mapping):
        return {str(k): clean(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [clean(v) for v in value]
    if hasattr(value, "tolist"):
        return clean(value.tolist())
    return None if isinstance(value, float) and not math.isfinite(value) else value
