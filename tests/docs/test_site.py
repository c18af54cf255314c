"""The site builds without a warning, has a page of everything, and loads nothing from elsewhere."""

import os
import re
import subprocess
import sys
from html.parser import HTMLParser

import pytest

from tests.docs.pages import ROOT

LOADED = {("script", "src"), ("link", "href"), ("img", "src"), ("iframe", "src"), ("source", "src")}


class Loads(HTMLParser):
    """Gathers what a page loads without being asked."""

    def __init__(self):
        super().__init__()
        self.found = []

    def handle_starttag(self, tag, attrs):
        rel = dict(attrs).get("rel", "")
        self.found += [v for k, v in attrs if (tag, k) in LOADED and v and rel not in {"canonical", "next", "prev"}]


@pytest.mark.slow
def test_site_is_whole_and_offline(tmp_path):
    pytest.importorskip("mkdocs", reason="needs the extra docs")
    pytest.importorskip("marimo", reason="needs the extra notebooks")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "-d", tmp_path / "site"],
        cwd=ROOT, env={**os.environ, "NO_MKDOCS_2_WARNING": "1"}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    site = tmp_path / "site"
    from flexdrive_gym.drive.effects import EFFECTS

    for effect in EFFECTS:
        assert f'src="{effect.id}.png"' in (site / "effects" / f"{effect.id}.html").read_text()
        assert (site / "effects" / f"{effect.id}.png").stat().st_size > 5000
    for id_ in ("FlexDrive-Collocated-v0", "FlexDrive-NonCollocated-v0", "FlexDrive-FullState-v0"):
        page = (site / "environments" / f"{id_}.html").read_text()
        for heading in ("Action space", "Observation space", "Rewards", "Episode end", "Arguments", "Version history"):
            assert heading in page
    method = (site / "method.html").read_text()
    assert '<math xmlns="http://www.w3.org/1998/Math/MathML" display="block">' in method
    assert "$" not in re.sub(r"<script.*?</script>", "", method, flags=re.DOTALL)
    pages = list(site.rglob("*.html"))
    for page in pages:
        loads = Loads()
        loads.feed(page.read_text())
        outside = [address for address in loads.found if re.match(r"(?:https?:)?//", address)]
        assert not outside, (page.name, outside)
    for sheet in site.rglob("*.css"):
        assert not re.search(r"url\(\s*['\"]?(?:https?:)?//|@import", sheet.read_text()), sheet.name
