import gzip

import numpy as np
import pytest

from identification.recordings import RecordingError
from identification.recordings.files import read_table
from tests.identification.recordings.logs import csv_text, velocity_log, write_csv


@pytest.fixture
def log():
    return velocity_log(seconds=0.3)


def check(table, log):
    assert table.labels == tuple(log)
    for found, wanted in zip(table.values, log.values(), strict=True):
        np.testing.assert_allclose(found, wanted, atol=1e-4)


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_separators(tmp_path, log, separator):
    check(read_table(write_csv(tmp_path / "a.csv", log, separator)), log)


def test_gzip(tmp_path, log):
    path = tmp_path / "a.csv.gz"
    path.write_bytes(gzip.compress(csv_text(log).encode()))
    check(read_table(path), log)


def test_comments_byte_order_mark_quotes_and_windows_line_ends(tmp_path, log):
    head, *rows = csv_text(log).splitlines()
    head = ",".join(f'"{name}"' for name in head.split(","))
    text = "\r\n".join(["# rig 3", "% Lab 3", "", head, *rows[:5], "# paused", *rows[5:], ""])
    (tmp_path / "a.CSV").write_bytes(b"\xef\xbb\xbf" + text.encode())
    check(read_table(tmp_path / "a.CSV"), log)


def test_header_in_a_comment(tmp_path, log):
    np.savetxt(tmp_path / "a.csv", np.column_stack(list(log.values())), delimiter=",", header=",".join(log))
    check(read_table(tmp_path / "a.csv"), log)


def test_decimal_comma(tmp_path, log):
    (tmp_path / "a.csv").write_text(csv_text(log, ";").replace(".", ","))
    check(read_table(tmp_path / "a.csv"), log)


def test_latin_letters_in_unknown_names(tmp_path):
    (tmp_path / "a.csv").write_bytes("t,u,Größe\n0,1,2\n1,1,2\n".encode("cp1252"))
    assert read_table(tmp_path / "a.csv").labels == ("t", "u", "Größe")


def test_empty_cells_and_nan_are_missing_values(tmp_path):
    (tmp_path / "a.csv").write_text("t,u,v1\n0,1,\n1,NaN,3\n2, nan ,4\n")
    table = read_table(tmp_path / "a.csv")
    np.testing.assert_array_equal(table.values[1], [1.0, np.nan, np.nan])
    np.testing.assert_array_equal(table.values[2], [np.nan, 3.0, 4.0])


def test_trailing_separators_make_no_column(tmp_path):
    (tmp_path / "a.csv").write_text("t,u,v1,\n0,1,2,\n1,1,3,\n")
    assert read_table(tmp_path / "a.csv").labels == ("t", "u", "v1")


def test_headerless_file_names_the_remedy(tmp_path):
    (tmp_path / "a.csv").write_text("0,1.5,0\n0.001,1.5,4.6592\n")
    with pytest.raises(RecordingError, match=r"a.csv: header: .* name the columns; got '0,1.5,0'. Add a header"):
        read_table(tmp_path / "a.csv")


@pytest.mark.parametrize("text", ["", "\n\n", "# only a comment\n"])
def test_empty_file(tmp_path, text):
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(RecordingError, match="must hold a header and samples"):
        read_table(tmp_path / "a.csv")


def test_header_without_samples(tmp_path):
    (tmp_path / "a.csv").write_text("t,u,v1\n")
    with pytest.raises(RecordingError, match="must hold samples below the header"):
        read_table(tmp_path / "a.csv")


def test_text_in_a_column_names_column_and_sample(tmp_path):
    (tmp_path / "a.csv").write_text("t,u,v1\ns,V,mm/s\n0,1,2\n")
    with pytest.raises(RecordingError, match="column t: must hold numbers; got 's' at sample 1. Remove that line"):
        read_table(tmp_path / "a.csv")


def test_words_in_an_unknown_column_do_no_harm(tmp_path):
    (tmp_path / "a.csv").write_text("t,u,v1,state\n0,1,2,run\n1,1,3,\n")
    table = read_table(tmp_path / "a.csv")
    np.testing.assert_array_equal(table.values[2], [2.0, 3.0])
    assert np.isnan(table.values[3]).all()


def test_line_with_too_many_values(tmp_path):
    (tmp_path / "a.csv").write_text("t,u,v1\n0,1,2\n1,1,2,9,9\n")
    with pytest.raises(RecordingError, match="every line must have the 3 values of the header"):
        read_table(tmp_path / "a.csv")


def test_truncated_gzip(tmp_path, log):
    path = tmp_path / "a.csv.gz"
    path.write_bytes(gzip.compress(csv_text(log).encode())[:200])
    with pytest.raises(RecordingError, match="must be complete gzip data"):
        read_table(path)


def test_text_that_is_called_gzip(tmp_path, log):
    path = write_csv(tmp_path / "a.csv.gz", log)
    with pytest.raises(RecordingError, match="must be complete gzip data"):
        read_table(path)


@pytest.mark.parametrize(
    ("name", "hint"), [("a.cvs", "Did you mean .csv"), ("a.xlsx", "Export the log as .csv"), ("a", "got none")]
)
def test_unknown_extension(tmp_path, name, hint):
    (tmp_path / name).write_text("t,u\n")
    with pytest.raises(RecordingError, match=hint):
        read_table(tmp_path / name)


def test_line_with_one_value_too_many(tmp_path):
    (tmp_path / "a.csv").write_text("t,u,v1\n0,1,2\n1,1,2,9\n")
    with pytest.raises(RecordingError, match="got values beyond the last column"):
        read_table(tmp_path / "a.csv")


def test_a_line_cut_short_misses_its_last_values(tmp_path):
    (tmp_path / "a.csv").write_text("t,u,v1\n0,1,2\n1,1\n")
    np.testing.assert_array_equal(read_table(tmp_path / "a.csv").values[2], [2.0, np.nan])
