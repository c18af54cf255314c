"""Every command: help, one JSON object, exit codes, and errors that name argument, rule and value."""

import json
import re
import subprocess
import sys
from contextlib import chdir, redirect_stderr, redirect_stdout
from importlib.resources import files
from io import StringIO
from unittest import mock

import jsonschema
import pytest

from baselines.cli import app, main
from baselines.lab.experiments import open_loop
from baselines.lab.sample import FOLDER
from flexdrive_gym import Drive, load_drive, save_drive
from identification import write_recording
from tests.drive.drives import RIG
from tests.each import each
from tests.identification.mismatch.lab import KINDS, T, data_set

COMMANDS = [command.callback.__name__ for command in app.registered_commands]


def flexdrive(*arguments, cwd="."):
    """Run the command line here: a process of its own for every command spends most of its time on imports."""
    out, err = StringIO(), StringIO()
    with (
        chdir(cwd),
        redirect_stdout(out),
        redirect_stderr(err),
        mock.patch.object(sys, "argv", ["flexdrive", *map(str, arguments)]),
    ):
        try:
            main()
            code = 0
        except SystemExit as ended:
            code = ended.code or 0
    return subprocess.CompletedProcess(arguments, code, out.getvalue(), err.getvalue())


def test_it_is_a_module_too(tmp_path):
    run = [sys.executable, "-m", "baselines.cli", "design", "no.toml"]
    told = subprocess.run(run, capture_output=True, text=True, check=False, cwd=tmp_path)
    here = flexdrive("design", "no.toml", cwd=tmp_path)
    assert (told.returncode, told.stdout) == (here.returncode, here.stdout) == (2, "")
    assert "no.toml" in told.stderr


def test_nothing_heavy_is_loaded_before_a_command_runs():
    # numpy reads the number of its threads once, so the command line must have set it before
    look = "import sys, baselines.cli; print('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", look], capture_output=True, text=True, check=True).stdout == "False\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A few short recordings and a drive, as a user may have them."""
    base = tmp_path_factory.mktemp("lab")
    rig = Drive({**RIG, "saturation.limit": 8.0}, name="test rig")
    save_drive(rig, base / "drive.toml")
    for kind, amplitude, frequency in (
        ("square", 1.5, 0.5),
        ("square", 2.0, 0.5),
        ("sine", 2.5, 1.0),
        ("sine", 2.5, 3.0),
    ):
        run = open_loop(rig, kind, amplitude, frequency)
        write_recording(run, base / "recordings" / f"{run.name}.csv")
    return base


def test_the_contract_names_every_command():
    assert set(COMMANDS) == {
        "demo", "identify", "validate", "stability", "experiment", "diagnose", "design", "train", "compare", "report",
        "blind", "benchmark", "check", "export", "lab", "migrate", "rigs", "term",
    }  # fmt: skip


@each("command", COMMANDS)
def test_help(command):
    result = flexdrive(command, "--help")
    assert result.returncode == 0
    assert "--json" in result.stdout


@each("command", COMMANDS)
def test_wrong_usage_exits_2(command):
    assert flexdrive(command, "--no-such-option").returncode == 2


