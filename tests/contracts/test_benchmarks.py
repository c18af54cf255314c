"""Every benchmark that code or documentation names can be run."""

import re
from pathlib import Path

from benchmarks.__main__ import ALL, LONG

ROOT = Path(__file__).parents[2]


def test_every_benchmark_that_is_named_exists():
    files = [ROOT / "README.md", ROOT / "Makefile", *(ROOT / "docs").rglob("*.md")]
    files += [
        f
        for part in ("flexdrive_gym", "identification", "baselines", "benchmarks")
        for f in (ROOT / part).rglob("*.py")
    ]
    named = {name for f in files for name in re.findall(r"python -m benchmarks ([a-z_]+)", f.read_text())}
    assert named <= {*ALL, *LONG}
