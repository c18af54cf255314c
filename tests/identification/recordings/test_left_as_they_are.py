"""Files as their owners left them: what other programs write around the numbers, and what must not be misread in silence."""

import numpy as np
import pytest
import scipy.io

from identification.recordings import RecordingError, read_recordings
from identification.recordings.rig import parse_rig
from identification.recordings.sentinels import sentinel
from identification.recordings.wraps import unwrapped
from tests.each import each
from tests.identification.recordings.logs import csv_text, position_log

NAMES = ["t", "u", "x1", "x2"]


@pytest.fixture(scope="module")
def log():
    full = position_log()
    return {name: full[key] for name, key in zip(NAMES, ("t_s", "u_V", "x1_mm", "x2_mm"), strict=True)}


def named(log, *names):
    return dict(zip(names, log.values(), strict=True))


def read(folder, text, rig=""):
    (folder / "run.csv").write_text(text)
    (run,) = read_recordings(folder, rig=parse_rig(rig) if rig else None)
    return run


def with_stamps(log, name, stamps):
    """Return a log whose first column is replaced by stamps, in all their digits."""
    head, *rows = csv_text(dict(list(log.items())[1:])).splitlines()
    return "\n".join([f"{name},{head}", *(f"{t},{r}" for t, r in zip(stamps, rows, strict=True))])


def check(run, log, x1=1.0, x2=1.0):
    assert run.u == pytest.approx(log["u"], abs=1e-4)
    assert run.x1 == pytest.approx(x1 * log["x1"], abs=1e-4 * x1)
    assert run.x2 == pytest.approx(x2 * log["x2"], abs=1e-4 * x2)


class TestWhatStandsAboveTheData:
    @each(
        "above",
        [
            "Lab 3\nKp,0.12\n",
            "Experiment: step\nKp: 0.12\nSample time: 0.001\n\n",
            "Date,2025-11-10,11:35\nSamples,4001,4001\nGain,0.1,0.2\n",
            "Samples,4001,4001,4001\nX0,0.0,0.0,0.0\nDelta_X,0.001,0.001,0.001\n***End_of_Header***,,,\n",
        ],
    )
    def test_settings_of_the_logger_are_no_data(self, tmp_path, log, above):
        check(read(tmp_path, above + csv_text(log)), log)

    @each("units", ["# units: s, V, cm, cm", "s,V,cm,cm", "[s],[V],[cm],[cm]"])
    def test_units_stand_above_the_names_or_below(self, tmp_path, log, units):
        head, *rows = csv_text(log).splitlines()
        for lines in ([units, head], [head, units]):
            check(read(tmp_path, "\n".join([*lines, *rows])), log, 10.0, 10.0)

    def test_data_begin_at_once_below_names_of_signals(self, tmp_path, log):
        rows = csv_text(log).splitlines()
        check(read(tmp_path, "\n".join([rows[0], *rows[1:]])), log)

    @each("below", ["END\n", "\nMax,2,110\nEnd of recording\n"])
    def test_remarks_below_the_data(self, tmp_path, log, below):
        check(read(tmp_path, csv_text(log) + below), log)

    @each("separator", [",", "\t", " "])
    def test_row_numbers_without_a_name(self, tmp_path, log, separator):
        head, *rows = csv_text(log, separator).splitlines()
        run = read(tmp_path, "\n".join([head, *(f'"{i}"{separator}{row}' for i, row in enumerate(rows, 1))]))
        check(run, log)

    def test_a_last_column_without_a_name_stays_the_last(self, tmp_path, log):
        head, *rows = csv_text(log).splitlines()
        check(read(tmp_path, "\n".join([head, *(f"{row},7" for row in rows)])), log)

    @each("separator", ["\t", ";"])
    def test_thousands_are_no_decimals(self, tmp_path, log, separator):
        micrometres = [f"{round(1e3 * x):,}".replace(",", "." if separator == ";" else ",") for x in log["x1"]]
        assert any(len(text) > 4 for text in micrometres)
        comma = "," if separator == ";" else "."
        rows = (
            separator.join([f"{t:.7g}".replace(".", comma), f"{u:.7g}".replace(".", comma), x])
            for t, u, x in zip(log["t"], log["u"], micrometres, strict=True)
        )
        run = read(tmp_path, "\n".join([separator.join(["t", "u", "x1_um"]), *rows]))
        assert run.x1 == pytest.approx(log["x1"], abs=1e-3)
        assert run.u == pytest.approx(log["u"], abs=1e-4)

    def test_commas_of_remarks_are_no_decimal_signs(self, tmp_path, log):
        rows = (
            f"{t:.7g}\t{u:.7g}\t{x:.3f}\tat {place}, by hand"
            for t, u, x, place in zip(log["t"], log["u"], log["x1"], "ab" * len(log["t"]), strict=False)
        )
        run = read(tmp_path, "\n".join(["t\tu\tx1\tremark", *rows]))
        assert run.x1 == pytest.approx(log["x1"], abs=1e-3)