@pytest.mark.parametrize("command", [c for c in COMMANDS if c not in {"demo", "benchmark", "rigs"}])
def test_a_missing_file_is_named_and_nothing_is_written(command, tmp_path):
    option = {"stability": "--gain", "lab": "--port"}.get(command, "-o")
    result = flexdrive(command, "no/such/thing", option, "1", cwd=tmp_path)
    assert result.returncode == 2
    assert "no/such/thing" in result.stderr.replace("\n", "")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("command", "arguments"),
    [
        ("identify", ["recordings", "-o", "out/drive.toml"]),
        ("identify", ["recordings", "--method", "handout", "-o", "out/handout.toml"]),
        ("validate", ["drive.toml", "recordings"]),
        ("stability", ["drive.toml", "--draws", "5"]),
        pytest.param("stability", ["drive.toml", "-o", "out", "--draws", "5"], marks=pytest.mark.slow),
        pytest.param("design", ["drive.toml", "-o", "out"], marks=pytest.mark.slow),
        pytest.param(
            "compare",
            ["drive.toml", "-o", "out", "-c", "p_x1,p_x2", "-a", "none", "-r", "sine", "--no-effects"],
            marks=pytest.mark.slow,
        ),
        ("experiment", ["drive.toml", "-o", "out/day", "--frequency", "1", "--square", "1.5"]),
        ("export", ["drive.toml", "--to", "matlab", "-o", "out"]),
    ],
)
def test_json_is_one_object(folder, command, arguments):
    result = flexdrive(command, *arguments, "--json", cwd=folder)
    assert result.returncode == 0, result.stderr
    found = json.loads(result.stdout)
    assert isinstance(found, dict)
    assert "NaN" not in result.stdout
    if command == "stability":
        assert found["x2"]["unit"] == "V/mm"
        assert found["x1"]["critical_gain_linear"] is None
        assert found["x2"]["critical_gain_simulated"] > found["x2"]["critical_gain_linear"]
        for x in ("x1", "x2"):
            # a drive.toml that nothing was identified for has no intervals, and knows of no recordings
            assert found[x]["critical_gain_simulated_ci95"] is None
            assert found[x]["extrapolated"] is None
    if command in {"stability", "design", "compare"} and "-o" in arguments:
        page = (folder / "out" / f"{command}.html").read_text()
        assert not re.findall(r"""(?:src|href)=["'](?!data:|#)""", page)  # self-contained
        assert "<img" in page
    if command == "design":
        assert found["refined"]["met"]
        assert set(found["refined"]["values"]) >= {"φmax", "α", "T", "Z = 1/(αT)", "P = 1/T", "Kp"}
    if command == "compare":
        assert set(found["controllers"]) == {"p_x1", "p_x2", "p_x1@5ms", "p_x2@5ms"}
        assert found["cases"] == {"nominal": 1, "draw": 0, "effect": 0, "unseen": 1}
        teaching = (folder / "out" / "teaching.html").read_text()
        assert not re.findall(r"""(?:src|href)=["'](?!data:|#)""", teaching)
        assert "no covariance" in found["notes"][0]
    if command == "identify":
        expected = {"bT", "b1", "b2", "dT", "d1", "d2", "p", "mT", "m1", "m2", "omega_d", "k", "zeta", "omega_n", "C"}
        assert set(found["quantities"]) == expected


@each(
    ("content", "text"),
    [
        ("t_s,u_V,v1_mm_s\n0,1,x\n", "v1"),
        ("t_s,v1_mm_s\n" + "\n".join(f"{i / 1000},1" for i in range(500)), "u"),
        ("t_s,u_V,v1_mm_s\n" + "\n".join(f"{i / 1000},1,2" for i in range(20)), "0.2 s and 50 samples"),
        ("", "no lines"),
    ],
)
def test_bad_recordings_fail_with_a_sentence(tmp_path, content, text):
    (tmp_path / "bad.csv").write_text(content)
    result = flexdrive("identify", "bad.csv", "-o", "drive.toml", cwd=tmp_path)
    assert result.returncode == 1
    assert "bad.csv" in result.stderr
    assert text in result.stderr
    assert "Traceback" not in result.stderr
    assert not (tmp_path / "drive.toml").exists()


def test_a_bad_drive_fails_with_a_sentence(tmp_path):
    (tmp_path / "drive.toml").write_text("schema = 1\n[parameters]\nm1 = {value = -1.0}\n")
    result = flexdrive("stability", tmp_path / "drive.toml")
    assert result.returncode == 1
    assert "m1: must lie in" in result.stderr


def test_experiments_can_be_identified_again(folder):
    assert flexdrive("experiment", "drive.toml", "-o", "again", cwd=folder).returncode == 0
    result = flexdrive("identify", "again", "-o", "again.toml", "--no-compare-tied", "--json", cwd=folder)
    found = json.loads(result.stdout)["quantities"]
    for name in ("m1", "m2", "b1", "d1", "k"):
        assert found[name]["value"] == pytest.approx(RIG[name], rel=0.02)


@pytest.fixture(scope="module")
def diagnosed(tmp_path_factory):
    """The diagnosis of four short runs of a rig whose spring hardens."""
    base = tmp_path_factory.mktemp("diagnosis")
    for run in data_set({"hardening_spring.k3": 2e-4}, kinds=(KINDS[0], *KINDS[2:]), t=T[:2001]):
        write_recording(run, base / "recordings" / f"{run.name}.csv")
    (base / "out").mkdir()
    (base / "out" / "suggest_1_sine_1V_1Hz.csv").write_text("of an earlier diagnosis")
    return base, flexdrive("diagnose", "recordings", "-o", "out", "--json", "--suggest", "--rounds", "1", cwd=base)


def test_diagnose_prints_what_it_writes(diagnosed):
    base, result = diagnosed
    assert result.returncode == 0, result.stderr
    found = json.loads(result.stdout)
    assert found == json.loads((base / "out" / "diagnosis.json").read_text(encoding="utf-8"))
    schema = files("identification.mismatch") / "diagnosis.schema.json"
    jsonschema.validate(found, json.loads(schema.read_text(encoding="utf-8")))
    # one round names the spring, and nobody knows what another would
    assert found["verdict"] == "partly_explained"
    assert any(note.startswith("the search ended after 1 round,") for note in found["notes"])
    assert found["findings"][0]["id"] == "hardening_spring"
    assert found["findings"][0]["parameters"]["k3"]["value"] == pytest.approx(2e-4, rel=0.1)
    assert {p["name"] for p in found["predictions"]} >= {"critical_gain_x2_simulated", "damping_ratio"}
    # files of an earlier diagnosis are gone with it
    assert {p.name for p in (base / "out").iterdir()} >= {"diagnosis.json", "drive.toml", "report.html"}
    assert not (base / "out" / "suggest_1_sine_1V_1Hz.csv").exists()
    assert {p.name for p in base.iterdir()} == {"out", "recordings"}


