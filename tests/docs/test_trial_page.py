"""The figures of the concealed trial are those of the outcomes in the repository."""

import hashlib
import json
import re
import runpy

import pytest

from baselines.blind_study.judge import judge
from baselines.blind_study.plan import plan
from baselines.blind_study.study import outcomes, settings
from baselines.blind_study.summary import headline, missed_or_false, summarise
from tests.docs.pages import ROOT, read

# the only study whose outcomes are kept beside the page
LATEST = ROOT / "docs/trial/begun_39"


@pytest.fixture(scope="module")
def found():
    asked = settings(LATEST)
    return outcomes(LATEST, plan(asked["trials"], asked["seed"]))


@pytest.fixture(scope="module")
def figures(found):
    return headline(summarise([judge(outcome) for outcome in found]))


@pytest.fixture(scope="module")
def studies():
    return runpy.run_path(str(ROOT / "docs/studies.py"))


def test_every_figure_is_the_study_s(figures):
    page = read("docs/trial.md")
    for what, value, aim in figures:
        assert f"| {what} | {value} | {aim} |" in page
    assert f"flexdrive blind --report -o docs/trial/{LATEST.name}" in page


def test_everything_that_is_missed_or_false_is_on_the_page(found):
    page = read("docs/trial.md")
    rows = [f"| {' | '.join(row)} |" for row in missed_or_false([judge(outcome) for outcome in found])]
    head = "| trial | concealed | found | wrong |"
    assert page[page.index(head) :].split("\n\n")[0].splitlines()[2:] == rows


def test_the_readme_has_figures_of_the_latest_study(found, figures):
    readme = read("README.md")
    named = [f"| {what} | {value} | {aim} |" for what, value, aim in figures if f"| {what} |" in readme]
    assert len(named) >= 5
    assert all(row in readme for row in named)
    assert f"{len(found)} of 200" in readme
    assert f"flexdrive blind --report -o docs/trial/{LATEST.name}" in readme


def test_the_row_of_the_latest_study_is_that_of_its_outcomes(studies):
    row = next(r for r in studies["rows"]() if r["study"] == LATEST.name)
    assert row | studies["row"](LATEST) == row


def test_outcomes_of_the_latest_study_alone_are_kept(studies):
    assert [p.name for p in (ROOT / "docs/trial").iterdir() if p.is_dir()] == [LATEST.name]
    for row in studies["rows"]():
        where = row["outcomes"]
        if row["study"] == LATEST.name:
            assert where == f"docs/trial/{LATEST.name}"
        elif row["seed"].isdecimal():
            assert re.fullmatch(rf"git show [0-9a-f]{{7}}:docs/trial/{row['study']}/outcomes.jsonl.gz", where)


def test_studies_of_one_diagnosis_are_counted_together(studies):
    page = read("docs/trial.md")
    (asked,) = re.findall(r"docs/studies.py --together ([\w ]+)`", page)
    counted = studies["together"](asked.split())
    rows = re.findall(r"(?m)^\| ([^|]+) \| ([^|]+) \| [^|]* \|$", page[page.index(asked) :].split("\n\n")[1])
    assert len(rows) > 5
    assert {what: value for what, value in rows[1:] if "---" not in what}.items() <= counted.items()


@pytest.mark.parametrize("kind", ["alone", "in a pair"])
def test_effects_of_pairs_are_counted_one_by_one(studies, found, monkeypatch, kind):
    """Of outcomes with one more effect concealed, which nothing found, each named effect is half of a pair."""
    one = [o for o in found if len(judge(o).concealed) == 1]
    other = {"id": "another", "where": "nowhere", "size": 1.0, "parameters": {}}
    two = [{**o, "truth": {**o["truth"], "effects": [*o["truth"]["effects"], other]}} for o in one]
    monkeypatch.setitem(studies["by_effect"].__globals__, "kept", lambda _: two if kind == "in a pair" else one)
    hits = [
        hit
        for each in studies["by_effect"](["any"]).values()
        for key, own in each.items()
        for hit in own
        if key[0] == kind
    ]
    assert len(hits) == len(one) * (2 if kind == "in a pair" else 1)
    assert sum(hits) == sum(judge(o).concealed[0].named in {"exact", "tie"} for o in one) > 0


def test_studies_are_compared_by_their_figures(studies):
    page = read("docs/trial.md").splitlines()
    head = next(text for text in page if text.startswith("| study |"))
    assert (
        "| nulls with a name | pairs, both named | outside the catalogue: unnamed, and not noticed | seconds |" in head
    )
    rows = [row for row in studies["rows"]() if row["seed"].isdecimal()]
    assert [row["study"] for row in rows] == [
        "seed_1", "begun_2", "seed_3", "begun_5", "seed_6", "begun_7", "begun_8", "seed_9", "begun_10", "begun_11", "begun_13",
        "begun_15", "begun_16", "begun_18", "begun_20", "begun_21", "begun_22", "begun_23", "begun_24", "begun_25", "begun_26",
        "begun_27", "begun_28", "begun_29", "begun_30", "begun_31", "begun_32", "begun_33",
        "begun_34", "begun_35", "begun_36", "begun_37", "begun_38", "begun_39",
    ]  # fmt: skip
    for row in rows:
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


def test_truths_are_what_was_sealed(found):
    """The hash was printed before the diagnosis began; a truth is written as one indented JSON object."""
    for outcome in found:
        text = json.dumps(outcome["truth"], indent=1, sort_keys=True) + "\n"
        assert hashlib.sha256(text.encode()).hexdigest() == outcome["sha256"]


def test_a_study_that_the_history_lacks_is_an_error_with_a_remedy():
    from benchmarks.paired import study_folder

    with (
        pytest.raises(ValueError, match="must be in the history.*git fetch --unshallow.*or give a folder"),
        study_folder("0000000:docs/trial/seed_0"),
    ):
        pass
