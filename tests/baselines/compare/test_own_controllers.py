"""Controllers of one's own compete: as objects, as code in a file, and as data."""

import json
import pickle

import numpy as np
import pytest
from typer.testing import CliRunner

from baselines.cli import app
from baselines.compare import cases_of, compare, entries, is_own, load_linear, load_own, own_entry
from baselines.compare.tables import doing, drives_table, loop_words
from baselines.report.comparison_pages import write_drives_page
from flexdrive_gym import DEFAULT_DRIVE, LinearController, PControl, save_drive
from tests.each import each

CODE = """
from dataclasses import dataclass

class Mine:
    "P-control of my own."
    reads = "x2"
    def reset(self): ...
    def __call__(self, seen): return 0.1 * (seen.xr - seen.x2)

@dataclass
class Knows:
    drive: object
    def __call__(self, seen): return self.drive["k"] * (seen.xr - seen.x1)

def plain(seen): return 0.05 * (seen.xr - seen.x2)
def made(drive): return Knows(drive)
ready = Mine()
number = 3
"""
DATA = """
title = "lead by hand"
sample_time = 0.001
[tf]
numerator = [0.02, 0.1]
denominator = [0.01, 1.0]
reads = "x2"
"""
QUICK = {"effects": False, "references": (), "empirical": False, "backend": "sequential", "duration": 1.0}


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "own.py").write_text(CODE)
    (tmp_path / "own.toml").write_text(DATA)
    return tmp_path


@each("name", ["Mine", "Knows", "plain", "made", "ready"])
def test_code_of_ones_own_competes(folder, name):
    entry = load_own(f"{folder}/own.py:{name}", DEFAULT_DRIVE)
    assert entry.name == name
    gain = {"Knows": DEFAULT_DRIVE["k"], "made": DEFAULT_DRIVE["k"], "plain": 0.05}.get(name, 0.1)
    like = PControl(gain, "x1" if name in {"Knows", "made"} else "x2")
    found = compare(DEFAULT_DRIVE, {"mine": entry, "the same": like}, draws=0, **QUICK)
    mine, same = (r.nominal.rms for r in found.results)
    assert mine == pytest.approx(same, rel=1e-9)
    assert found.results[0].margins is None
    assert found.results[1].margins is not None


def test_code_of_ones_own_travels_to_other_processes(folder):
    from cloudpickle import dumps

    controller = load_own(f"{folder}/own.py:Mine", DEFAULT_DRIVE).controller
    assert b"0.1" not in dumps(DEFAULT_DRIVE)
    import sys

    data = dumps(controller)
    del sys.modules["flexdrive_own_own"]
    assert pickle.loads(data).reads == "x2"


@each(
    ("name", "error", "text"),
    [
        ("own.py:Min", ValueError, "has nothing called 'Min'. Did you mean 'Mine'"),
        ("own.py", ValueError, "must name what to take from the file"),
        ("other.py:Mine", FileNotFoundError, "no file"),
        ("own.py:number", TypeError, "'number' must be an object that is called"),
        ("other.toml", FileNotFoundError, "no file"),
    ],
)
def test_what_cannot_be_loaded_is_named(folder, name, error, text):
    with pytest.raises(error, match=text):
        load_own(str(folder / name), DEFAULT_DRIVE)


def test_a_class_is_not_taken_for_a_controller():
    with pytest.raises(TypeError, match="Make one of the class"):
        compare(DEFAULT_DRIVE, {"mine": PControl}, draws=0, **QUICK)
    with pytest.raises(ValueError, match="controllers: must be at least one"):
        compare(DEFAULT_DRIVE, {}, draws=0, **QUICK)


def test_data_is_a_linear_controller_and_runs_nothing(folder):
    found = load_linear(folder / "own.toml")
    like = LinearController.from_tf([0.02, 0.1], [0.01, 1.0], reads="x2")
    assert np.array_equal(found.law().entries, like.law().entries)
    entry = load_own(str(folder / "own.toml"), DEFAULT_DRIVE, limit=4.0)
    assert (entry.name, entry.title, entry.feedback, entry.controller.limit) == ("own", "lead by hand", "x2", 4.0)
    assert is_own("own.toml")
    assert not is_own("lab4")