class TestUnits:
    RIG = '[columns]\nt = "Zeit [ms]"\nu = "Spannung [V]"\nx1 = "Weg1 [cm]"\nx2 = "Weg2_m"\n'

    def test_a_named_column_keeps_the_unit_of_its_name(self, tmp_path, log):
        table = named(log, "Zeit [ms]", "Spannung [V]", "Weg1 [cm]", "Weg2_mm")
        table["Zeit [ms]"] = 1e3 * log["t"]
        run = read(tmp_path, csv_text(table), self.RIG.replace("Weg2_m", "Weg2_mm"))
        assert run.sample_time == pytest.approx(1e-3)
        check(run, log, x1=10.0)

    def test_the_m_of_a_motor_is_no_metre(self, tmp_path, log):
        table = named(log, "t", "u", "phi_m", "phi_l")
        check(read(tmp_path, csv_text(table), '[columns]\nx1 = "phi_m"\nx2 = "phi_l"\n'), log)

    def test_a_sum_keeps_the_unit_of_its_columns(self, tmp_path, log):
        table = named(log, "t", "u", "a_cm", "b_cm")
        run = read(tmp_path, csv_text(table), '[columns]\nx1 = "a_cm"\nx2 = "a_cm + b_cm"\n')
        assert run.x2 == pytest.approx(10.0 * (log["x1"] + log["x2"]), abs=1e-2)

    def test_a_sum_has_one_unit(self, tmp_path, log):
        table = named(log, "t", "u", "a_cm", "b_mm")
        with pytest.raises(RecordingError, match="'a_cm - b_mm' must be a sum of one unit; got cm, mm"):
            read(tmp_path, csv_text(table), '[columns]\nx1 = "a_cm"\nx2 = "a_cm - b_mm"\n')

    def test_remarks_in_brackets_are_no_units(self, tmp_path, log):
        table = named(log, "t", "u", "Encoder A (left)", "Encoder B (right)")
        check(read(tmp_path, csv_text(table), '[columns]\nx1 = "Encoder A (left)"\nx2 = "Encoder B (right)"\n'), log)

    def test_an_angle_is_no_length(self, tmp_path, log):
        table = named(log, "t", "u", "theta1 [deg]", "x2")
        with pytest.raises(RecordingError, match=r'got deg\..*unit = "deg"'):
            read(tmp_path, csv_text(table), '[columns]\nx1 = "theta1 [deg]"\n')

    def test_the_rig_s_unit_is_not_the_column_s(self, tmp_path, log):
        check(read(tmp_path, csv_text(named(log, "t", "u", "x1_cm", "x2_mm")), '[units]\nx1 = "mm"\n'), log, x1=10.0)

    def test_a_factor_holds_whatever_the_name_says(self, tmp_path, log):
        rig = '[units]\nx1 = { unit = "mm", factor = 2.0 }\n'
        check(read(tmp_path, csv_text(named(log, "t", "u", "x1_cm", "x2_mm")), rig), log, x1=2.0)

    def test_what_is_said_of_a_unit_that_contradicts(self, tmp_path, log):
        run = read(tmp_path, csv_text(named(log, "t", "u_V", "x1", "x2")), '[units]\nu = "N m"\n')
        assert "u_V: the name says V, rig.toml N m, which holds" in run.notes

    def test_a_duty_without_a_unit_is_doubted(self, tmp_path, log):
        run = read(tmp_path, csv_text(named(log, "t", "duty", "x1", "x2")))
        assert any(note.startswith("warning: duty says no unit") for note in run.notes)

    @each("unit", [("microseconds", 1e6), ("nanoseconds", 1e9)])
    def test_small_units_of_time(self, tmp_path, log, unit):
        name, per_second = unit
        run = read(tmp_path, csv_text({**log, "t": np.round(per_second * log["t"])}).replace("e+", "e"))
        assert run.sample_time == pytest.approx(1e-3)
        assert f"warning: the time column has no unit; its stamps are read as {name}" in run.notes

    def test_days_stand_before_months_where_dots_part_them(self, tmp_path, log):
        stamps = [f"10.11.2025 11:35:{t:09.6f}" for t in log["t"]]
        rows = (f"{s};{u:.7g};{x:.7g}" for s, u, x in zip(stamps, log["u"], log["x1"], strict=True))
        assert read(tmp_path, "\n".join(["t;u;x1", *rows])).recorded.month == 11


