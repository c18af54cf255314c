"""The glossary says what the pages say."""

import runpy
from pathlib import Path

from baselines.report.glossary import TERMS

DOCS = Path(__file__).parents[2] / "docs"


def test_page_is_up_to_date():
    page = runpy.run_path(str(DOCS / "glossary.py"))["markdown"]()
    assert (DOCS / "glossary.md").read_text(encoding="utf-8") == page, "run: python docs/glossary.py"


def test_what_users_asked_for_is_explained():
    assert {"presliding", "VAF", "disk margin", "interquartile mean", "dwell", "floor"} <= {t.name for t in TERMS}
    assert len({t.anchor for t in TERMS}) == len(TERMS)
