"""The figures of the concealed trial are those of the outcomes that lie beside the page."""

import hashlib
import json

import pytest

from baselines.trial.judge import judge
from baselines.trial.plan import plan
from baselines.trial.study import outcomes, settings
from baselines.trial.summary import headline, summarise
from flexdrive_gym.drive.effects import LAYOUT
from tests.docs.pages import ROOT, read

FOLDER = ROOT / "docs/trial"


@pytest.fixture(scope="module")
def found():
    asked = settings(FOLDER)
    return outcomes(FOLDER, plan(asked["trials"], asked["seed"]))


def test_every_figure_is_the_study_s(found):
    page, readme = read("docs/trial.md"), read("README.md")
    rows = headline(summarise([judge(outcome) for outcome in found]))
    for what, value, aim in rows:
        assert f"| {what} | {value} | {aim} |" in page
    assert rows[0][1] in readme


def test_truths_are_what_was_sealed(found):
    """The hash was printed before the diagnosis began; a truth is written as one indented JSON object."""
    for outcome in found:
        text = json.dumps(outcome["truth"], indent=1, sort_keys=True) + "\n"
        assert hashlib.sha256(text.encode()).hexdigest() == outcome["sha256"]


def test_every_shape_whose_interval_reaches_its_lower_bound_was_false(found):
    """What decision 17 says of the study, and why such findings are dropped since."""
    lower = {(e.effect.id, e.parameter.name): e.parameter.lower for e in LAYOUT.values() if e.parameter.role == "shape"}
    reach = [
        (outcome["trial"]["number"], f"{f['id']}@{f['where']}")
        for outcome in found
        for f in outcome["answer"]["diagnosis"]["findings"]
        for name, q in f["parameters"].items()
        if q["ci95"][0] is not None and q["ci95"][0] <= lower.get((f["id"], name), float("-inf"))
    ]
    assert [number for number, _ in reach] == [47, 110, 124]
    false = {outcome["trial"]["number"]: judge(outcome).false_names for outcome in found}
    assert all(name in false[number] for number, name in reach)
