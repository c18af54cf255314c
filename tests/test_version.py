"""Where the version's commit comes from."""

import shutil
import subprocess

import pytest

from flexdrive_gym.version import __version__, commit


def test_version_is_a_release_or_on_the_way_to_one():
    from packaging.version import Version

    assert Version(__version__) >= Version("0.0.0")


@pytest.mark.skipif(shutil.which("git") is None, reason="needs git")
def test_a_checkout_is_asked_for_its_commit(tmp_path):
    package = tmp_path / "flexdrive_gym"
    package.mkdir()

    def git(*arguments):
        who = ("-c", "user.name=a", "-c", "user.email=a@b")
        return subprocess.run(
            ["git", *who, "-C", tmp_path, *arguments], check=True, capture_output=True, text=True
        ).stdout.strip()

    git("init")
    (package / "a").write_text("1")
    git("add", "-A")
    git("commit", "-m", "First")
    assert commit(package) == git("rev-parse", "--short=12", "HEAD")
    (package / "a").write_text("2")
    assert commit(package).endswith("-dirty")


def test_a_distribution_knows_what_it_was_built_from(tmp_path):
    assert commit(tmp_path / "flexdrive_gym") is None
    (tmp_path / "flexdrive_gym").mkdir()
    (tmp_path / "flexdrive_gym" / "commit.txt").write_text("b75edfd3dc0c\n")
    assert commit(tmp_path / "flexdrive_gym") == "b75edfd3dc0c"
