import gzip
import importlib.util
from datetime import datetime

import h5py
import numpy as np
import pytest

from identification.recordings import RecordingError, read_recordings
from identification.recordings.errors import NotARecordingError
from identification.recordings.files import read_tables
from tests.each import each
from tests.identification.recordings.logs import csv_text, velocity_log, write_csv


@pytest.fixture
def log():
    return velocity_log(seconds=0.3)


def check(table, log):
    assert table.labels == tuple(log)
    for found, wanted in zip(table.values, log.values(), strict=True):
        np.testing.assert_allclose(found, wanted, atol=1e-4)


@each("separator", [",", ";", "\t"])
def test_separators(tmp_path, log, separator):
    check(read_tables(write_csv(tmp_path / "a.csv", log, separator))[0], log)


def test_gzip(tmp_path, log):
    path = tmp_path / "a.csv.gz"
    path.write_bytes(gzip.compress(csv_text(log).encode()))
    check(read_tables(path)[0], log)


def test_comments_byte_order_mark_quotes_and_windows_line_ends(tmp_path, log):
    head, *rows = csv_text(log).splitlines()
    head = ",".join(f'"{name}"' for name in head.split(","))
    text = "\r\n".join(["# rig 3", "% Lab 3", "", head, *rows[:5], "# paused", *rows[5:], ""])
    (tmp_path / "a.CSV").write_bytes(b"\xef\xbb\xbf" + text.encode())
    check(read_tables(tmp_path / "a.CSV")[0], log)


def test_header_in_a_comment(tmp_path, log):
    np.savetxt(tmp_path / "a.csv", np.column_stack(list(log.values())), delimiter=",", header=",".join(log))
    check(read_tables(tmp_path / "a.csv")[0], log)


def test_decimal_comma(tmp_path, log):
    (tmp_path / "a.csv").write_text(csv_text(log, ";").replace(".", ","))
    check(read_tables(tmp_path / "a.csv")[0], log)


def test_latin_letters_in_unknown_names(tmp_path):
    (tmp_path / "a.csv").write_bytes("t,u,Größe\n0,1,2\n1,1,2\n".encode("cp1252"))
    assert read_tables(tmp_path / "a.csv")[0].labels == ("t", "u", "Größe")


def test_empty_cells_and_nan_are_missing_values(tmp_path):
    (tmp_path / "a.csv").write_text("t,u,v1\n0,1,\n1,NaN,3\n2, nan ,4\n")
    table = read_tables(tmp_path / "a.csv")[0]
    np.testing.assert_array_equal(table.values[1], [1.0, np.nan, np.nan])
    np.testing.assert_array_equal(table.values[2], [np.nan, 3.0, 4.0])


def test_trailing_separators_make_no_column(tmp_path):
    (tmp_path / "a.csv").write_text("t,u,v1,\n0,1,2,\n1,1,3,\n")
    assert read_tables(tmp_path / "a.csv")[0].labels == ("t", "u", "v1")


def test_without_a_header_the_columns_have_numbers(tmp_path):
    (tmp_path / "a.csv").write_text("0,1.5,0\n0.001,1.5,4.6592\n")
    table = read_tables(tmp_path / "a.csv")[0]
    assert table.labels == ("1", "2", "3")
    assert table.hints == ("no header, the first line is '0,1.5,0'",)
    np.testing.assert_array_equal(table.values[2], [0.0, 4.6592])


@each("name", ["a.csv", "a.txt", "a.dat", "a.TSV", "a.log", "a.asc", "a.txt.gz", "a.dat.gz"])
def test_every_extension_of_text(tmp_path, log, name):
    text = csv_text(log, "\t").encode()
    (tmp_path / name).write_bytes(gzip.compress(text) if name.endswith(".gz") else text)
    check(read_tables(tmp_path / name)[0], log)


