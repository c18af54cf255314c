"""Gymnasium knows the environments in a script that never imports this package, once the distribution is installed."""

import shutil
import subprocess
import sys
import tomllib
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


@pytest.fixture
def installed(tmp_path):
    """A site directory with what the wheel puts beside the packages."""
    for source, target in PROJECT["tool"]["hatch"]["build"]["targets"]["wheel"]["force-include"].items():
        shutil.copy(ROOT / source, tmp_path / target)
    return tmp_path


def run(site, *lines):
    """Run a script in a Python that reads the start-up files of a site directory, twice as some installations do."""
    begin = f"import site; site.addsitedir({str(site)!r}); site.addsitedir({str(site)!r})"
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", "\n".join([begin, *lines])],
        capture_output=True, text=True, check=False, cwd=ROOT,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_all_ways_to_make_an_environment(installed):
    said = run(
        installed,
        "import sys, gymnasium",
        "assert gymnasium.spec('FlexDrive-NonCollocated-v0').kwargs == {'sensing': 'non_collocated'}",
        "assert not {'flexdrive_gym', 'numba', 'scipy'} & set(sys.modules)",
        "print(gymnasium.make('FlexDrive-NonCollocated-v0').reset(seed=0)[0].shape)",
        "for mode in ('vector_entry_point', 'sync', None):",
        "    print(gymnasium.make_vec('FlexDrive-FullState-v0', 3, mode).reset(seed=0)[0].shape)",
    )
    assert said.split("\n")[:-1] == ["(8,)", "(3, 10)", "(3, 10)", "(3, 10)"]


def test_nothing_is_left_behind(installed):
    said = run(
        installed,
        "import sys",
        "before = len(sys.meta_path)",
        "assert 'gymnasium' not in sys.modules",
        "import gymnasium",
        "print(before - len(sys.meta_path), gymnasium.envs.__loader__.__class__.__name__)",
    )
    assert said == "1 SourceFileLoader\n"


def test_a_registry_that_refuses_leaves_gymnasium_whole(installed):
    run(
        installed,
        "import sys, warnings, _flexdrive_gymnasium",
        "_flexdrive_gymnasium.register = lambda: 1 / 0",
        "with warnings.catch_warnings(record=True) as said:",
        "    warnings.simplefilter('always')",
        "    import gymnasium",
        "assert 'its environments could not be registered' in str(said[0].message)",
        "gymnasium.make('CartPole-v1')",
    )


def test_the_entry_point_registers_too(installed, monkeypatch):
    # as Gymnasium 0.26 to 0.29 load it; __root__ is their word for an id without a namespace
    ((name, value),) = PROJECT["project"]["entry-points"]["gymnasium.envs"].items()
    assert name == "__root__"
    monkeypatch.syspath_prepend(str(installed))
    import gymnasium

    for key in [key for key in gymnasium.registry if key.startswith("FlexDrive-")]:
        monkeypatch.delitem(gymnasium.registry, key)
    EntryPoint(name, value, "gymnasium.envs").load()()
    assert gymnasium.spec("FlexDrive-Collocated-v0").vector_entry_point == "flexdrive_gym.vector:FlexDriveVectorEnv"
