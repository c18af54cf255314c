"""The example in docs/controllers.md runs and shows what the page says."""

import contextlib
import io
import re
from pathlib import Path

PAGE = (Path(__file__).parents[2] / "docs" / "controllers.md").read_text(encoding="utf-8")


def test_example_finds_the_same_margin_twice():
    code = re.search(r"```python\n(.*?)```", PAGE, re.DOTALL).group(1)
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        exec(compile(code, "docs/controllers.md", "exec"), {})
    analytic, by_trial = map(float, out.getvalue().split())
    assert abs(by_trial / analytic - 1.0) < 0.02


def test_every_family_is_described():
    from baselines.controllers import FAMILIES

    assert all(f"`{name}`" in PAGE for name in FAMILIES)
