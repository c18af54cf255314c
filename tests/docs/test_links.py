"""Every relative link of README.md, CONTRIBUTING.md and the pages leads to a file."""

import re

from tests.docs.pages import ROOT, read
from tests.each import each

LINK = re.compile(r"\]\(([^)\s]+)\)")
CODE = re.compile(r"```.*?```|`[^`\n]*`", re.DOTALL)
# made from the code when the site is built (docs/site/hooks.py); mkdocs build --strict checks links into these
BUILT = ("tutorials/", "effects/", "reference/")
PAGES = ["README.md", "CONTRIBUTING.md", *sorted(str(p.relative_to(ROOT)) for p in (ROOT / "docs").rglob("*.md"))]


@each("page", PAGES)
def test_relative_links_exist(page):
    targets = [link.partition("#")[0] for link in LINK.findall(CODE.sub("", read(page)))]
    relative = [t for t in targets if t and not re.match(r"[a-z]+:", t)]
    checked = [t for t in relative if not (page.startswith("docs/") and t.startswith(BUILT))]
    missing = [t for t in checked if not (ROOT / page).parent.joinpath(t).exists()]
    assert not missing, page
