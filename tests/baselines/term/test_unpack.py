"""Archives that reach out, blow up, nest or break do no harm, and say why they are left out."""

import io
import stat
import zipfile
from pathlib import Path

import pytest

from baselines.term import unpack as module
from baselines.term.unpack import Budget, HandInError, unpack
from tests.each import each


def archive(path: Path, entries) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as made:
        for name, content in entries:
            made.writestr(name, content)
    return path


def inside(entries) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as made:
        for name, content in entries:
            made.writestr(name, content)
    return stream.getvalue()


@each("name", ["../out.csv", "a/../../out.csv", "/tmp/out.csv", "..\\out.csv", "C:\\out.csv"])
def test_an_entry_that_leaves_the_folder_refuses_the_whole_archive(tmp_path, name):
    made = archive(tmp_path / "a.zip", [("good.csv", "1"), (name, "2")])
    with pytest.raises(HandInError, match="must stay within the archive's folder; got"):
        unpack(made, tmp_path / "deep" / "out", Budget())
    assert not list(tmp_path.rglob("*.csv"))


def test_a_link_is_left_out(tmp_path):
    link = zipfile.ZipInfo("secret.csv")
    link.external_attr = (stat.S_IFLNK | 0o777) << 16
    made = archive(tmp_path / "a.zip", [(link, "/etc/passwd"), ("good.csv", "1")])
    unpack(made, tmp_path / "out", Budget())
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["good.csv"]


def test_bytes_are_counted_as_they_come_over_all_nested_archives(tmp_path):
    bomb = inside([("zeros.csv", bytes(3_000_000))])
    made = archive(tmp_path / "a.zip", [("one.zip", bomb), ("two.zip", bomb)])
    refused = unpack(made, tmp_path / "out", Budget(size=10_000_000))
    assert [name for name, _ in refused] == ["two.zip"]
    assert "must unpack to at most" in refused[0][1]
    assert not list((tmp_path / "out").glob("two*"))


def test_too_many_files_are_refused(tmp_path):
    made = archive(tmp_path / "a.zip", [(f"{i}.csv", "") for i in range(6)])
    with pytest.raises(HandInError, match="must hold at most"):
        unpack(made, tmp_path / "out", Budget(files=5))


def test_archives_lie_so_deep_and_no_deeper(tmp_path):
    content = inside([("run.csv", "1")])
    for _ in range(module.MOST_DEPTH - 1):
        content = inside([("again.zip", content)])
    (tmp_path / "a.zip").write_bytes(content)
    assert unpack(tmp_path / "a.zip", tmp_path / "out", Budget()) == []
    assert [p.name for p in (tmp_path / "out").rglob("*") if p.is_file()] == ["run.csv"]
    (tmp_path / "b.zip").write_bytes(inside([("again.zip", content)]))
    ((_, reason),) = unpack(tmp_path / "b.zip", tmp_path / "more", Budget())
    assert f"at most {module.MOST_DEPTH} deep" in reason


def test_a_damaged_archive_says_so(tmp_path):
    made = archive(tmp_path / "a.zip", [("run.csv", "1,2\n" * 9999)])
    made.write_bytes(made.read_bytes()[:-40])
    with pytest.raises(HandInError, match="must be a complete zip archive; got"):
        unpack(made, tmp_path / "out", Budget())


def test_only_what_may_be_read_is_written(tmp_path):
    names = ["run.csv", "rig.toml", "virus.exe", "__MACOSX/._run.csv", ".hidden.csv", "notes.docx", "data/run.mat"]
    unpack(archive(tmp_path / "a.zip", [(n, "") for n in names]), tmp_path / "out", Budget())
    assert sorted(p.name for p in (tmp_path / "out").rglob("*") if p.is_file()) == ["rig.toml", "run.csv", "run.mat"]