@each(
    ("head", "separator", "comma"),
    [
        ("t_s u_V v1_mm_s v2_mm_s", " ", False),
        ("  t_s    u_V   v1_mm_s  v2_mm_s", "    ", False),
        ("t_s u_V v1_mm_s v2_mm_s", "  ", True),
        ("t_s\tu_V\tv1_mm_s\tv2_mm_s\t", "\t", True),
        ("t_s;u_V;v1_mm_s;v2_mm_s;", ";", True),
        ("Rig 3\nrecorded by group 7, Monday\n\nt_s,u_V,v1_mm_s,v2_mm_s", ",", False),
        ("# Rig 3; gain 0.5\n# t_s, u_V, v1_mm_s, v2_mm_s", ",", False),
    ],
)
def test_dialects(tmp_path, log, head, separator, comma):
    _, *rows = csv_text(log, separator).splitlines()
    end = separator if head.endswith((";", "\t")) else ""
    text = "\n".join([head, *((row.replace(".", ",") if comma else row) + end for row in rows)])
    (tmp_path / "a.txt").write_text(text)
    check(read_tables(tmp_path / "a.txt")[0], log)


def test_decimal_comma_in_quotes(tmp_path, log):
    head, *rows = csv_text(log, ";").splitlines()
    quoted = [
        ",".join(f'"{cell.replace(".", ",")}"' if "." in cell else f'"{cell},0"' for cell in row.split(";"))
        for row in rows
    ]
    (tmp_path / "a.csv").write_text("\n".join([head.replace(";", ","), *quoted]))
    check(read_tables(tmp_path / "a.csv")[0], log)


@each("units", ["s,V,mm/s,mm/s", "[s],[V],[mm/s],[mm/s]"])
def test_units_on_a_line_of_their_own(tmp_path, log, units):
    _, *rows = csv_text(log).splitlines()
    (tmp_path / "a.csv").write_text("\n".join(["t,u,v1,v2", units, *rows]))
    assert read_tables(tmp_path / "a.csv")[0].labels == ("t [s]", "u [V]", "v1 [mm/s]", "v2 [mm/s]")


def test_a_matlab_matrix_as_text(tmp_path, log):
    rows = np.column_stack(list(log.values()))
    lines = [" ".join(f"{cell:.6f}" for cell in row) for row in rows]
    head = "Sample time  Command  Speed 1  Speed 2\n"
    for name, text in (
        ("a.txt", head + "\n".join(f"[ {line} ;" if k == 0 else f"{line} ;" for k, line in enumerate(lines)) + " ]"),
        ("b.txt", "data = [" + "; ".join(lines) + "];"),
    ):
        (tmp_path / name).write_text(text)
        table = read_tables(tmp_path / name)[0]
        for found, wanted in zip(table.values, log.values(), strict=True):
            np.testing.assert_allclose(found, wanted, atol=1e-4)
    assert read_tables(tmp_path / "a.txt")[0].labels[1:] == ("Command", "Speed 1", "Speed 2")


def test_a_header_that_a_restarted_log_repeats_is_dropped(tmp_path, log):
    head, *rows = csv_text(log).splitlines()
    (tmp_path / "a.csv").write_text("\n".join([head, *rows[:7], head, *rows[7:]]))
    check(read_tables(tmp_path / "a.csv")[0], log)


def test_dates_as_time(tmp_path):
    stamps = [f"2025-11-20T11:21:24.{k:03d}" for k in range(5)]
    (tmp_path / "a.csv").write_text("time,u,v1\n" + "".join(f"{stamp},1.5,{k}\n" for k, stamp in enumerate(stamps)))
    t = read_tables(tmp_path / "a.csv")[0].values[0]
    np.testing.assert_allclose(t - t[0], 1e-3 * np.arange(5), atol=1e-6)
    assert t[0] == pytest.approx(1763637684.0)
    (tmp_path / "b.csv").write_text("time;u;v1\n11:21:24,000;1,5;0\n11:21:24,001;1,5;1\n")
    t = read_tables(tmp_path / "b.csv")[0].values[0]
    assert t[1] - t[0] == pytest.approx(1e-3)


