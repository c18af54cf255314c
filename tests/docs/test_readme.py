"""The README's example prints what the README says."""

import contextlib
import io
import re
from pathlib import Path

README = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")


def test_example_prints_its_output():
    code = re.search(r"```python\n(.*?)```", README, re.DOTALL).group(1)
    expected = re.search(r"```text\n(.*?)```", README, re.DOTALL).group(1)
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        exec(compile(code, "README.md", "exec"), {})
    assert out.getvalue() == expected


def test_picture_stands_in_the_first_ten_lines_and_exists():
    head = "\n".join(README.splitlines()[:10])
    picture = re.search(r"!\[.*?\]\((.*?)\)", head).group(1)
    assert (Path(__file__).parents[2] / picture).is_file()
