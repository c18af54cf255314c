"""The page on physics says what the package has."""

import runpy
from pathlib import Path

DOCS = Path(__file__).parents[2] / "docs"


def test_page_is_up_to_date():
    page = runpy.run_path(str(DOCS / "physics.py"))["page"]()
    assert (DOCS / "physics.md").read_text(encoding="utf-8") == page, "run: python docs/physics.py"