@each("text", ["This folder holds the runs of group 7.\nAsk Kim.\n", "Gains tried: 0.05, 0.1\n2 of them failed\n"])
def test_notes_are_no_recording(tmp_path, text):
    (tmp_path / "README.txt").write_text(text)
    with pytest.raises(
        NotARecordingError, match=r"README.txt: file: must hold columns of numbers; got '.*'. Leave it out."
    ):
        read_tables(tmp_path / "README.txt")[0]


def test_binary_data_called_text(tmp_path):
    (tmp_path / "a.dat").write_bytes(bytes(range(256)) * 8)
    with pytest.raises(NotARecordingError, match="must be text; got bytes of value 0"):
        read_tables(tmp_path / "a.dat")[0]


def test_a_date_in_the_name(tmp_path, log):
    for name, date in (
        ("07-Feb-2025 09_20_49.txt", datetime(2025, 2, 7, 9, 20, 49)),
        ("run_2025-11-20_11-21.csv", datetime(2025, 11, 20, 11, 21)),
        ("20251120_112124.csv", datetime(2025, 11, 20, 11, 21, 24)),
        ("sine_2.5V_12.0Hz.csv", None),
        ("case_20259999_1.csv", None),
    ):
        assert read_tables(write_csv(tmp_path / name, log))[0].recorded == date


def test_parquet_is_read_as_the_same_log_in_text(tmp_path):
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow", reason="extra parquet is not installed")
    t = np.arange(200) * 1e-3
    frame = pandas.DataFrame({"t_s": t, "u_V": np.sin(t), "x1_mm": np.arange(200), "note": ["as found"] * 200})
    frame.to_parquet(tmp_path / "a.parquet")
    table = read_tables(tmp_path / "a.parquet")[0]
    found = dict(zip(table.labels, table.values, strict=True))
    for name in ("t_s", "u_V", "x1_mm"):
        np.testing.assert_allclose(found[name], frame[name], rtol=1e-12)


def test_parquet_with_a_clock_of_dates(tmp_path):
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow", reason="extra parquet is not installed")
    stamps = pandas.date_range("2025-11-20 11:21:24", periods=300, freq="1ms", tz="UTC")
    log = pandas.DataFrame({"u_V": np.where(np.arange(300) % 100 < 50, 1.0, -1.0), "v1_mm_s": np.arange(300.0)})
    log.set_index(stamps.rename("time")).to_parquet(tmp_path / "a.parquet")
    (run,) = read_recordings(tmp_path)
    assert run.n == 300
    # what a double leaves of seconds since 1970
    assert run.sample_time == pytest.approx(1e-3, rel=3e-4)
    assert run.recorded == datetime(2025, 11, 20, 11, 21, 24)


@each("share", [0.1, 0.5, 0.95])
def test_damaged_parquet_is_skipped_with_a_reason(tmp_path, share):
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow", reason="extra parquet is not installed")
    path = tmp_path / "a.parquet"
    pandas.DataFrame({"t_s": np.arange(100.0), "u_V": np.ones(100)}).to_parquet(path)
    whole = path.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(RecordingError, match=r"a\.parquet.*complete parquet file"):
        read_tables(path)[0]


def test_parquet_needs_its_package(tmp_path, monkeypatch):
    (tmp_path / "a.parquet").write_bytes(b"PAR1")
    monkeypatch.setattr(importlib.util, "find_spec", lambda _name: None)
    with pytest.raises(RecordingError, match=r"needs the package pyarrow .*pip install pyarrow"):
        read_tables(tmp_path / "a.parquet")[0]


@each("text", ["", "\n\n", "# only a comment\n"])
def test_empty_file(tmp_path, text):
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(RecordingError, match="must hold a header and samples"):
        read_tables(tmp_path / "a.csv")[0]


