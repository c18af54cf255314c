"""Every example runs and ends with its result."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.each import each

EXAMPLES = Path(__file__).parents[2] / "examples"
EXPECTED = {
    "p_controller.py": ([], r"rms tracking error 1[0-9]\.\d+ mm over 4000 ms"),
    "random_search.py": ([], r"best of 512: P = \d"),
    "cleanrl_style.py": (["8192"], r"rms tracking error \d+\.\d+ mm on the handout's trajectory"),
    "stable_baselines.py": (["2048"], r"mean return .* after 2048 steps"),
}


def test_every_example_is_tested():
    assert {p.name for p in EXAMPLES.glob("*.py")} == set(EXPECTED)


@each("name", EXPECTED)
def test_example_runs(name):
    if name in {"stable_baselines.py", "cleanrl_style.py"}:
        pytest.importorskip("stable_baselines3", reason="needs the extra rl")
    arguments, pattern = EXPECTED[name]
    done = subprocess.run(
        [sys.executable, EXAMPLES / name, *arguments], capture_output=True, text=True, check=False, timeout=300
    )
    assert done.returncode == 0, done.stderr
    assert re.search(pattern, done.stdout)
