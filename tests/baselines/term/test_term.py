"""``flexdrive term`` from folders to a page: contract, who stands out, what is kept and goes on, and a lost worker."""

import json
import os
import re
import signal
from dataclasses import replace

import pytest
from typer.testing import CliRunner

from baselines.cli import app
from baselines.report.term_page import build_term_page
from baselines.term import examine as examining
from baselines.term import study
from baselines.term.examine import Settings, examine
from baselines.term.groups import Group, find_groups, parcel
from baselines.term.plan import measured, plan
from baselines.term.study import examine_all
from baselines.term.summary import summarise
from flexdrive_gym import load_drive
from tests.baselines.term.lab import hand_in, short_runs, term
from tests.drive.drives import RIG
from tests.each import each
from tests.identification.mismatch.lab import diagnosis

QUICK = ["--no-diagnose", "--draws", "0", "--backend", "sequential"]


def flexdrive(*arguments):
    return CliRunner().invoke(app, ["term", *map(str, arguments)])


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    base = tmp_path_factory.mktemp("term")
    result = flexdrive(term(base / "hand-ins"), "-o", base / "out", *QUICK, "--plan", "60", "--json")
    assert result.exit_code == 0, result.output
    return base, json.loads(result.stdout)


def test_every_group_is_a_row_with_what_the_contract_names(made):
    base, found = made
    assert [(g["name"], g["status"]) for g in found["groups"]] == [
        ("group 1", "ok"), ("group 2", "ok"), ("group 3", "ok"), ("group 4", "ok"), ("group 5", "skipped"),
    ]  # fmt: skip
    for g in found["groups"]:
        assert {"name", "status", "reason", "parameters", "verdict", "findings", "faults", "critical_gain"} <= set(g)
    assert "must be a complete zip archive; got" in found["groups"][4]["reason"]
    for g in found["groups"][:3]:
        for name in ("m1", "k", "d1"):
            low, high = g["parameters"][name]["ci95"]
            assert low < g["parameters"][name]["value"] < high
            assert g["parameters"][name]["value"] == pytest.approx(RIG[name], rel=0.15)
    written = json.loads((base / "out" / "term.json").read_text(encoding="utf-8"))
    assert written == {k: v for k, v in found.items() if k not in {"plan", "page"}}
    assert load_drive(base / "out" / "drives" / "group 2.toml")["m1"] == pytest.approx(RIG["m1"], rel=0.15)


def test_a_swapped_sign_and_a_copy_stand_out_and_nobody_else(made):
    found = {(o["group"], o["kind"], o["what"]) for o in made[1]["outliers"]}
    assert found == {("group 3", "sign", "encoder_2"), ("group 4", "copy", "group 1")}


def test_the_page_is_whole_and_has_every_group(made):
    page = (made[0] / "out" / "term.html").read_text(encoding="utf-8")
    assert not re.findall(r"""(?:src|href)=["'](?!data:|#)""", page)  # self-contained
    for text in ("group\u00a05", "not examined: ", "encoder 2 counts backwards", 'id="parameters"', 'id="spreads"'):
        assert text in page


def test_what_is_done_is_not_done_again_and_what_is_new_is(made, monkeypatch):
    base, before = made
    seen = []
    monkeypatch.setattr(study, "examine", lambda found, settings: seen.append(found) or {"status": "skipped"})
    groups, _ = find_groups([base / "hand-ins"])
    rows = examine_all(groups, base / "out", Settings(diagnose=False, draws=0), backend="sequential")
    assert seen == []
    assert [r["status"] for r in rows] == [g["status"] for g in before["groups"]]
    (base / "hand-ins" / "group 1").rename(base / "hand-ins" / "group 9")
    groups, _ = find_groups([base / "hand-ins"])
    examine_all(groups, base / "out", Settings(diagnose=False, draws=0), backend="sequential")
    assert seen == []  # a new name is no new recording
    examine_all(groups[:1], base / "out", Settings(diagnose=False, draws=0, seed=1), backend="sequential")
    assert len(seen) == 1
    (base / "hand-ins" / "group 9").rename(base / "hand-ins" / "group 1")


def test_a_run_that_is_stopped_keeps_what_it_has(tmp_path, monkeypatch):
    for n in (1, 2, 3):
        hand_in(tmp_path / "in" / f"g{n}", short_runs(n)[:1])
    groups, _ = find_groups([tmp_path / "in"])
    calls = []

    def examine(found, _settings):
        calls.append(found.digest())
        if len(calls) == 3:
            raise KeyboardInterrupt
        return {"status": "skipped", "reason": "quick", "notes": []}

    monkeypatch.setattr(study, "examine", examine)
    with pytest.raises(KeyboardInterrupt):
        examine_all(groups, tmp_path / "out", Settings(), backend="sequential")
    examine_all(groups, tmp_path / "out", Settings(), backend="sequential")
    assert len(calls) == 4
    assert calls[3] == calls[2]