@each(
    ("text", "said"),
    [
        ("sample_time = 0.001", "must have one table, \\[tf\\] or \\[ss\\]"),
        (DATA.replace("reads", "read"), "tf.read is no entry; .* Did you mean 'reads'"),
        (DATA.replace("0.001", "'x'"), "sample_time must be a number; got 'x'"),
        (DATA.replace("[0.02, 0.1]", "[0.02, 0.1, 0.0]"), "own.toml: numerator: must not have a higher degree"),
        (DATA.replace('"x2"', '"x3"'), "own.toml: inputs: must be among"),
        ("[tf]\nnumerator = [1.0]", "own.toml: .*denominator"),
        ("[ss", "must be TOML"),
        (
            "[ss]\nA = [[0.5]]\nB = [[1.0]]\nC = [[1.0]]\nD = [[0.0]]\ninputs = ['xr', 'x2']",
            "own.toml: B: must be of shape",
        ),
    ],
)
def test_odd_data_is_named(tmp_path, text, said):
    file = tmp_path / "own.toml"
    file.write_text(text)
    with pytest.raises((ValueError, TypeError), match=said):
        load_linear(file)


def test_a_comparison_prints_as_tables_and_sits_beside_another(tmp_path):
    drives = {"a": DEFAULT_DRIVE, "b": DEFAULT_DRIVE.replace({"d1": 0.1})}
    found = {
        label: compare(drive, {"mine": PControl(0.1), "lab4": entries(drive, ("lab4",))[0][0]}, draws=0, **QUICK)
        for label, drive in drives.items()
    }
    text = str(found["a"])
    assert "mine" in text.splitlines()[2]
    assert "GM linear" in text
    assert "GM with friction" in text
    beside = drives_table([(label, c.drive, c.results) for label, c in found.items()])
    assert beside.columns[1] == "a: rms e [mm]"
    assert beside.columns[5] == "b: rms e [mm]"
    assert [row[0] for row in beside.rows] == ["mine", "lab4"]
    page = write_drives_page(found, tmp_path).read_text()
    assert "a: rms e [mm]" in page
    assert "b/compare.html" in page


def test_a_limit_cycle_is_never_called_stable():
    # above Routh's gain friction holds small vibrations, and what it cannot hold ends between the limits
    loop = PControl(1.15 * DEFAULT_DRIVE.linear.routh_critical_gain("x2"))
    found = compare(DEFAULT_DRIVE, {"mine": loop}, draws=0, **{**QUICK, "empirical": True})
    said = loop_words(found.results[0])
    assert said.startswith("linearly unstable; ")
    assert doing(True, 30.2) == "limit cycle of 30 mm with friction"
    assert doing(True, 0.01) == "comes to rest"
    assert doing(False, 0.01) == doing(True, np.inf) == "grows"


def test_the_command_takes_own_controllers_and_several_drives(folder, monkeypatch):
    monkeypatch.chdir(folder)
    save_drive(DEFAULT_DRIVE, folder / "a.toml")
    save_drive(DEFAULT_DRIVE.replace({"d1": 0.1}), folder / "b.toml")
    asked = ["compare", "a.toml", "b.toml", "-c", "own.py:Mine,own.toml", "-a", "none", "-r", "none"]
    done = CliRunner().invoke(app, [*asked, "--no-effects", "--no-empirical", "--duration", "1", "--json"])
    assert done.exit_code == 0, done.output
    assert "running the code in own.py" in done.stderr
    told = json.loads(done.stdout)["drives"]
    assert list(told) == ["a", "b"]
    assert list(told["a"]["controllers"]) == ["Mine", "own"]
    assert told["a"]["controllers"]["own"]["margins"]["gain_margin"] is None  # unstable without friction


def test_an_own_entry_of_a_policy_stands_with_the_agents():
    from baselines.rl.agents import find_agent

    entry = own_entry("mine", find_agent("x2-0").controller())
    assert entry.learnt
    assert (entry.feedback, entry.period) == ("x2", 5e-3)
    assert cases_of(DEFAULT_DRIVE, draws=0, effects=False, references=())[0].handout
