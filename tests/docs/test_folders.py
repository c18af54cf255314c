"""Where things live is written down in CONTRIBUTING.md and in decision 31: both name the folders that exist."""

import re
import tomllib

from tests.docs.pages import ROOT, read


def folders(*path):
    """Folders of a folder that hold code or data, by name."""
    return {f.name for f in ROOT.joinpath(*path).iterdir() if f.is_dir() and not f.name.startswith(("_", "."))}


def test_decision_31_lists_the_layers_of_baselines():
    contracts = tomllib.loads(read("pyproject.toml"))["tool"]["importlinter"]["contracts"]
    layers = next(c["layers"] for c in contracts if c.get("containers") == ["baselines"])
    page = read("docs/decisions/0031-folders-say-what-they-hold.md")
    rows = [set(re.findall(r"`(\w+)`", names)) for names in re.findall(r"^\| \d+ \| (.*) \|$", page, re.MULTILINE)]
    assert rows == [set(layer.split(" : ")) for layer in reversed(layers)]
    assert set.union(*rows) | {"agents"} == folders("baselines")


def test_contributing_names_every_folder():
    said = set(re.findall(r"`(?:[\w.]+/)*([\w.]+)/", read("CONTRIBUTING.md")))
    for path in (["baselines"], ["identification"], ["flexdrive_gym"], ["flexdrive_gym", "drive"], ["docs"]):
        assert folders(*path) <= said, "/".join(path)
    assert {".ci", "benchmarks", "tests", "examples"} <= said
