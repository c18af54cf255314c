"""Pages of the documentation and what their examples print."""

import contextlib
import io
import re
from pathlib import Path

ROOT = Path(__file__).parents[2]


def read(page):
    """Text of a page, by its path in the repository."""
    return (ROOT / page).read_text(encoding="utf-8")


def printed(page):
    """What the first Python example of a page prints."""
    code = re.search(r"```python\n(.*?)```", read(page), re.DOTALL).group(1)
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        exec(compile(code, page, "exec"), {})
    return out.getvalue()
