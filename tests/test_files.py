"""Files are written whole or not at all."""

import pytest

from flexdrive_gym.files import write_atomically, write_together


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


@pytest.mark.parametrize("there", [True, False])
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