class TestWhichColumn:
    @each("names", [("x0", "x1"), ("pos0_mm", "pos1_mm"), ("x[0]", "x[1]")])
    def test_carts_that_are_counted_from_zero(self, tmp_path, log, names):
        run = read(tmp_path, csv_text(named(log, "t", "u", *names)))
        check(run, log)
        assert any("counted from 0" in note for note in run.notes)

    @each("names", [("x(1)", "x(2)"), ("x[1]", "x[2]")])
    def test_numbers_in_brackets(self, tmp_path, log, names):
        check(read(tmp_path, csv_text(named(log, "t", "u", *names))), log)

    def test_where_a_cart_began_is_no_cart(self, tmp_path, log):
        run = read(tmp_path, csv_text({**log, "x0": np.zeros_like(log["t"])}))
        check(run, log)

    @each("name", ["u_sat", "u_applied"])
    def test_the_command_that_acts(self, tmp_path, log, name):
        limit = 0.5 * np.max(log["u"])
        run = read(tmp_path, csv_text({**log, name: np.clip(log["u"], -limit, limit)}))
        assert np.max(run.u) == pytest.approx(limit, rel=1e-5)
        assert f"{name} is read as the command, u as what was asked for" in run.notes

    @each("values", [lambda u: np.full_like(u, 5.0), lambda u: (np.abs(u) > 1.0) * 1.0])
    def test_a_limit_or_a_flag_is_no_command(self, tmp_path, log, values):
        check(read(tmp_path, csv_text({**log, "u_sat": values(log["u"])})), log)

    def test_an_empty_column_stops_no_file(self, tmp_path, log):
        run = read(tmp_path, csv_text({**log, "xr": np.full_like(log["t"], np.nan)}))
        check(run, log)
        assert "no value of xr: left out" in run.notes

    @each(
        "names",
        [
            ("Zeit [ms]", "Spannung [mV]", "Weg 1 [cm]", "Weg 2 [cm]"),
            ("Temps (s)", "Courant (A)", "Chariot 1 (mm)", "Chariot 2 (mm)"),
            ("Zeit in s", "Stellgröße in V", "Weg1 in mm", "Weg2 in mm"),
            ("時間[s]", "電圧[V]", "位置1[mm]", "位置2[mm]"),
        ],
    )
    def test_unknown_names_are_told_by_their_units(self, tmp_path, log, names):
        lines = [f'{role} = "{name}"' for role, name in zip(("t", "u", "x1", "x2"), names, strict=True)]
        table = named(log, *names)
        table[names[0]] = (1e3 if "ms" in names[0] else 1.0) * log["t"]
        text = csv_text(table)
        with pytest.raises(RecordingError) as caught:
            read(tmp_path, text)
        assert "; ".join(lines) in str(caught.value)
        rig = "[columns]\n" + "\n".join(lines) + ('\n[units]\nu = "A"\n' if "(A)" in names[1] else "\n")
        assert read(tmp_path, text, rig).n > 100

    def test_units_after_in(self, tmp_path, log):
        check(read(tmp_path, csv_text(named(log, "Time in s", "u in V", "x1 in cm", "x2 in mm"))), log, x1=10.0)


