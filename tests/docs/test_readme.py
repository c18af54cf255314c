"""The README's example prints what the README says."""

import re
from pathlib import Path

from tests.docs.pages import printed, read

README = read("README.md")


def test_example_prints_its_output():
    expected = re.search(r"```text\n(.*?)```", README, re.DOTALL).group(1)
    assert printed("README.md") == expected


def test_picture_stands_in_the_first_ten_lines_and_exists():
    head = "\n".join(README.splitlines()[:10])
    picture = re.search(r"!\[.*?\]\((.*?)\)", head).group(1)
    assert (Path(__file__).parents[2] / picture).is_file()
