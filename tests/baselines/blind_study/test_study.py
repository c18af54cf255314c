"""A trial conceals, seals and diagnoses apart; a study resumes and does not mix."""

import hashlib
import json
import re
import shutil
import subprocess
import sys

import pytest
from typer.testing import CliRunner

from baselines.blind_study import one, study
from baselines.blind_study.judge import judge
from baselines.blind_study.plan import Trial, plan
from baselines.cli import app
from tests.baselines.blind_study.outcomes import outcome
from tests.each import each


@pytest.fixture
def quick(monkeypatch):
    """Trials that take no time; returns the numbers of those conducted."""
    conducted = []

    def conduct(trial, folder):
        conducted.append(trial.number)
        path = one.opened(folder, trial.number)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(outcome("null", number=trial.number)))
        return trial.number

    monkeypatch.setattr(study, "conduct", conduct)
    return conducted


def test_what_is_done_is_not_done_again(quick, tmp_path):
    study.conduct_study(tmp_path, 4, backend="sequential")
    one.opened(tmp_path, 2).unlink()
    quick.clear()
    seen = []
    found = study.conduct_study(tmp_path, 4, backend="sequential", progress=lambda *p: seen.append(p))
    assert quick == [2]
    assert seen == [(3, 4), (4, 4)]
    assert [o["trial"]["number"] for o in found] == [0, 1, 2, 3]


def test_another_study_is_not_mixed_in(quick, tmp_path):
    study.conduct_study(tmp_path, 2, backend="sequential")
    with pytest.raises(ValueError, match=r"holds a study with seed 0, not 1\. Give another folder"):
        study.conduct_study(tmp_path, 2, seed=1, backend="sequential")


@each("scheduler", [[], ["--scheduler", "nowhere://1"]])
def test_a_refused_backend_writes_nothing(scheduler, tmp_path):
    result = CliRunner().invoke(app, ["blind", "--backend", "dask", *scheduler, "-o", str(tmp_path / "out")])
    assert isinstance(result.exception, ValueError)
    assert str(result.exception).startswith("scheduler: ")
    assert not (tmp_path / "out").exists()


def test_a_rig_that_cannot_be_made_is_an_error(tmp_path):
    wrong = Trial(0, 1, "effect", ("stribeck", "the moon"), 1.0)
    with pytest.raises(ValueError, match="trial 0: its rig could not be made: error: effect: nothing makes 'stribeck'"):
        one.conduct(wrong, tmp_path)
    assert not one.opened(tmp_path, 0).exists()


def test_the_diagnosing_process_is_told_of_the_recordings_only(monkeypatch, tmp_path):
    told = []
    real = one._python

    def watched(module, *arguments, cwd=None, longest=None):
        told.append((module, arguments, cwd))
        if module == "baselines.blind_study.diagnosing":
            return subprocess.CompletedProcess([], 1, "", "Traceback\nValueError: enough seen")
        return real(module, *arguments, cwd=cwd)

    monkeypatch.setattr(one, "_python", watched)
    one.conduct(plan(1)[0], tmp_path)
    (made, making, _), (diagnosed, arguments, cwd) = told
    assert (made, diagnosed) == ("baselines.rig_simulator.make", "baselines.blind_study.diagnosing")
    assert all(str(tmp_path) not in a for a in (*arguments, cwd))
    assert making[making.index("--truth") + 1].startswith(str(tmp_path))
    written = json.loads(one.opened(tmp_path, 0).read_text())
    assert written["failed"] == "ValueError: enough seen"
    assert written["sha256"] == hashlib.sha256(one.sealed(tmp_path, 0).read_bytes()).hexdigest()
    assert judge(written).failed


def test_a_diagnosis_that_does_not_end_or_dies_has_failed(monkeypatch, tmp_path):
    monkeypatch.setattr(one, "_python", lambda *_a, **_k: subprocess.CompletedProcess([], -9, "", ""))
    assert one._diagnose(tmp_path, tmp_path / "answer.json", 0) == "ended without a word, status -9"
    monkeypatch.undo()
    monkeypatch.setattr(one, "_LONGEST_S", 0.06)
    assert one._diagnose(tmp_path, tmp_path / "answer.json", 0) == "no answer within 0.001 minutes"


