"""The example in docs/comparison.md runs and shows what the page says."""

import contextlib
import io
import re
from pathlib import Path

from baselines.compare import UNSEEN
from baselines.compare.entries import PREVIEWED

PAGE = (Path(__file__).parents[2] / "docs" / "comparison.md").read_text(encoding="utf-8")


def test_the_sweep_finds_lab_4s_response():
    code = re.search(r"```python\n(.*?)```", PAGE, re.DOTALL).group(1)
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        exec(compile(code, "docs/comparison.md", "exec"), {})
    assert out.getvalue().strip() == "True"


def test_references_and_previewed_designs_are_named():
    assert all(f"`{name}`" in PAGE for name in (*UNSEEN, *PREVIEWED))