def test_the_diagnosed_drive_has_the_named_physics(diagnosed):
    base, _ = diagnosed
    assert load_drive(base / "out" / "drive.toml")["hardening_spring.k3"] == pytest.approx(2e-4, rel=0.1)


def test_the_page_of_a_diagnosis(diagnosed):
    page = (diagnosed[0] / "out" / "report.html").read_text(encoding="utf-8")
    assert not re.findall(r"""(?:src|href)=["'](?!data:|#)""", page)  # self-contained
    assert page.index("The model left out: hardening spring at spring") < page.index("<img")
    for anchor in (
        "overlay",
        "maps",
        "findings",
        "faults",
        "remains",
        "reversals",
        "recordings",
        "predictions",
        "homogeneity",
        "baseline",
        "harmonics",
    ):
        assert f'id="{anchor}"' in page
    assert page.count("data:image/png;base64,") == 4


def test_too_little_to_diagnose_names_the_next_experiment(diagnosed, tmp_path):
    one = next((diagnosed[0] / "recordings").iterdir())
    result = flexdrive("diagnose", one, "-o", "out", cwd=tmp_path)
    assert result.returncode == 1
    assert re.search(r"needs at least two recordings; got 1 of 2\.0 s.*Record squares", result.stderr)
    assert not list(tmp_path.iterdir())


def test_a_column_of_unknown_unit_is_named_where_there_is_too_little(tmp_path):
    lines = [f"{n * 1e-3:.3f},{n % 400 / 200 - 1:.3f},{n % 300},{n % 300}" for n in range(3000)]
    (tmp_path / "a.csv").write_text("\n".join(["t [s],u [V],v1 [furlong/fortnight],v2 [mm/s]", *lines]) + "\n")
    result = flexdrive("diagnose", "a.csv", "-o", "out", cwd=tmp_path)
    assert result.returncode == 1
    assert "columns ignored: v1 [furlong/fortnight] (a)" in " ".join(result.stderr.split())
    assert [p.name for p in tmp_path.iterdir()] == ["a.csv"]


def test_rigs_that_are_absent_are_listed(tmp_path):
    (tmp_path / "data").mkdir()
    result = flexdrive("rigs", "--data", "data", "-o", "out", "--json", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    found = json.loads(result.stdout)
    assert found == json.loads((tmp_path / "out" / "rigs.json").read_text(encoding="utf-8"))
    assert len(found["absent"]) == len(found["rigs"]) == 9
    assert "Absent: ecp210_2025" in (tmp_path / "out" / "rigs.html").read_text(encoding="utf-8")


def test_rigs_names_what_is_wrong(tmp_path):
    result = flexdrive("rigs", "--data", "no/such/folder", "-o", "out", cwd=tmp_path)
    assert result.returncode == 2
    assert "no/such/folder" in result.stderr.replace("\n", "")
    wrong = flexdrive("rigs", "--data", ".", "-o", "out", "--only", "emp", cwd=tmp_path)
    assert wrong.returncode == 2
    assert "emps" in wrong.stderr
    assert list(tmp_path.iterdir()) == []


def test_benchmark_names_what_is_missing(tmp_path):
    result = flexdrive("benchmark", "emps", "--data", "no/such/folder", cwd=tmp_path)
    assert result.returncode == 2
    assert "no/such/folder" in result.stderr.replace("\n", "")
    assert flexdrive("benchmark", "no_such_set", "--data", ".", cwd=tmp_path).returncode == 2
    empty = flexdrive("benchmark", "silverbox", "--data", ".", "-o", "out", cwd=tmp_path)
    assert empty.returncode == 1
    assert "must hold training files of silverbox" in empty.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_demo_ends_with_a_report(tmp_path):
    result = flexdrive("demo", "-o", tmp_path / "demo", "--json")
    assert result.returncode == 0, result.stderr
    page = (tmp_path / "demo" / "report.html").read_text()
    assert not re.findall(r"""(?:src|href)=["'](?!data:|#)""", page)  # self-contained
    assert FOLDER.exists()
    # the sample conceals a Stribeck effect on cart 1
    assert json.loads(result.stdout)["findings"] == [{"id": "stribeck", "where": "cart_1"}]
    assert "The model left out: Stribeck effect at cart 1." in page