def test_a_diagnosis_that_was_stopped_has_not_failed(monkeypatch, tmp_path):
    monkeypatch.setattr(one, "_python", lambda *_a, **_k: subprocess.CompletedProcess([], -15, "", ""))
    with pytest.raises(KeyboardInterrupt):
        one._diagnose(tmp_path, tmp_path / "answer.json", 0)


def test_a_truth_that_was_changed_is_noticed(monkeypatch, tmp_path):
    real = one._python

    def tampered(module, *arguments, cwd=None, longest=None):
        if module != "baselines.blind_study.diagnosing":
            return real(module, *arguments, cwd=cwd)
        truth = one.sealed(tmp_path, 0)
        truth.write_text(truth.read_text().replace('"seed"', '"Seed"'))
        return subprocess.CompletedProcess([], 1, "", "no")

    monkeypatch.setattr(one, "_python", tampered)
    with pytest.raises(ValueError, match="is not what was sealed"):
        one.conduct(plan(1)[0], tmp_path)


@pytest.mark.slow
def test_a_trial_from_beginning_to_end(tmp_path):
    result = subprocess.run(
        # a small effect, which is diagnosed in a round: what is asked is that the parts fit together
        [sys.executable, "-m", "baselines.cli", "blind", "--trials", "1", "--seed", "105", "-o", str(tmp_path), "--json"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert result.returncode == 0, result.stderr
    found = json.loads(result.stdout)
    assert found["summary"]["failed"] == 0
    assert (tmp_path / "trial.html").exists()


def test_a_study_tells_what_it_has_so_far(quick, tmp_path):
    with pytest.raises(ValueError, match="holds no study"):
        study.settings(tmp_path)
    study.conduct_study(tmp_path, 4, backend="sequential")
    one.opened(tmp_path, 3).unlink()
    result = CliRunner().invoke(app, ["blind", "--report", "-o", str(tmp_path), "--json"])
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["summary"]["trials"] == 3
    assert "--trials 4 --seed 0" in (tmp_path / "trial.html").read_text()


def test_a_study_is_told_from_its_packed_outcomes(quick, tmp_path):
    found = study.conduct_study(tmp_path / "all", 3, backend="sequential")
    study.pack(tmp_path / "packed", found)
    assert study.outcomes(tmp_path / "packed", plan(3)) == found
    first = (tmp_path / "packed" / study.PACKED).read_bytes()
    study.pack(tmp_path / "packed", found)
    assert (tmp_path / "packed" / study.PACKED).read_bytes() == first


def test_a_study_that_was_packed_goes_on(quick, tmp_path):
    """Of a study that the clock stopped one file is published; whoever has the same code takes it up."""
    begun = study.conduct_study(tmp_path, 4, backend="sequential")[:3]
    study.pack(tmp_path, begun)
    shutil.rmtree(one.opened(tmp_path, 0).parent)
    quick.clear()
    found = study.conduct_study(tmp_path, 4, backend="sequential")
    assert quick == [3]
    assert found[:3] == begun


@each(
    ("files", "message"),
    [
        ({"study.json": "{"}, r"study\.json cannot be read"),
        ({"study.json": '{"trials": 3, "seed": 0, "engine": "x"}', study.PACKED: "no gzip"}, r"gz cannot be read"),
        ({"study.json": '{"trials": 3, "seed": 0, "engine": "x"}'}, "no outcome yet"),
    ],
)
def test_a_report_of_nothing_or_of_damaged_files_is_refused(files, message, tmp_path):
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    result = CliRunner().invoke(app, ["blind", "--report", "-o", str(tmp_path)])
    assert isinstance(result.exception, ValueError)
    assert str(result.exception).startswith("output: ")
    assert re.search(message, str(result.exception))
    assert not (tmp_path / "trial.html").exists()
