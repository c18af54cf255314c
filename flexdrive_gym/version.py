"""Version of the distribution, and the commit it comes from."""

import subprocess
from importlib import metadata
from pathlib import Path

UNKNOWN = "0.0.0+unknown"
_PACKAGE = Path(__file__).parent


def _version() -> str:
    try:
        return metadata.version("flexdrive")
    except metadata.PackageNotFoundError:  # a copy that nobody installed
        return UNKNOWN


def commit(package: Path = _PACKAGE) -> str | None:
    """Return the commit of the checkout that the package lies in, or the one it was built from; ``None`` if neither is known.

    Parameters
    ----------
    package
        Folder of the installed package.
    """
    if (package.parent / ".git").exists():
        asked = ["git", "-C", str(package.parent), "describe", "--always", "--dirty", "--exclude=*", "--abbrev=12"]
        try:
            return subprocess.run(asked, capture_output=True, text=True, check=True, timeout=10).stdout.strip()  # noqa: S603
        except (OSError, subprocess.SubprocessError):
            return None
    built = package / "commit.txt"
    return built.read_text(encoding="utf-8").strip() if built.is_file() else None


__version__ = _version()
