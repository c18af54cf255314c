import pytest

from identification.recordings import RecordingError
from identification.recordings.columns import (
    assign_columns,
    only_reference,
    recognise_column,
    require_columns,
)


@pytest.mark.parametrize(
    ("label", "signal", "factor"),
    [
        ("t", "t", 1.0),
        ("t_s", "t", 1.0),
        ("t [sec]", "t", 1.0),
        ("time", "t", 1.0),
        ("Time (s)", "t", 1.0),
        ("t / s", "t", 1.0),
        ("t_ms", "t", 1e-3),
        ("TIME [us]", "t", 1e-6),
        ("u", "u", 1.0),
        ("u_V", "u", 1.0),
        ("u [V]", "u", 1.0),
        ("U_mV", "u", 1e-3),
        ("voltage", "u", 1.0),
        ("command", "u", 1.0),
        ("input", "u", 1.0),
        ("x1_mm", "x1", 1.0),
        ("x1 (m)", "x1", 1000.0),
        ("x_1", "x1", 1.0),
        ("q_m", "x1", 1000.0),
        ("position", "x1", 1.0),
        ("position2", "x2", 1.0),
        ("Position 2 [cm]", "x2", 10.0),
        ("v1_mm_s", "v1", 1.0),
        ("v1 [mm/sec]", "v1", 1.0),
        ("v1 []", "v1", 1.0),
        ("v2_m_s", "v2", 1000.0),
        ("v2 [m s^-1]", "v2", 1000.0),
        ("velocity1", "v1", 1.0),
        ("cart2 velocity [cm/s]", "v2", 10.0),
        ("xr", "xr", 1.0),
        ("ref", "xr", 1.0),
        ("reference", "xr", 1.0),
        ("x1_ref", "xr", 1.0),
        ("qref_m", "xr", 1000.0),
    ],
)
def test_names_and_units_that_labs_use(label, signal, factor):
    column = recognise_column(label)
    assert column is not None
    assert (column.signal, column.factor) == (signal, factor)


@pytest.mark.parametrize("label", ["speed_ticks_s", "y_V", "v", "x3", "temperature [C]", "", "flag"])
def test_other_names_are_unknown(label):
    assert recognise_column(label) is None


def test_ms_is_a_millisecond_of_time_but_a_metre_per_second_of_velocity():
    assert recognise_column("t [ms]").factor == 1e-3
    assert recognise_column("v1 [ms]").factor == 1000.0


def test_unknown_unit_of_a_known_signal_is_refused():
    with pytest.raises(RecordingError, match=r"log.csv: column v1 \[ticks/s\]: the unit .* mm/s; got ticks/s"):
        recognise_column("v1 [ticks/s]", "log.csv")


def test_a_signal_that_is_missing_but_for_its_unit_is_named():
    labels = ["t_s", "u_V", "v1_furlong_s"]
    columns, _ = assign_columns(labels, "log.csv")
    with pytest.raises(RecordingError, match=r"column v1_furlong_s: the unit .* velocity, .* got furlong_s"):
        require_columns(columns.values(), labels, "log.csv")


def test_two_columns_of_one_signal_are_refused():
    with pytest.raises(RecordingError, match="column position1: each signal may appear once; got x1_mm and"):
        assign_columns(["t", "u", "x1_mm", "position1"], "log.csv")


def test_unknown_columns_are_named_in_a_note():
    columns, notes = assign_columns(["t", "flag", "u", "v1", "gain"], "log.csv")
    assert [column.signal for column in columns.values()] == ["t", "u", "v1"]
    assert list(columns) == [0, 2, 3]
    assert notes == ("columns ignored: flag, gain",)


@pytest.mark.parametrize(
    ("labels", "missing"),
    [
        (["u", "v1"], "must contain time"),
        (["t", "v1"], "must contain the command"),
        (["t", "u", "flow_l_s"], "must contain at least one of x1, x2, v1, v2; got columns t, u, flow_l"),
    ],
)
def test_time_command_and_a_measurement_are_required(labels, missing):
    columns, _ = assign_columns(labels, "log.csv")
    with pytest.raises(RecordingError, match=missing):
        require_columns(columns.values(), labels, "log.csv")


def test_a_near_name_is_suggested():
    with pytest.raises(RecordingError, match="Is xl_mm meant"):
        require_columns(assign_columns(["t", "u", "xl_mm"], "a")[0].values(), ["t", "u", "xl_mm"], "a")


def test_time_and_reference_alone_are_a_trajectory():
    assert only_reference(assign_columns(["t_s", "xr_mm", "flag"], "a")[0].values())
    assert not only_reference(assign_columns(["t_s", "u", "xr_mm"], "a")[0].values())
