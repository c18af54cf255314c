"""What ``import gymnasium`` takes with the start-up file that lets Gymnasium know our environments, and without it."""

import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

import numpy as np

PAIRS = 41
AIM_MS = 5.0
ROOT = Path(__file__).parents[1]
# from the start-up file, which every Python of the installation reads, to Gymnasium with our environments; the processor's
# time, so that what other programs take in between does not count
CODE = """
import os, site, sys, time
begin = time.process_time_ns()
site.addsitedir(sys.argv[1])
started = time.process_time_ns()
import gymnasium
end = time.process_time_ns()
assert ("FlexDrive-NonCollocated-v0" in gymnasium.registry) is bool(os.listdir(sys.argv[1]))
print(started - begin, end - started)
"""


def timed(site: str) -> list[int]:
    found = subprocess.run([sys.executable, "-S", "-c", PATH + CODE, site], capture_output=True, text=True, check=True)
    return [int(word) for word in found.stdout.split()]


# -S: an installation of ours in this Python would register the environments in both
PATH = f"import sys; sys.path[:0] = {[path for path in sys.path if path]!r}\n"


def main() -> None:
    force_include = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["hatch"]["build"]
    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryDirectory() as empty:
        for source, target in force_include["targets"]["wheel"]["force-include"].items():
            shutil.copy(ROOT / source, Path(folder) / target)
        timed(folder)  # leaves the compiled file, as an installer does
        pairs = np.array([(timed(folder), timed(empty)) for _ in range(PAIRS)]) / 1e6
    print(f"CPU time, median of {PAIRS} pairs of fresh processes (half of the pairs between):")
    for what, own in (
        ("start of Python", pairs[:, :, 0]),
        ("import gymnasium", pairs[:, :, 1]),
        ("both", pairs.sum(axis=2)),
    ):
        low, middle, high = np.quantile(own[:, 0] - own[:, 1], (0.25, 0.5, 0.75))
        print(
            f"  {what:16s} {np.median(own[:, 1]):6.1f} ms, with our environments {middle:+.2f} ms ({low:+.2f} to {high:+.2f})"
        )
    print(f"  aim: below {AIM_MS:g} ms")