def test_a_damaged_row_is_made_again(tmp_path, monkeypatch):
    hand_in(tmp_path / "in" / "g", short_runs(1)[:1])
    groups, _ = find_groups([tmp_path / "in"])
    monkeypatch.setattr(study, "examine", lambda *_: {"status": "skipped", "reason": "quick", "notes": []})
    examine_all(groups, tmp_path / "out", Settings(), backend="sequential")
    (kept,) = (tmp_path / "out" / "groups").iterdir()
    kept.write_text('{"status": "o')
    assert examine_all(groups, tmp_path / "out", Settings(), backend="sequential")[0]["reason"] == "quick"


def test_what_a_diagnosis_says_is_in_the_row_and_one_that_fails_is_a_note(tmp_path, monkeypatch):
    hand_in(tmp_path / "g", short_runs(1))
    found = parcel(Group("", "g", tmp_path / "g"))
    monkeypatch.setattr(examining, "diagnose", lambda *_, **__: diagnosis())
    row = examine(found, Settings(draws=0))
    assert (row["verdict"], row["findings"]) == ("no_mismatch", [])

    def fails(*_, **__):
        raise ValueError("recordings: nothing to hold out")

    monkeypatch.setattr(examining, "diagnose", fails)
    row = examine(found, Settings(draws=0))
    assert (row["status"], row["notes"]) == ("ok", ["diagnosing: recordings: nothing to hold out"])
    assert "verdict" not in row
    page = build_term_page(summarise([Group("", "g", tmp_path)], [row]), title="one group")
    assert "not diagnosed" not in page


def test_a_plan_is_what_was_measured_times_what_is_planned(made):
    rows = [{**g} for g in made[1]["groups"]]
    costs = measured(rows)
    for e in plan(costs, 60, 20):
        assert e.hours == pytest.approx(-(-60 // e.workers) * 20 * costs.seconds / 3600.0)
        assert e.transfer_gb == pytest.approx(60 * 20 * (costs.mb_in + costs.mb_out) / 1e3)
    with pytest.raises(ValueError, match="plan: is made from what groups cost, and none was examined yet"):
        measured([{"status": "skipped"}])


@each("scheduler", [[], ["--scheduler", "nowhere://1"]])
def test_a_refused_backend_writes_nothing(scheduler, tmp_path):
    hand_in(tmp_path / "in" / "g", short_runs(1)[:1])
    result = flexdrive(tmp_path / "in", "--backend", "dask", *scheduler, "-o", tmp_path / "out")
    assert isinstance(result.exception, ValueError)
    assert str(result.exception).startswith("scheduler: ")
    assert not (tmp_path / "out").exists()


def comparable(row):
    """A row without what it cost."""
    return {k: v for k, v in row.items() if k != "cost"}


@pytest.mark.slow
@pytest.mark.filterwarnings("default")  # the client warns of the worker that is lost on purpose
def test_a_lost_dask_worker_loses_nothing(made, cluster, tmp_path):
    address, workers = cluster
    groups, _ = find_groups([made[0] / "hand-ins"])
    settings = Settings(diagnose=False, draws=0)

    def lose_one(done, _all, _name):
        if done == 1:
            os.kill(workers[0].pid, signal.SIGKILL)

    there = examine_all(groups, tmp_path, settings, backend="dask", scheduler=address, told=lose_one)
    workers[0].wait(timeout=10)
    assert workers[1].poll() is None
    here = examine_all(groups, made[0] / "out", settings, backend="sequential")
    assert list(map(comparable, there)) == list(map(comparable, here))


def test_a_hand_in_is_read_as_other_commands_read_a_folder(tmp_path):
    hand_in(tmp_path / "g", short_runs(1))
    (tmp_path / "g" / "broken.csv").write_text("t_s,u_V,v1_mm_s\n0,1,2\n0.001,x,2\n")
    found = parcel(Group("", "g", tmp_path / "g"))
    quick = Settings(diagnose=False, draws=0)
    lenient = examine(found, quick)
    assert (lenient["status"], [item["file"] for item in lenient["skipped"]]) == ("ok", ["broken.csv"])
    strict = examine(found, replace(quick, strict=True))
    assert strict["status"] == "skipped"
    assert strict["reason"].startswith("broken.csv: ")
    chosen = examine(found, replace(quick, strict=True, skip=("broken*",)))
    assert (chosen["status"], chosen["skipped"]) == ("ok", [])


def test_a_hand_in_without_recordings_says_what_it_has(tmp_path):
    (tmp_path / "g").mkdir()
    (tmp_path / "g" / "notes.csv").write_text("hi\n")
    row = examine(parcel(Group("", "g", tmp_path / "g")), Settings(diagnose=False, draws=0))
    assert row["reason"].startswith("files: at least one must be a recording; got none in 1 file.")
    assert "notes.csv: file: must hold columns of numbers" in row["reason"]
