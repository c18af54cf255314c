"""All rigs of a folder, one after the other; what is done is kept, and what a change of code or seed made stale is done again."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from baselines.real_rigs.entry import RealRig
from baselines.real_rigs.examine import absent, examine
from flexdrive_gym import __version__
from flexdrive_gym.files import write_atomically

SCHEMA = 1
AIM_FOUND, AIM_CONTRADICTED = 9, 1


def study(
    rigs: Mapping[str, RealRig],
    data: Path,
    output: Path | None,
    *,
    again: bool = False,
    seed: int = 0,
    jobs: int | None = None,
    say: Callable[[str], None] = lambda _: None,
) -> list[dict[str, Any]]:
    """Examine rigs, and keep each one's row in ``output/NAME.json`` as soon as it is known.

    Parameters
    ----------
    rigs
        Name to entry.
    data
        Folder that holds the rigs' folders.
    output
        Where rows are kept; ``None``: nowhere.
    again
        Examine rigs whose row is there, too.
    seed, jobs
        Of the diagnosis.

    Returns
    -------
    list of dict
        One row a rig, in the order of ``rigs``.
    """
    made_by = {"schema": SCHEMA, "version": __version__, "seed": seed}
    rows = []
    for name, rig in rigs.items():
        kept = None if output is None or again else _kept(output / f"{name}.json", made_by)
        if not (data / name).is_dir():
            row = kept or absent(rig, data)
        else:
            row = kept or examine(rig, data, seed=seed, jobs=jobs, say=lambda step, name=name: say(f"{name}: {step}"))  # type: ignore[misc]
            if output is not None and row is not kept:
                _write(output / f"{name}.json", {"made_by": made_by, **row})
        rows.append({key: value for key, value in row.items() if key != "made_by"})
    return rows


def kept_rows(rigs: Mapping[str, RealRig], output: Path) -> dict[str, dict[str, Any]]:
    """Return the rows that stand in a folder, of whatever version or seed."""
    found = {}
    for name in rigs:
        row = _kept(output / f"{name}.json", None)
        if row is not None:
            found[name] = {key: value for key, value in row.items() if key != "made_by"}
    return found


def summary(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the object of ``rigs.json``."""
    examined = [r for r in rows if r["status"] == "examined"]
    outcomes = [item["outcome"] for r in examined for item in r["concealed"]]
    made = [c for r in examined for c in r["claims"]]
    controls = [r["control"] for r in examined if r["control"] is not None]
    return {
        "schema": SCHEMA,
        "examined": len(examined),
        "absent": [r["rig"] for r in rows if r["status"] == "absent"],
        "failed": [r["rig"] for r in rows if r["status"] == "failed"],
        "concealed": len(outcomes),
        "named": outcomes.count("named"),
        "tied": outcomes.count("tied"),
        "missed": outcomes.count("missed"),
        "claims": len(made),
        "contradicted": sum(c["verdict"] == "contradicted" for c in made),
        "control_claims": sum(len(c["claims"]) for c in controls),
        "aims": {"named_or_tied": AIM_FOUND, "contradicted_at_most": AIM_CONTRADICTED},
        "rigs": list(rows),
    }


def _kept(file: Path, made_by: Mapping[str, Any] | None) -> dict[str, Any] | None:
    try:
        row: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return row if made_by is None or row.get("made_by") == dict(made_by) else None


def _write(file: Path, row: Mapping[str, Any]) -> None:
    write_atomically(file, json.dumps(row, ensure_ascii=False, indent=1, allow_nan=False) + "\n")