def test_header_without_samples(tmp_path):
    (tmp_path / "a.csv").write_text("t,u,v1\n")
    with pytest.raises(RecordingError, match="must hold samples below the header"):
        read_tables(tmp_path / "a.csv")[0]


def test_text_in_a_column_names_column_and_sample(tmp_path):
    (tmp_path / "a.csv").write_text("t,u,v1\n0,1,2\n1,oops,2\n")
    with pytest.raises(RecordingError, match="column u: must hold numbers; got 'oops' at sample 2. Remove that line"):
        read_tables(tmp_path / "a.csv")[0]


def test_words_in_an_unknown_column_do_no_harm(tmp_path):
    (tmp_path / "a.csv").write_text("t,u,v1,state\n0,1,2,run\n1,1,3,\n")
    table = read_tables(tmp_path / "a.csv")[0]
    np.testing.assert_array_equal(table.values[2], [2.0, 3.0])
    assert np.isnan(table.values[3]).all()


def test_line_with_too_many_values(tmp_path):
    (tmp_path / "a.csv").write_text("t,u,v1\n0,1,2\n1,1,2,9,9\n")
    with pytest.raises(RecordingError, match="every line must have the 3 values of the header"):
        read_tables(tmp_path / "a.csv")[0]


def test_truncated_gzip(tmp_path, log):
    path = tmp_path / "a.csv.gz"
    path.write_bytes(gzip.compress(csv_text(log).encode())[:200])
    with pytest.raises(RecordingError, match="must be complete gzip data"):
        read_tables(path)[0]


def test_text_that_is_called_gzip(tmp_path, log):
    path = write_csv(tmp_path / "a.csv.gz", log)
    with pytest.raises(RecordingError, match="must be complete gzip data"):
        read_tables(path)[0]


@each("suffix", ["npz", "h5"])
def test_arrays_of_other_programs_are_read_as_a_workspace(tmp_path, log, suffix):
    path = tmp_path / f"a.{suffix}"
    if suffix == "npz":
        np.savez(path, **log, config=np.array({"gain": 2.0}, dtype=object), Kp=3.0)
    else:
        with h5py.File(path, "w") as file:
            for name, values in log.items():
                file[f"run/{name}"] = values
            file.attrs["operator"] = "A"
            file["notes"] = "first try"
    table = read_tables(path)[0]
    assert table.labels == tuple(log)
    for values, wanted in zip(table.values, log.values(), strict=True):
        np.testing.assert_array_equal(values, wanted)


@each("suffix", ["npz", "h5"])
def test_damaged_arrays_are_skipped_with_a_reason(tmp_path, suffix):
    path = tmp_path / f"a.{suffix}"
    for content in (b"PK\x03\x04", b"\x89HDF\r\n\x1a\n", b"t,u\n"):
        path.write_bytes(content)
        with pytest.raises(RecordingError, match="must be a complete"):
            read_tables(path)[0]


def workbook(path, **sheets):
    openpyxl = pytest.importorskip("openpyxl", reason="extra excel is not installed")
    book = openpyxl.Workbook()
    book.remove(book.active)
    for name, rows in sheets.items():
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append(row)
    book.save(path)
    return path


def test_a_spreadsheet_is_read_as_the_same_log_in_text(tmp_path, log):
    rows = [["Lab 3", None], ["recorded by", "A"], [], list(log), *zip(*log.values(), strict=True)]
    path = workbook(tmp_path / "a.xlsx", notes=[["what", "why"]], run=[[None, *row] for row in rows])
    table = read_tables(path)[0]
    assert table.labels == tuple(log)
    assert not table.notes
    for values, wanted in zip(table.values, log.values(), strict=True):
        np.testing.assert_allclose(values, wanted, rtol=1e-14)


