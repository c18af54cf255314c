"""``flexdrive export``: what it writes, prints and refuses."""

import json
import shutil

import pytest
from typer.testing import CliRunner

from baselines.cli import app
from flexdrive_gym import DEFAULT_DRIVE, save_drive
from tests.contracts.test_commands import flexdrive


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    base = tmp_path_factory.mktemp("rig")
    save_drive(DEFAULT_DRIVE.replace({"stribeck.cart_1.extra": 0.1}), base / "drive.toml")
    return base


def test_files_are_named_after_what_is_in_them(folder):
    for arguments, files in (
        (["--to", "matlab"], ["drive.m"]),
        (["--to", "mujoco"], ["drive.xml"]),
        (["--to", "c", "-a", "x2-0"], ["x2_0.h", "x2_0.c"]),
        (["--to", "c", "-c", "p_x2", "--period", "2"], ["p_x2.h", "p_x2.c"]),
    ):
        done = flexdrive("export", "drive.toml", *arguments, "-o", "out", "--json", cwd=folder)
        assert done.returncode == 0, done.stderr
        found = json.loads(done.stdout)
        assert sorted(found["files"]) == sorted(f"out/{name}" for name in files)
        for name in files:
            assert "flexdrive export drive.toml" in (folder / "out" / name).read_text() or name.endswith(".h")
    assert "every 0.002 s" in (folder / "out" / "p_x2.c").read_text()


def test_what_is_left_out_is_on_the_screen(folder):
    done = flexdrive("export", "drive.toml", "--to", "mujoco", "-o", "rig.xml", cwd=folder)
    assert "left out: stribeck at cart_1: joint friction is one level" in done.stdout
    assert (
        "left out: stribeck"
        not in flexdrive("export", "drive.toml", "--to", "matlab", "-o", "rig.m", cwd=folder).stdout
    )


@pytest.mark.skipif(not (shutil.which("cc") or shutil.which("gcc")), reason="no C compiler on this machine")
def test_check_prints_the_difference(folder):
    done = flexdrive("export", "drive.toml", "--to", "c", "-c", "lab4", "-o", "out", "--check", "--json", cwd=folder)
    (found,) = json.loads(done.stdout)["differences"]
    assert found["largest"] == 0.0
    assert found["equal"] == found["samples"] > 1000


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--to", "c", "-o", "a.c"], "C99 is written of a controller or an agent; got a drive. Add --controller"),
        (["--to", "matlab", "-o", "a.txt"], "a file that ends in .m; got a.txt. Try -o a.m"),
        (["--to", "matlab", "-o", "2-5.m"], "a letter, then letters"),
        (["--to", "mujoco", "-c", "lqg", "-o", "a.xml"], "MuJoCo's models hold drives; got --controller"),
        (["--to", "c", "-c", "lqq", "-o", "a.c"], "Did you mean 'lqg'?"),
        (["--to", "c", "-a", "x2-9", "-o", "a.c"], "must be among"),
        (["--to", "c", "-a", "x2-0", "-c", "lqg", "-o", "a.c"], "one thing goes into a file"),
        (["--to", "c", "-a", "x2-0", "--period", "1", "-o", "a.c"], "an agent acts at the period it was trained for"),
        (["--to", "c", "-c", "none.toml", "-o", "a.c"], "none.toml"),
    ],
)
def test_what_cannot_be_is_refused_and_nothing_is_written(folder, arguments, text, monkeypatch):
    monkeypatch.chdir(folder)
    before = set(folder.rglob("*"))
    done = CliRunner().invoke(app, ["export", "drive.toml", *arguments])
    assert isinstance(done.exception, ValueError | OSError)
    assert text in str(done.exception)
    assert set(folder.rglob("*")) == before


def test_an_unknown_tool_is_wrong_usage(folder, monkeypatch):
    monkeypatch.chdir(folder)
    assert CliRunner().invoke(app, ["export", "drive.toml", "--to", "simulink", "-o", "a"]).exit_code == 2
