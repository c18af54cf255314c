"""Files are written whole or not at all."""

import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from flexdrive_gym.files import only_writer, write_atomically, write_together
from tests.each import each


def test_what_is_written_together_replaces_what_was_there(tmp_path):
    folder = tmp_path / "deep" / "out"
    folder.mkdir(parents=True)
    (folder / "old_1.csv").write_text("of an earlier run")
    (folder / "mine.txt").write_text("not ours")
    (folder / "a.json").write_text("before")

    def write(where):
        (where / "a.json").write_text("after")
        (where / "b.json").write_text("new")

    write_together(folder, write, stale="old_*.csv")
    assert {p.name: p.read_text() for p in folder.iterdir()} == {
        "a.json": "after",
        "b.json": "new",
        "mine.txt": "not ours",
    }
    assert [p.name for p in folder.parent.iterdir()] == ["out"]
    beside = write_atomically(tmp_path / "beside", "x")
    assert (folder / "b.json").stat().st_mode == beside.stat().st_mode


@each("there", [True, False])
def test_what_fails_half_way_leaves_everything_as_it_was(tmp_path, there):
    folder = tmp_path / "out"
    if there:
        folder.mkdir()
        (folder / "a.json").write_text("before")
        (folder / "old_1.csv").write_text("before")

    def write(where):
        (where / "a.json").write_text("after")
        raise OSError("no space left")

    with pytest.raises(OSError, match="no space"):
        write_together(folder, write, stale="old_*.csv")
    assert [p.name for p in tmp_path.iterdir()] == (["out"] if there else [])
    assert not there or {p.read_text() for p in folder.iterdir()} == {"before"}


def test_a_link_stays_and_what_it_points_to_is_replaced(tmp_path):
    (tmp_path / "mine.toml").write_text("before")
    (tmp_path / "link.toml").symlink_to("mine.toml")
    (tmp_path / "dangling.toml").symlink_to("new.toml")
    assert write_atomically(tmp_path / "link.toml", "after") == tmp_path / "link.toml"
    write_atomically(tmp_path / "dangling.toml", "after")
    write_together(tmp_path, lambda where: (where / "link.toml").write_text("together") and None)
    assert (tmp_path / "link.toml").is_symlink()
    assert (tmp_path / "mine.toml").read_text() == "together"
    assert (tmp_path / "dangling.toml").is_symlink()
    assert (tmp_path / "new.toml").read_text() == "after"


@each("name", ["pipe", "link_to_pipe", "folder", "circle", "file/x.toml"])
def test_only_regular_files_are_replaced(tmp_path, name):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "link_to_pipe").symlink_to("pipe")
    (tmp_path / "folder").mkdir()
    (tmp_path / "circle").symlink_to("circle")
    (tmp_path / "file").write_text("")
    before = {p.name for p in tmp_path.iterdir()}
    with pytest.raises(ValueError, match=rf"output: .*{name.split('/')[0]}.*Choose another"):
        write_atomically(tmp_path / name, "x")
    assert {p.name for p in tmp_path.iterdir()} == before
    assert stat.S_ISFIFO((tmp_path / "pipe").stat().st_mode)


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="needs /proc")
def test_a_place_where_no_file_can_be_made_is_refused():
    with pytest.raises(ValueError, match=r"output: /proc/x.toml cannot be written: no file can be made in /proc"):
        write_atomically("/proc/x.toml", "x")
    with pytest.raises(ValueError, match=r"only a regular file is replaced; /dev/null is a device"):
        write_atomically("/dev/null", "x")


def test_a_second_writer_of_a_folder_is_refused_by_the_name_of_the_lock(tmp_path):
    folder = tmp_path / "deep" / "out"
    other = f"from flexdrive_gym.files import only_writer\nwith only_writer({str(folder)!r}): pass"
    with only_writer(folder):
        second = subprocess.run([sys.executable, "-c", other], capture_output=True, text=True, check=False)
    assert second.returncode == 1
    assert "another run of flexdrive is writing into" in second.stderr
    assert str(folder / ".flexdrive.lock") in second.stderr
    # what was made for nothing is gone, and the next may write
    assert not list(tmp_path.iterdir())
    with only_writer(folder):
        (folder / "result").write_text("x")
    assert [p.name for p in folder.iterdir()] == ["result"]


def test_a_killed_writer_leaves_no_lock(tmp_path):
    begin = "import os\nfrom flexdrive_gym.files import only_writer\n"
    other = f"{begin}with only_writer({str(tmp_path)!r}): os.kill(os.getpid(), 9)"
    subprocess.run([sys.executable, "-c", other], check=False)
    assert (tmp_path / ".flexdrive.lock").exists()
    with only_writer(tmp_path):
        pass
    assert not list(tmp_path.iterdir())