class TestGapsInWhichTheCommandChanges:
    def test_the_longest_piece_is_read(self, tmp_path, log):
        square = {**log, "u": np.sign(np.sin(np.pi * log["t"] + 1e-9))}
        kept = (log["t"] < 0.999) | (log["t"] > 1.03)
        run = read(tmp_path, csv_text({name: values[kept] for name, values in square.items()}))
        assert run.t[-1] - run.t[0] == pytest.approx(log["t"][-1] - 1.031, abs=2e-3)
        assert any("the command changes in gaps" in note for note in run.notes)

    def test_a_gap_in_which_it_does_not_is_bridged(self, tmp_path, log):
        square = {**log, "u": np.sign(np.sin(np.pi * log["t"] + 1e-9))}
        kept = (log["t"] < 1.4) | (log["t"] > 1.43)
        run = read(tmp_path, csv_text({name: values[kept] for name, values in square.items()}))
        assert run.n == len(log["t"])

    def test_a_smooth_command_goes_on_in_a_short_gap(self, tmp_path, log):
        sine = {**log, "u": 2.0 * np.sin(2.0 * np.pi * log["t"])}
        kept = np.ones(len(log["t"]), dtype=bool)
        kept[1000:1006] = False
        run = read(tmp_path, csv_text({name: values[kept] for name, values in sine.items()}))
        assert run.u == pytest.approx(sine["u"], abs=1e-3)


class TestSeveralExperimentsInOneFile:
    @each("begin", [lambda end: 0.0, lambda end: end + 3.0])
    def test_each_is_a_recording(self, tmp_path, log, begin):
        other = {name: -values for name, values in log.items()}
        again = {**other, "t": begin(log["t"][-1]) + log["t"]}
        (tmp_path / "day.csv").write_text(csv_text(log) + "".join(csv_text(again).splitlines(keepends=True)[1:]))
        first, second = read_recordings(tmp_path)
        assert [first.name, second.name] == ["day_1", "day_2"]
        assert "experiment 2 of 2 in day.csv" in second.notes
        check(first, log)
        assert second.x1 == pytest.approx(other["x1"], abs=1e-4)

    def test_none_takes_the_name_of_another_file(self, tmp_path, log):
        other = {**log, "x1": 0.5 * log["x1"], "x2": 0.5 * log["x2"]}
        (tmp_path / "day_1.csv").write_text(csv_text(other))
        again = {name: -values for name, values in log.items()} | {"t": log["t"]}
        (tmp_path / "day.csv").write_text(csv_text(log) + "".join(csv_text(again).splitlines(keepends=True)[1:]))
        assert sorted(r.name for r in read_recordings(tmp_path)) == ["day_1", "day_1_of_2", "day_2"]

    def test_a_log_that_lost_samples_is_one(self, tmp_path, log):
        kept = (log["t"] < 0.3) | (log["t"] > 0.9)
        (tmp_path / "run.csv").write_text(csv_text({name: values[kept] for name, values in log.items()}))
        assert len(read_recordings(tmp_path)) == 1


class TestWorkspaces:
    @each("name", ["x", "pos", "Position"])
    def test_both_carts_in_one_variable(self, tmp_path, log, name):
        both = np.column_stack([log["x1"], log["x2"]])
        scipy.io.savemat(tmp_path / "run.mat", {"t": log["t"], "u": log["u"], name: both})
        check(read_recordings(tmp_path)[0], log)

    @each("scalar", [("Ts", 1e-3), ("fs", 1000.0)])
    def test_a_sampling_period_tells_the_time(self, tmp_path, log, scalar):
        name, value = scalar
        scipy.io.savemat(tmp_path / "run.mat", {name: value, "u": log["u"], "x1": log["x1"], "x2": log["x2"]})
        (run,) = read_recordings(tmp_path)
        check(run, log)
        assert run.sample_time == pytest.approx(1e-3)
        assert f"time is counted: {name} = {value:g}" in run.notes

    def test_a_matrix_with_its_own_clock_stays_one_signal(self, tmp_path, log):
        own = np.column_stack([log["t"], log["x1"]])
        scipy.io.savemat(tmp_path / "run.mat", {"t": log["t"], "u": log["u"], "x": own})
        (run,) = read_recordings(tmp_path)
        assert run.x2 is None
        assert run.x1 == pytest.approx(log["x1"], abs=1e-4)


