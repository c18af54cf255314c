"""Entries say where their physics is documented; a diagnosis is held against it; what is done is kept."""

import json
from dataclasses import replace

import pytest

from baselines.real_rigs import judge
from baselines.real_rigs import study as studying
from baselines.real_rigs.entries import RIGS
from baselines.real_rigs.entry import Figure
from baselines.real_rigs.examine import compared
from baselines.real_rigs.study import study, summary
from baselines.report.rigs_page import build_rigs_page, sentences
from flexdrive_gym import Drive
from flexdrive_gym.drive.effects import EFFECTS
from flexdrive_gym.drive.parameters import parameter
from identification.recordings.rig import Rig, parse_rig
from tests.drive.drives import RIG
from tests.each import each

PLACES = {(e.id, where) for e in EFFECTS for where in e.where}


def finding(id_, where, *ties):
    return {"id": id_, "where": where, "ties": [{"id": i, "where": w} for i, w in ties]}


def test_the_rigs_of_the_issue_are_there():
    assert set(RIGS) == {
        "ecp210_2025", "lugre_servo", "emps", "coupled_drives", "silverbox", "quanser_2dsfl", "hsm150", "mte360_2022",
        "mte360_2025",
    }  # fmt: skip
    # the aim is nine of them
    assert sum(len(rig.concealed) for rig in RIGS.values()) >= 9


@each("rig", RIGS.values(), ids=lambda rig: rig.name)
def test_an_entry_is_consistent(rig):
    described = rig.rig if isinstance(rig.rig, Rig) else parse_rig(rig.rig)
    assert not described.known
    free = set() if rig.topology is None else set(rig.topology.free)
    base = {"d1": ("coulomb_friction", "cart_1"), "d2": ("coulomb_friction", "cart_2")}
    for item in rig.concealed:
        assert item.source
        assert set(item.names) <= PLACES
        # what is concealed is not in the base model
        assert not {base[name] for name in free & set(base)} & set(item.names)
    assert set(rig.denied) <= {id_ for id_, _ in PLACES}
    for figure in rig.figures:
        assert figure.source
        assert callable(figure.found) or parameter(figure.found)


def test_named_tied_missed_and_beyond():
    rig = RIGS["ecp210_2025"]
    found = {
        "findings": [
            finding("ground_spring", "guide"),
            finding("stribeck", "cart_1", ("coulomb_friction", "cart_1")),
            finding("input_delay", "actuator"),
        ]
    }
    judged = judge(rig, found)
    assert [row["outcome"] for row in judged["concealed"]] == ["named", "tied", "missed"]
    assert judged["concealed"][1]["by"] == "stribeck at cart_1"
    (claim,) = judged["claims"]
    assert (claim["id"], claim["verdict"]) == ("input_delay", "beyond the documentation")
    assert claim["confirm"]


def test_what_was_not_found_has_no_figure():
    """A cut-off of 0 Hz stands for no filter: it is no value that is 100 % off."""
    filter_ = Figure("filter", "Hz", 12.0, "velocity_processing.encoder_2.cutoff", "the documentation")
    missed = compared(filter_, Drive(RIG))
    assert missed["found"] is missed["deviation"] is None
    found = compared(filter_, Drive({**RIG, "velocity_processing.encoder_2.cutoff": 9.0}))
    assert found["found"] == pytest.approx(9.0)
    assert found["deviation"] == pytest.approx(-0.25)


def test_what_the_documentation_contradicts_is_said():
    judged = judge(
        RIGS["silverbox"], {"findings": [finding("stribeck", "cart_1"), finding("hardening_spring", "spring")]}
    )
    assert [c["verdict"] for c in judged["claims"]] == ["contradicted"]
    assert "electronic" in judged["claims"][0]["reason"]


@pytest.fixture
def examined(monkeypatch):
    """Rows instead of diagnoses, and how often each rig was asked for."""
    asked = []

    def examine(rig, _data, **_options):
        asked.append(rig.name)
        judged = judge(rig, {"findings": [finding(*rig.concealed[0].names[0])] if rig.concealed else []})
        return {
            "rig": rig.name, "title": rig.title, "status": "examined", "recordings": 1, "skipped": 0, "verdict": "explained",
            **judged, "errors": {"before": 2.0, "after": 1.0, "floor": None, "unit": "mm/s"}, "parameters": [], "control": None,
            "unnamed": None, "notes": [], "seconds": 1.0,
        }  # fmt: skip

    monkeypatch.setattr(studying, "examine", examine)
    return asked


def test_what_is_done_is_kept_and_the_rest_goes_on(examined, tmp_path):
    data, out = tmp_path / "data", tmp_path / "out"
    for name in ("emps", "silverbox"):
        (data / name).mkdir(parents=True)
    some = {name: RIGS[name] for name in ("emps", "silverbox", "hsm150")}
    assert [r["status"] for r in study({"emps": RIGS["emps"]}, data, out)] == ["examined"]
    rows = study(some, data, out)
    assert [r["status"] for r in rows] == ["examined", "examined", "absent"]
    assert examined == ["emps", "silverbox"]
    # another seed is another examination, and so is what was asked for again
    study({"emps": RIGS["emps"]}, data, out, seed=1)
    study({"emps": RIGS["emps"]}, data, out, seed=1, again=True)
    assert examined == ["emps", "silverbox", "emps", "emps"]
    found = summary(rows)
    assert (found["named"], found["missed"], found["absent"]) == (2, 1, ["hsm150"])
    json.dumps(found, allow_nan=False)


def test_the_page_says_the_result_first(examined, tmp_path):
    (tmp_path / "emps").mkdir()
    found = summary(study({n: RIGS[n] for n in ("emps", "hsm150")}, tmp_path, None))
    assert sentences(found)[0].startswith("1 of 2 documented effects are found: 1 named")
    # two effects cannot reach an aim for all rigs
    assert "aim:" not in " ".join(sentences(found))
    assert "(aim: at least 9)" in sentences({**found, "concealed": 11, "named": 10})[0]
    # of a rig of which only parameters are documented nothing can be found
    assert sentences({**found, "concealed": 0, "named": 0})[0].startswith("No documented effect is concealed")
    page = build_rigs_page(found, command="flexdrive rigs")
    assert page.index("1 of 2 documented effects") < page.index("<table")
    assert "no folder" in page
    # what is left out and has no name is said in the first table
    assert "without a name" not in page
    found["rigs"][0]["unnamed"] = {"where": "cart_2", "share_of_error": 0.1, "acts_on": "as a function of the command"}
    page = build_rigs_page(found, command="flexdrive rigs")
    assert page.index("without a name: a force on cart 2 as a function of the command") < page.index('id="effects"')
    # a name with which report recordings get worse is no success
    assert "the error grows" not in page
    found["rigs"][0]["errors"] |= {"after": 3.0}
    assert f"With what is claimed the error grows on {found['rigs'][0]['title']}." in sentences(found)
    assert "3 worse" in build_rigs_page(found, command="flexdrive rigs")
    # none was asked, which is not the same as none found
    assert "look-alike's base model" not in page
    found["rigs"][0]["control"] = {"base_model_of": "lugre_servo", "named": [], "claims": []}
    assert "With a look-alike's base model 0 names are undocumented." in sentences(found)


@each("name", ["ecp210_2025", "lugre_servo", "quanser_2dsfl", "hsm150"])
def test_real_files_are_read(name, shared_recordings):
    rig = replace(RIGS[name], only=RIGS[name].only or ("*1*",))
    runs = rig.read(shared_recordings)
    assert len(runs)
    assert all(r.u.std() > 0.0 for r in runs if not r.notes)
