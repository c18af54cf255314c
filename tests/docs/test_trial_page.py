"""The figures of the concealed trial are those of the outcomes that lie beside the page."""

import hashlib
import json
import runpy

import pytest

from baselines.blind_study.judge import judge
from baselines.blind_study.plan import plan
from baselines.blind_study.study import outcomes, settings
from baselines.blind_study.summary import headline, summarise
from tests.docs.pages import ROOT, read

# studies whose outcomes lie beside the page: of the present diagnosis, and of the one before it
PRESENT, BEFORE = ROOT / "docs/trial/begun_13", ROOT / "docs/trial/seed_9"


def found_in(folder):
    asked = settings(folder)
    return outcomes(folder, plan(asked["trials"], asked["seed"]))


def figures_of(folder):
    return headline(summarise([judge(outcome) for outcome in found_in(folder)]))


@pytest.mark.parametrize("folder", [PRESENT, BEFORE], ids=lambda f: f.name)
def test_every_figure_is_the_study_s(folder):
    page = read("docs/trial.md")
    for what, value, aim in figures_of(folder):
        assert f"| {what} | {value} | {aim} |" in page
    assert f"flexdrive blind --report -o docs/trial/{folder.name}" in page


def test_the_readme_has_figures_of_the_present_diagnosis():
    readme = read("README.md")
    named = [f"| {what} | {value} | {aim} |" for what, value, aim in figures_of(PRESENT) if f"| {what} |" in readme]
    assert len(named) >= 5
    assert all(row in readme for row in named)
    assert f"{len(found_in(PRESENT))} of 200" in readme
    assert f"flexdrive blind --report -o docs/trial/{PRESENT.name}" in readme


@pytest.mark.parametrize("folder", [PRESENT, BEFORE], ids=lambda f: f.name)
def test_a_study_s_row_is_that_of_its_outcomes(folder):
    figures = runpy.run_path(str(ROOT / "docs/studies.py"))
    row = next(r for r in figures["rows"]() if r["study"] == folder.name)
    assert row | figures["row"](folder) == row


def test_studies_are_compared_by_their_figures():
    page = read("docs/trial.md").splitlines()
    studies = runpy.run_path(str(ROOT / "docs/studies.py"))["rows"]()
    assert [row["study"] for row in studies if row["seed"].isdecimal()] == [
        "seed_1", "begun_2", "seed_3", "begun_5", "seed_6", "begun_7", "begun_8", "seed_9", "begun_10", "begun_11", "begun_13",
    ]  # fmt: skip
    for row in (r for r in studies if r["seed"].isdecimal()):
        line = next(text for text in page if text.startswith(f"| `{row['study']}`"))
        nulls, pairs, unnamed, unnoticed = (
            row[what].split(" = ")[0]
            for what in (
                "nulls with a name",
                "pairs, both named",
                "effects outside the catalogue reported as unnamed",
                "effects outside the catalogue not noticed",
            )
        )
        singles = row["single effects from half size on, named exactly or in a tie"].split(" (")[0]
        said = f"| {singles} | {nulls} | {pairs} | {unnamed.split()[0]} and {unnoticed} |"
        assert said in line, row["study"]
        assert row["trials"] == "200" or f"stopped after {row['trials']} trials" in line
        seconds = float(line.rstrip("| ").rsplit("| ", maxsplit=1)[-1])
        assert abs(seconds - float(row["seconds per diagnosis on one core, median"])) < 0.5, row["study"]


def test_truths_are_what_was_sealed():
    """The hash was printed before the diagnosis began; a truth is written as one indented JSON object."""
    for outcome in (*found_in(PRESENT), *found_in(BEFORE)):
        text = json.dumps(outcome["truth"], indent=1, sort_keys=True) + "\n"
        assert hashlib.sha256(text.encode()).hexdigest() == outcome["sha256"]
