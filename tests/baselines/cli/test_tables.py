"""Tables fit the terminal, and no number or word is broken whatever its width."""

import pytest
from typer.testing import CliRunner

from baselines.cli import _output, app
from baselines.cli._tables import laid_out, wrapped_sentence
from flexdrive_gym import DEFAULT_DRIVE, Covariance, Drive, save_drive
from identification import write_recording
from tests.each import each
from tests.identification.mismatch.lab import T, data_set

WIDTHS = (60, 80, 140)
WIDE = (
    ["controller", "rms e [mm]", "settling [s]", "95 % interval", "overshoot [%]", "vibration [V mm]", "rejection [V/mm]"],
    [["p_x2", "10.07", "–", "0.0818 … 0.1129", "12.5", "0.34", "0.1791 (0.18)"],
     ["ml_identified_by_hand", "1.234e-05", "0.5", "0.1 … 0.2", "–", "12", ""]],
)  # fmt: skip


def words(sheets):
    return {word for sheet in sheets for line in sheet if not line.startswith("─") for word in line.split()}


@each("width", [40, *WIDTHS])
def test_a_wide_table_is_split_and_every_sheet_names_its_rows(width):
    sheets = laid_out(*WIDE, width)
    assert max(len(line) for sheet in sheets for line in sheet) <= width
    assert words(sheets) == words(laid_out(*WIDE, 1000))
    assert len(laid_out(*WIDE, 1000)) == 1
    for sheet in sheets:
        assert sheet[0].startswith("controller")
        assert sum(line.startswith("p_x2") for line in sheet) == 1
    # an interval is one thing
    assert any("0.0818 … 0.1129" in line for sheet in sheets for line in sheet)


def test_a_remark_moves_below_its_row():
    rows = [["pctrl_x2_kp0.2345_critical", "encoder_1", "0.264", "about 2.72 mm lost by the speeds at the freeze's edges"],
            ["sine_2.5V_0.5Hz", "encoder_1", "0.677", ""]]  # fmt: skip
    (sheet,) = laid_out(["recording", "where", "from [s]", "note"], rows, 60)
    assert max(map(len, sheet)) <= 60
    assert sheet[1] == "    note"
    assert sheet[3] == "pctrl_x2_kp0.2345_critical  encoder_1     0.264"
    assert sheet[4] == "    about 2.72 mm lost by the speeds at the freeze's edges"
    assert sheet[5].startswith("sine_2.5V_0.5Hz")


def test_rows_of_one_name_are_told_apart_by_the_second_column():
    sheets = laid_out(["stage", "limit [V]", *(f"measure {i}" for i in range(12))],
                      [["lab4", limit, *["1.234567"] * 12] for limit in ("4", "8")], 60)  # fmt: skip
    assert len(sheets) > 1
    assert all(sheet[-1].split()[:2] == ["lab4", "8"] for sheet in sheets)


def test_a_sentence_is_wrapped_between_words():
    text = "- rms 7.61 mm/s over 255057 samples: /a/path/that/is/longer/than/the/terminal/is/wide.toml"
    shown = wrapped_sentence(text, 40).split("\n")
    assert " ".join(shown).split() == text.split()
    assert shown[0].startswith("- rms")
    assert all(line.startswith("  ") for line in shown[1:])
    assert wrapped_sentence("", 40) == ""


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    base = tmp_path_factory.mktemp("lab")
    for run in data_set(t=T[:2001]):
        write_recording(run, base / "recordings" / f"{run.name}.csv")
    spread = Covariance(("k",), [[1e-6]])
    save_drive(Drive(DEFAULT_DRIVE.values, covariance=spread, name="a rig of the winter"), base / "drive.toml")
    return base


@pytest.mark.parametrize(
    "arguments",
    [
        ["identify", "recordings", "-o", "found.toml", "--no-compare-tied"],
        ["identify", "recordings", "-o", "found.toml", "--method", "handout"],
        ["validate", "drive.toml", "recordings"],
        ["stability", "drive.toml", "--draws", "0"],
        pytest.param(["design", "drive.toml"], marks=pytest.mark.slow),
        ["experiment", "drive.toml", "-o", "day", "--frequency", "1", "--square", "1.5"],
        ["compare", "drive.toml", "-c", "p_x2,lab4", "-a", "x2-0", "-r", "sine,prbs", "--no-effects", "--draws", "2",
         "--no-empirical"],
    ],
    ids=lambda a: " ".join(a[:1]),
)  # fmt: skip
def test_every_command_fits_the_terminal(place, arguments, monkeypatch):
    monkeypatch.chdir(place)
    asked = []

    def noted(columns, rows, width):
        rows = [list(row) for row in rows]
        asked.append((columns, rows))
        return laid_out(columns, rows, width)

    monkeypatch.setattr(_output, "laid_out", noted)
    result = CliRunner().invoke(app, arguments, env={"COLUMNS": "80"}, catch_exceptions=False)
    assert result.exit_code == 0, result.output
    assert asked
    # of one word that is longer than the terminal no line can be shorter
    assert all(len(line) <= 80 or len(line.split()) <= 2 for line in result.output.splitlines())
    for columns, rows in asked:
        for width in WIDTHS:
            sheets = laid_out(columns, rows, width)
            assert max(len(line) for sheet in sheets for line in sheet) <= width, columns
            assert words(sheets) == words(laid_out(columns, rows, 1000))
