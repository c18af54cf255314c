"""Runs tests that depend on the interpreter on every other Python from 3.11 to 3.13 found here, without PyTorch.

The Python that runs this has all tests already. Each other one gets a fresh environment with what the environments need of the
tested set of packages. Prints a line for every Python, found or not; fails when one of those found fails.
"""

import sys
import tempfile
import time
from pathlib import Path

from package import MINORS, ROOT, python, run

TESTS = (
    # that nothing handed out is overwritten depends on how an interpreter counts references (decision 35)
    "environment/test_kept.py",
    "environment/test_info.py",
    "environment/test_refused.py",
    "test_units.py",
    # a study goes on under another version only if its parser sees the same code
    "baselines/evaluation/test_parallel.py",
)


def trial(interpreter: str, folder: Path) -> str:
    """Return which Python ran and the closing line of pytest."""
    run(interpreter, "-m", "venv", folder)
    own = folder / "bin" / "python"
    constraints = ("-c", ROOT / "constraints.txt")
    run(own, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *constraints, "-e", ROOT, "pytest")
    tests = [ROOT / "tests" / name for name in TESTS]
    said = run(own, "-m", "pytest", "-q", "-p", "no:cacheprovider", *tests).splitlines()[-1]
    version = run(own, "-c", "import platform; print(platform.python_version())").strip()
    return f"{version}: {', '.join(Path(name).name for name in TESTS)}: {said.strip('= ')}"


def main() -> None:
    failed = 0
    with tempfile.TemporaryDirectory() as scratch:
        for minor in MINORS:
            began = time.monotonic()
            if minor == sys.version_info.minor:
                said = f"3.{minor}: all tests, in the other stages"
            elif (interpreter := python(minor)) is None:
                said = f"3.{minor}: not found here, nothing ran"
            else:
                try:
                    said = f"{trial(interpreter, Path(scratch) / str(minor))} ({time.monotonic() - began:.0f} s in all)"
                except RuntimeError as error:
                    failed += 1
                    said = f"3.{minor}: FAILED\n{error}"
            print(f"Python {said}", flush=True)
    raise SystemExit(1 if failed else 0)


if __name__ == "__main__":
    main()
