"""The figures of the concealed trial are those of the outcomes that lie beside the page."""

import hashlib
import json

import pytest

from baselines.trial.judge import judge
from baselines.trial.plan import plan
from baselines.trial.study import outcomes, settings
from baselines.trial.summary import headline, summarise
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
