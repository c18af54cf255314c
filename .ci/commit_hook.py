"""Writes the commit that a distribution is built from into it; a build from an sdist keeps what the sdist says."""

import subprocess
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

NAME = "flexdrive_gym/commit.txt"


class CommitHook(BuildHookInterface):
    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        if version == "editable" or not (Path(self.root) / ".git").exists():
            return  # a checkout is asked when the version is printed
        asked = ["git", "-C", self.root, "describe", "--always", "--dirty", "--exclude=*", "--abbrev=12"]
        try:
            commit = subprocess.run(asked, capture_output=True, text=True, check=True).stdout.strip()
        except (OSError, subprocess.CalledProcessError):
            return
        self.folder = tempfile.TemporaryDirectory()
        written = Path(self.folder.name) / "commit.txt"
        written.write_text(commit + "\n", encoding="utf-8")
        build_data["force_include"][str(written)] = NAME

    def finalize(self, *_built: object) -> None:
        if hasattr(self, "folder"):
            self.folder.cleanup()