class TestCountersThatBeginAgain:
    @each("clock", [("t_s", 86400.0, 1.0), ("t_us", 2.0**32, 1e6), ("t_ms", 2.0**32, 1e3)])
    def test_clocks_go_on(self, tmp_path, log, clock):
        name, period, per_second = clock
        stamps = (period - 2.0 * per_second + per_second * log["t"]) % period
        run = read(tmp_path, with_stamps(log, name, [f"{t:.4f}" for t in stamps]))
        check(run, log)
        assert any("goes round" in note for note in run.notes)

    @each("begin", [1000.0, 5000.0, 20000.0])
    def test_a_clock_of_single_precision_is_even(self, tmp_path, log, begin):
        stamps = (log["t"] + begin).astype(np.float32)
        run = read(tmp_path, with_stamps(log, "t", [f"{t:.9g}" for t in stamps]))
        assert run.n == log["t"].size
        assert np.diff(run.t) == pytest.approx(log["t"][1], rel=1e-6)
        check(run, log)

    def test_two_clocks_may_tell_the_same(self, tmp_path, log):
        own = {"t_s" if name == "t" else name: values for name, values in log.items()}
        run = read(tmp_path, with_stamps({"": None, **own}, "timestamp", [f"{1.7e9 + t:.4f}" for t in log["t"]]))
        assert run.t == pytest.approx(log["t"], abs=1e-9)
        check(run, log)

    @each("period", [2.0 * np.pi, 360.0, 256.0, 65536.0])
    def test_they_go_on(self, period):
        way = 1.7 * period * np.sin(np.linspace(0.0, 3.0, 3001)) + 0.1 * period
        found, own = unwrapped(way % period)
        assert own == pytest.approx(period)
        assert found == pytest.approx(way, abs=1e-6 * period)

    def test_a_missing_value_stays_missing(self):
        way = np.linspace(0.0, 1000.0, 2001)
        holed = way % 360.0
        holed[77] = np.nan
        found, _ = unwrapped(holed)
        assert np.isnan(found[77])
        assert np.delete(found, 77) == pytest.approx(np.delete(way, 77))

    def test_what_leaps_without_going_on_has_a_fault(self):
        way = np.linspace(0.0, 300.0, 2001)
        way[900] = 0.0
        assert unwrapped(way) is None

    def test_a_way_that_ends_within_a_turn_is_as_it_is(self):
        assert unwrapped(350.0 * np.sin(np.linspace(0.0, 1.5, 500))) is None


class TestNumbersThatStandForNone:
    @each("mark", [-999.0, 9999.0, 65535.0, 1e30])
    def test_they_are_missing_values(self, tmp_path, log, mark):
        gone = np.zeros(log["t"].size, dtype=bool)
        gone[[300, 301, 1200, 2500]] = True
        run = read(tmp_path, csv_text({**log, "x1": np.where(gone, mark, log["x1"])}))
        assert run.x1[~gone] == pytest.approx(log["x1"][~gone], abs=1e-4)
        assert run.x1[gone] == pytest.approx(log["x1"][gone], abs=0.5)
        assert not run.valid("x1")[gone].any()
        assert any(f"x1 is {mark:.10g} in 4 samples" in note for note in run.notes)

    def test_a_cart_may_rest_where_it_goes_farthest(self):
        assert sentinel(np.concatenate([np.zeros(500), np.linspace(0.0, 80.0, 500), np.full(500, 80.0)])) is None
        # a step command takes two values
        assert sentinel(np.repeat([0.0, 5.0], 500)) is None

    def test_a_leap_that_is_never_the_same_is_a_fault(self):
        x = np.linspace(0.0, 80.0, 500)
        x[[100, 200]] = 900.0, 901.0
        assert sentinel(x) is None