def test_every_sheet_with_numbers_is_a_table(tmp_path, log):
    rows = [list(log), *zip(*log.values(), strict=True)]
    tables = read_tables(workbook(tmp_path / "a.xlsx", one=rows, notes=[["what", "why"]], two=rows))
    assert [t.part for t in tables] == ["one", "two"]
    assert all(t.labels == tuple(log) for t in tables)


@each("sheets", [("run 1", "run 2"), ("run 1",), ("run-1", "run 1"), ("2", "a b", "a_b")])
def test_every_sheet_that_is_a_recording_is_one(tmp_path, log, sheets):
    """A sheet of numbers that is none is left out with its reason, and does not change a name."""
    logs = [{n: (1.0 if n == "t_s" else k + 1.0) * np.asarray(v) for n, v in log.items()} for k in range(len(sheets))]
    runs = {n: [list(own), *zip(*own.values(), strict=True)] for n, own in zip(sheets, logs, strict=True)}
    path = workbook(tmp_path / "a.xlsx", masses=[["m1", "m2"], [0.5, 0.3], [0.5, 0.3], [0.5, 0.3]], **runs)
    found = read_recordings(path)
    names = {("run 1", "run 2"): ["a_run_1", "a_run_2"], ("run 1",): ["a"]}.get(
        sheets, ["a_1", "a_2", "a_3"][: len(sheets)]
    )
    assert [r.name for r in found] == names
    for r, own in zip(found, logs, strict=True):
        np.testing.assert_allclose(r.in_rig_units().u, own["u_V"], rtol=1e-12)
        assert any(note.startswith("warning: sheet 'masses' is left out: ") for note in r.notes)


def test_a_sheet_with_a_cell_that_is_no_number_is_said_to_be_left_out(tmp_path, log):
    rows = [list(log), *zip(*log.values(), strict=True)]
    bad = [*rows[:50], ("t", *rows[50][1:-1], "2 ??"), *rows[51:]]
    (table,) = read_tables(workbook(tmp_path / "a.xlsx", good=rows, bad=bad, empty=[], words=[["what", "why"]]))
    (note,) = table.notes
    assert note.startswith("warning: sheet 'bad' is left out: column ")
    assert "2 ??" in note or "'t'" in note


def test_a_sheet_that_repeats_another_is_named(tmp_path, log):
    rows = [list(log), *zip(*log.values(), strict=True)]
    found = read_recordings(workbook(tmp_path / "a.xlsx", one=rows, two=rows))
    assert [r.name for r in found] == ["a_one"]
    assert [s.reason for s in found.skipped] == ["a_two is the same run as a_one"]


def test_a_spreadsheet_needs_its_package(tmp_path, monkeypatch):
    (tmp_path / "a.xlsx").write_bytes(b"PK")
    monkeypatch.setattr(importlib.util, "find_spec", lambda _name: None)
    with pytest.raises(RecordingError, match="needs the package openpyxl"):
        read_tables(tmp_path / "a.xlsx")[0]


@each(("name", "hint"), [("a.cvs", "Did you mean .csv"), ("a.xlsx", "Export the log as .csv"), ("a", "got none")])
def test_unknown_extension(tmp_path, name, hint):
    (tmp_path / name).write_text("t,u\n")
    with pytest.raises(RecordingError, match=hint):
        read_tables(tmp_path / name)[0]


def test_line_with_one_value_too_many(tmp_path):
    (tmp_path / "a.csv").write_text("t,u,v1\n0,1,2\n1,1,2,9\n")
    with pytest.raises(RecordingError, match="got values beyond the last column"):
        read_tables(tmp_path / "a.csv")[0]


def test_a_line_cut_short_misses_its_last_values(tmp_path):
    (tmp_path / "a.csv").write_text("t,u,v1\n0,1,2\n1,1\n")
    np.testing.assert_array_equal(read_tables(tmp_path / "a.csv")[0].values[2], [2.0, np.nan])
