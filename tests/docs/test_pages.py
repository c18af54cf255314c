"""The Python on every page runs; pages whose output is quoted have a test of their own."""

import re

import pytest

from flexdrive_gym import DEFAULT_DRIVE, save_drive
from tests.docs.pages import ROOT, read

BLOCK = re.compile(r"```python\n(.*?)```", re.DOTALL)
OWN_TEST = {"agents.md", "comparison.md", "controllers.md"}
PAGES = {p.name for p in (ROOT / "docs").glob("*.md") if BLOCK.search(p.read_text(encoding="utf-8"))}


@pytest.mark.parametrize("page", sorted(PAGES - OWN_TEST))
def test_examples_run(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    save_drive(DEFAULT_DRIVE, "drive.toml")
    space = {}
    for code in BLOCK.findall(read(f"docs/{page}")):
        exec(compile(code, page, "exec"), space)


def test_decisions_have_a_number_each():
    files = sorted((ROOT / "docs/decisions").glob("*.md"))
    # records that were folded into another leave a gap: no number is given twice
    assert len({f.name[:4] for f in files}) == len(files)
    for f in files:
        assert f.read_text(encoding="utf-8").startswith(f"# {int(f.name[:4])}. "), f.name


def test_the_page_on_compatibility_names_the_schemas_that_are_read():
    from flexdrive_gym.drive.toml import SCHEMA as DRIVE
    from identification.diagnosis_file import SCHEMA as DIAGNOSIS

    for file, schema in (("drive.toml", DRIVE), ("diagnosis.json", DIAGNOSIS)):
        known = ", ".join(map(str, range(1, schema.number + 1)))
        assert f"| `{file}` | {schema.number} | {known} |" in read("docs/compatibility.md")


def test_the_pages_of_environments_are_up_to_date():
    pytest.importorskip("latex2mathml", reason="needs the extra docs")
    from docs.site.environments import FOLDER, IDS, page

    for id_ in IDS:
        assert (FOLDER / f"{id_}.md").read_text(encoding="utf-8") == page(id_), "run: python -m docs.site.environments"
