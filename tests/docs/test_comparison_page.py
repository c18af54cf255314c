"""The example in docs/comparison.md runs and shows what the page says."""

from baselines.compare import UNSEEN
from baselines.compare.entries import PREVIEWED
from tests.docs.pages import printed, read

PAGE = read("docs/comparison.md")


def test_the_sweep_finds_lab_4s_response():
    assert printed("docs/comparison.md").strip() == "True"


def test_references_and_previewed_designs_are_named():
    assert all(f"`{name}`" in PAGE for name in (*UNSEEN, *PREVIEWED))
