"""Builds wheel and sdist, installs them into a clean environment of every Python from 3.11 to 3.13 found here, and tries them.

With ``--only`` into that of one Python; ``--only running`` is the one that runs this.

The wheel is built from the sdist. Neither environment has PyTorch: on Linux its usual wheels bring gigabytes of CUDA, and
only training needs it. Prints a line for every Python, found or not; fails when one of those found fails.
"""

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
MINORS = (11, 12, 13)


def python(minor: int) -> str | None:
    """Path of a Python 3.minor on this machine, also one that pyenv keeps."""
    kept = sorted(Path.home().glob(f".pyenv/versions/3.{minor}.*/bin/python"))
    for candidate in (shutil.which(f"python3.{minor}"), *map(str, kept), sys.executable):
        asked = [candidate, "-c", "import sys, venv, ensurepip; print(sys.version_info.minor)"]
        if candidate and subprocess.run(asked, capture_output=True, text=True, check=False).stdout.strip() == str(
            minor
        ):
            return candidate
    return None


def run(*command: object, cwd: Path = ROOT) -> str:
    """Run quietly and return what it printed; what it complains of is in the error."""
    done = subprocess.run(list(map(str, command)), cwd=cwd, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(map(str, command))}\n{done.stdout}{done.stderr}")
    return done.stdout


def build(folder: Path) -> tuple[Path, Path]:
    """Return wheel and sdist."""
    run(sys.executable, "-m", "build", "--outdir", folder, ROOT)
    return next(folder.glob("*.whl")), next(folder.glob("*.tar.gz"))


def trial(interpreter: str, folder: Path, wheel: Path, sdist: Path) -> str:
    """Return the closing line of the smoke test, of the wheel and again with the sdist in its place."""
    run(interpreter, "-m", "venv", folder)
    own = folder / "bin" / "python"
    pip = (own, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "-c", ROOT / "constraints.txt")
    run(*pip, f"flexdrive[no-torch] @ {wheel.as_uri()}")
    # from an empty folder, so that what runs is what was installed
    empty = folder / "empty"
    empty.mkdir()
    said = run(own, ROOT / ".ci" / "smoke.py", cwd=empty).splitlines()[-1]
    run(*pip, "--no-deps", "--force-reinstall", sdist)
    run(own, ROOT / ".ci" / "smoke.py", "--quick", cwd=empty)
    return said


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("-o", "--output", type=Path, help="folder that keeps wheel and sdist")
    options.add_argument("--only", help="one Python: 3.11, 3.12, 3.13 or running, the one that runs this")
    asked = options.parse_args()
    if asked.only and not re.fullmatch(r"3\.(11|12|13)|running", asked.only):
        options.error(f"--only: must be 3.11, 3.12, 3.13 or running; got {asked.only!r}")
    wanted = MINORS
    if asked.only:
        wanted = (sys.version_info.minor if asked.only == "running" else int(asked.only[2:]),)
    others = [minor for minor in MINORS if minor not in wanted]
    lines, failed, missing = [f"Python 3.{minor}: not asked for" for minor in others], 0, len(others)
    with tempfile.TemporaryDirectory() as scratch:
        output = asked.output or Path(scratch) / "dist"
        if asked.output and output.is_dir() and any(output.iterdir()):
            options.error(f"--output: must be an empty folder or none; got {output}, which holds files. Remove them.")
        wheel, sdist = build(output)
        print(f"built {wheel.name} and {sdist.name}", flush=True)
        for minor in wanted:
            interpreter = sys.executable if asked.only == "running" else python(minor)
            began = time.monotonic()
            if interpreter is None:
                missing += 1
                lines.append(f"Python 3.{minor}: not found here, nothing tried")
                continue
            try:
                said = trial(interpreter, Path(scratch) / f"3.{minor}", wheel, sdist)
            except RuntimeError as error:
                failed += 1
                said = f"FAILED: {error}"
            lines.append(f"Python 3.{minor} ({interpreter}): {said} ({time.monotonic() - began:.0f} s)")
            print(lines[-1], flush=True)
    print("\n".join(["package, what ran:", *lines]))
    print(f"{len(lines) - failed - missing} passed, {failed} failed, {missing} skipped")
    raise SystemExit(1 if failed else 0)


if __name__ == "__main__":
    main()
