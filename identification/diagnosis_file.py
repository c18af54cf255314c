"""``diagnosis.json`` as a file: what was written by this or an earlier release, read in the present form.

Schema 2 gives predictions with intervals, says which recordings were fitted, which selected and which only reported, and has
the homogeneity of parameters. A file of schema 1 has no intervals, selected by the recordings it fitted, and tested no
homogeneity: what it cannot say becomes null or empty, never a guess.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from flexdrive_gym.schema import Schema


def _to_2(old: dict[str, Any]) -> dict[str, Any]:
    fit = old.get("fit", {})
    rows = [
        {**{k: v for k, v in row.items() if k != "held_out"}, "part": "report" if row["held_out"] else "estimation"}
        for row in fit.get("per_recording", [])
    ]
    fitted = [row["recording"] for row in rows if row["part"] == "estimation"]
    predictions = [
        {
            **prediction,
            **{when: _estimate(prediction[when]) for when in ("before", "after")},
            "measured": prediction["measured"] or None,
            "extrapolated": None,
        }
        for prediction in old.get("predictions", [])
    ]
    return {
        **old,
        "fit": {**fit, "per_recording": rows},
        "predictions": predictions,
        "split": {"estimation": fitted, "selection": [], "report": list(fit.get("heldout_recordings", []))},
        "homogeneity": [],
    }


def _estimate(value: float | None) -> dict[str, Any] | None:
    return None if value is None else {"value": value, "ci95": None}


SCHEMA = Schema(2, "Write one with 'flexdrive diagnose'.", {1: _to_2})


def load_diagnosis(path: str | Path) -> dict[str, Any]:
    """Return the object of a ``diagnosis.json`` of any schema, in the form of schema 2.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If the file is no diagnosis, or one of a later release; the message names file, rule and value.
    """
    file = Path(path)
    if not file.is_file():
        raise FileNotFoundError(f"diagnosis: no file {file}. {SCHEMA.remedy}")
    try:
        document = json.loads(file.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"{file}: must be JSON; got {error}.") from error
    if not isinstance(document, dict) or "verdict" not in document:
        raise ValueError(f"{file}: must be an object with a 'verdict'; got something else. {SCHEMA.remedy}")
    return SCHEMA.current(document, str(file))
