"""``flexdrive lab`` before it serves."""

import json

import pytest
from typer.testing import CliRunner

pytest.importorskip("nicegui", reason="the lab's page needs NiceGUI: pip install 'flexdrive[lab]'")

from baselines.cli import app
from baselines.lab_page import server, warm_up
from baselines.lab_page.panels.recordings import Workbench
from baselines.lab_page.session import Session
from baselines.lab_page.settings import Settings
from flexdrive_gym import DEFAULT_DRIVE, save_drive


@pytest.fixture
def served(monkeypatch):
    calls = []
    monkeypatch.setattr(server, "serve", lambda lab, **given: calls.append((lab, given)))
    monkeypatch.setattr(warm_up, "warm_up", lambda: None)
    return calls


def test_it_stays_on_loopback_unless_told_and_then_says_what_that_means(served):
    quiet = CliRunner().invoke(app, ["lab", "--no-browser"])
    assert quiet.exit_code == 0
    assert served[0][1] == {"host": "127.0.0.1", "port": 8080, "browser": False}
    assert "password" not in quiet.stderr
    told = CliRunner().invoke(app, ["lab", "--no-browser", "--host", "0.0.0.0"])
    assert "no password and no encryption" in told.stderr


def test_drives_and_recordings_are_told_apart(served, tmp_path):
    path = save_drive(DEFAULT_DRIVE.replace(name="mine"), tmp_path / "drive.toml")
    (tmp_path / "day").mkdir()
    result = CliRunner().invoke(app, ["lab", str(path), str(tmp_path / "day"), "--exercise", "--json"])
    assert json.loads(result.stdout)["address"] == "http://127.0.0.1:8080/"
    lab = served[0][0]
    assert [d.name for d in lab.drives.values()] == ["mine", DEFAULT_DRIVE.name]
    assert [p.name for p in lab.recordings] == ["day"]
    assert lab.exercise


def test_it_reads_the_recordings_as_other_commands_do(served, tmp_path):
    (tmp_path / "day").mkdir()
    options = ["--strict", "--only", "*.csv", "--skip", "a*", "--skip", "b*"]
    assert CliRunner().invoke(app, ["lab", str(tmp_path / "day"), *options]).exit_code == 0
    lab = served[0][0]
    assert (lab.strict, list(lab.only), list(lab.skip)) == (True, ["*.csv"], ["a*", "b*"])
    bench = Workbench(Session(lab, Settings()), "recordings", lambda *_: None)
    assert bench.sources() == [str(tmp_path / "day")]
    assert bench.options() == ["--strict", "--only", "*.csv", "--skip", "a*", "--skip", "b*"]
    # what a visitor brings is read whole
    bench.folder.mkdir()
    (bench.folder / "own.csv").write_text("")
    assert bench.options() == []
    bench.session.close()
