"""What a rig description changes about the files it stands beside."""

import numpy as np
import pytest

from flexdrive_gym.units import Units
from identification.recordings import RecordingError, read_recordings
from identification.recordings.rig import parse_rig
from tests.identification.recordings.logs import (
    COUNT,
    open_loop,
    speed,
    square,
    time,
    velocity_log,
    write_csv,
)


class TestRigDescription:
    """What ``rig.toml`` says about columns, units and files."""

    @staticmethod
    def read(folder, text, **more):
        return read_recordings(folder, rig=parse_rig(text), **more)

    @staticmethod
    def bare(path, **changes):
        log = {**velocity_log("sine", 2.5, 2.0), **changes}
        np.savetxt(path, np.column_stack(list(log.values())), fmt="%.7g")
        return log

    def test_columns_by_number_and_a_sampling_period(self, tmp_path):
        log = self.bare(tmp_path / "a.txt")
        with pytest.raises(RecordingError, match=r"a.txt: header: .*got no header, the first line is .* from 1 to 4"):
            read_recordings(tmp_path / "a.txt")
        (run,) = self.read(tmp_path, '[rig]\nsample_time = 0.001\n[columns]\nu = "2"\nv1 = 3\nv2 = "4"')
        np.testing.assert_allclose(run.v2, log["v2_mm_s"], atol=1e-3)
        assert run.sample_time == pytest.approx(1e-3)

    def test_alternatives_sums_and_factors(self, tmp_path):
        t, u, x1, x2 = open_loop()
        counts = {"Time": t, "dac": -819.0 * u, "enc a": np.round(x1 / COUNT), "bend": np.round((x2 - x1) / COUNT)}
        write_csv(tmp_path / "a.csv", counts)
        text = f"""
            [columns]
            u = ["duty", "dac"]
            x1 = "enc a"
            x2 = "enc a + bend"
            [units]
            u = {{ unit = "V", factor = {-1.0 / 819.0} }}
            x1 = {{ unit = "mm", factor = {COUNT} }}
            x2 = {{ unit = "mm", factor = {COUNT} }}
        """
        (run,) = self.read(tmp_path, text)
        np.testing.assert_allclose(run.u, u, atol=1e-6)
        np.testing.assert_allclose(run.x2, x2, atol=1e-6)
        assert run.quantum == pytest.approx((COUNT, COUNT), rel=1e-5)

    def test_a_misspelt_column_is_a_reason_and_an_absent_one_a_note(self, tmp_path):
        t, u, x1, x2 = open_loop()
        write_csv(tmp_path / "a.csv", {"t": t, "u": u, "encoder_a": x1, "x2": x2})
        with pytest.raises(RecordingError, match=r"rig.toml gives x1 the name 'encodr_a'.* Is encoder_a meant"):
            self.read(tmp_path / "a.csv", '[columns]\nx1 = "encodr_a"')
        (run,) = self.read(tmp_path, '[columns]\nx1 = "pulses"')
        assert run.x1 is None
        assert "no column for x1, which rig.toml calls 'pulses'" in run.notes
        with pytest.raises(RecordingError, match="must contain the command, which rig.toml calls 'pulses'"):
            self.read(tmp_path / "a.csv", '[columns]\nu = "pulses"')

    def test_rules_for_some_files(self, tmp_path):
        self.bare(tmp_path / "a.txt")
        log = self.bare(tmp_path / "b.txt", u_V=-square(time(4.0)), v1_mm_s=velocity_log()["v1_mm_s"])
        write_csv(tmp_path / "c.csv", velocity_log("sine", 2.5, 3.0))
        text = """
            [columns]
            t = "1"
            u = "2"
            v1 = "3"
            [[files]]
            match = "c*"
            use = false
            [[files]]
            match = "b*"
            session = "evening"
            held = 2
            units = { u = { unit = "V", factor = -1.0 } }
        """
        runs = self.read(tmp_path, text)
        assert [(run.name, run.session, run.held) for run in runs] == [("a", "", ()), ("b", "evening", (2,))]
        np.testing.assert_allclose(runs[1].u, -log["u_V"], atol=1e-6)
        assert [(item.file, item.reason) for item in runs.skipped] == [("c.csv", "left out by rig.toml")]
        assert runs.idle == ()

    def test_a_rule_that_holds_for_no_file_is_said(self, tmp_path):
        (tmp_path / "feb").mkdir()
        write_csv(tmp_path / "feb" / "a.csv", velocity_log())
        write_csv(tmp_path / "b.csv", velocity_log("sine", 2.5, 3.0))
        rules = "".join(f'[[files]]\nmatch = "{match}"\nuse = false\n' for match in ("feb/*", "fbe/*", "feb/a*"))
        runs = self.read(tmp_path, rules)
        assert runs.idle == ("fbe/*", "feb/a*")
        assert runs.summary().endswith("no file falls under the rule 'fbe/*', 'feb/a*' of rig.toml")
        assert self.read(tmp_path, rules, only=["b*"]).idle == runs.idle

    def test_units_of_its_own_are_brought_to_the_engines_scale(self, tmp_path):
        t, u, x1, _ = open_loop()
        log = {"t": t, "torque": 0.01 * u, "x1": x1 * 1e-3, "v1": speed(x1) * 1e-3}
        log["v1"][100:110] = np.nan
        write_csv(tmp_path / "a.csv", log)
        text = '[columns]\nu = "torque"\n[units]\nu = "N m"\nx1 = "rad"\nv1 = "rad/s"'
        (run,) = self.read(tmp_path, text)
        assert (run.units.length, run.units.command, run.units.per_command) == ("rad", "N m", 100.0)
        travel = np.ptp(x1) * 1e-3 * run.units.per_length
        assert 50.0 / 10**0.5 <= travel <= 50.0 * 10**0.5
        assert np.log10(run.units.per_length) == pytest.approx(round(np.log10(run.units.per_length)))
        np.testing.assert_allclose(run.u, u, atol=1e-4)
        assert np.ptp(run.x1) == pytest.approx(travel, rel=1e-4)
        assert run.quantum[0] == pytest.approx(COUNT * 1e-3 * run.units.per_length, rel=1e-2)
        (fixed,) = self.read(tmp_path, text + "\n[scale]\nlength = 500.0\ntime = 2.0")
        assert (fixed.units.per_length, fixed.units.per_command) == (500.0, 100.0)
        assert fixed.t[-1] == pytest.approx(2.0 * t[-1])
        np.testing.assert_allclose(fixed.v1, run.v1 * 500.0 / run.units.per_length / 2.0)
        assert (fixed.faults[0].start_s, fixed.faults[0].end_s) == pytest.approx((0.2, 0.218))

    def test_the_units_of_a_drive(self, tmp_path):
        write_csv(tmp_path / "a.csv", velocity_log())
        text = '[units]\nu = "N m"\nv1 = "rad/s"\nv2 = "rad/s"'
        wanted = Units("rad", "N m", 3.0, 7.0)
        (run,) = self.read(tmp_path, text.replace("rad/s", "rad/s"), units=wanted, only=["a*"], strict=False)
        assert run.units is wanted
        with pytest.raises(RecordingError, match="must be measured in rad and N m, as the drive is; got mm and V"):
            self.read(tmp_path, "", units=wanted)
