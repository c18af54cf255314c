"""Files of earlier forms are read in the present one; nothing is guessed that they do not say."""

import json
from importlib.resources import files

import jsonschema
import pytest

from flexdrive_gym.schema import Schema
from identification import load_diagnosis
from tests.each import each

# as flexdrive 0.1.0.dev0 wrote it
OLD = {
    "schema": 1,
    "verdict": "explained",
    "faults": [],
    "located": [],
    "findings": [],
    "unnamed": None,
    "baseline": {"handout_tied_rms": 14.2, "free_rms": 8.9, "ratios": {}},
    "fit": {
        "before_rms": 8.9, "after_rms": 5.4, "floor_rms": 5.1, "unit": "mm/s", "heldout_recordings": ["b"],
        "per_recording": [
            {"recording": "a", "before_rms": 8.0, "after_rms": 5.0, "floor_rms": 5.0, "held_out": False, "unit": "mm/s"},
            {"recording": "b", "before_rms": 8.9, "after_rms": 5.4, "floor_rms": 5.1, "held_out": True, "unit": "mm/s"},
        ],
        "friction_spread": 0.0, "own_friction_rms": None,
    },
    "predictions": [
        {"name": "critical_gain_x2_simulated", "before": 0.21, "after": None, "unit": "V/mm", "measured": ""},
    ],
    "notes": [], "drive": "drive.toml", "seconds": 1.0,
}  # fmt: skip


def test_a_diagnosis_of_schema_1_is_read_as_schema_2(tmp_path):
    (tmp_path / "diagnosis.json").write_text(json.dumps(OLD))
    found = load_diagnosis(tmp_path / "diagnosis.json")
    assert found["schema"] == 2
    assert found["split"] == {"estimation": ["a"], "selection": [], "report": ["b"]}
    assert [row["part"] for row in found["fit"]["per_recording"]] == ["estimation", "report"]
    assert found["homogeneity"] == []
    assert found["predictions"] == [
        {
            "name": "critical_gain_x2_simulated", "before": {"value": 0.21, "ci95": None}, "after": {"value": None, "ci95": None},
            "unit": "V/mm", "measured": None, "extrapolated": None,
        }
    ]  # fmt: skip
    assert found["baseline"] == OLD["baseline"]
    schema = files("identification.mismatch") / "diagnosis.schema.json"
    jsonschema.validate(found, json.loads(schema.read_text(encoding="utf-8")))
    again = tmp_path / "again.json"
    again.write_text(json.dumps(found))
    assert load_diagnosis(again) == found


@each(
    ("text", "says"),
    [
        ("[", "must be JSON"),
        ("{}", "must be an object with a 'verdict'"),
        ('{"verdict": "explained"}', "must have 'schema' from 1 to 2; got None"),
        ('{"verdict": "explained", "schema": 3}', "has schema 3, and this flexdrive reads up to 2. Update flexdrive"),
    ],
)
def test_what_is_no_diagnosis_is_refused(tmp_path, text, says):
    (tmp_path / "diagnosis.json").write_text(text)
    with pytest.raises(ValueError, match=says):
        load_diagnosis(tmp_path / "diagnosis.json")
    with pytest.raises(FileNotFoundError, match="flexdrive diagnose"):
        load_diagnosis(tmp_path / "none.json")


def test_steps_are_taken_one_after_the_other_and_the_old_document_stays():
    schema = Schema(3, "", {1: lambda d: {**d, "b": d["a"]}, 2: lambda d: {k: v for k, v in d.items() if k != "a"}})
    old = {"schema": 1, "a": 5}
    assert schema.current(old, "f") == {"schema": 3, "b": 5}
    assert schema.current({"schema": 3, "b": 5}, "f") == {"schema": 3, "b": 5}
    assert old == {"schema": 1, "a": 5}
