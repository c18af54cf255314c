"""Controllers in a rig's own units: the same physical drive, described in other units, gives the same physical answers."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from baselines.cli import app
from baselines.compare import compare, entries, load_own
from baselines.lab.lab_scale import EXCITATION_V, on_lab_scale
from baselines.loop_analysis.stability_limit import with_rig
from flexdrive_gym import DEFAULT_DRIVE, Drive, load_drive, save_drive
from flexdrive_gym.drive.drive import Recorded
from flexdrive_gym.references import STROKE_MM
from flexdrive_gym.units import Units, in_rig_units
from tests.each import each

# of the handout's rig: what 1 rad and 1 N m, or one count and one unit of the converter, would be
RADIANS = Units("rad", "N m", per_length=1000.0, per_command=100.0)
COUNTS = Units("counts", "DAC", per_length=0.0046592, per_command=1.0 / 819.0)
REACHED = Recorded(u=2.5, v=180.0, deflection=20.0, slowest=0.5, fastest=20.0, travel=120.0)
DRIVE = DEFAULT_DRIVE.replace(recorded=REACHED)


def called(*arguments: str):
    return CliRunner().invoke(app, arguments, env={"COLUMNS": "200"})


def described(units: Units) -> Drive:
    return DRIVE.replace(units=units)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("drives")
    return {u.length: save_drive(described(u), folder / f"{u.length}.toml") for u in (RADIANS, COUNTS)}


@each("units", [RADIANS, COUNTS])
def test_the_task_follows_from_what_was_recorded(units):
    """The largest recorded command is the lab's excitation; half of the top speed cruises: 180 / 2 / 100 of 50 mm."""
    rig = on_lab_scale(described(units))
    assert rig.units.of_rig(EXCITATION_V, "V")[0] == pytest.approx(2.5 / units.per_command)
    assert rig.units.of_rig(STROKE_MM, "mm")[0] == pytest.approx(45.0 / units.per_length)
    # on a short track the track decides
    short = on_lab_scale(described(units).replace(recorded=replace(REACHED, travel=20.0)))
    assert short.units.of_rig(STROKE_MM, "mm")[0] == pytest.approx(20.0 / units.per_length)
    # drives of older files do not know their travel
    old = on_lab_scale(described(units).replace(recorded=replace(REACHED, travel=0.0)))
    assert old.units == rig.units


def test_a_rig_without_a_limit_has_what_was_recorded():
    values = {name: value for name, value in DRIVE.values.items() if "." not in name}
    rig = with_rig(on_lab_scale(Drive(values, units=RADIANS, recorded=REACHED)))
    assert rig.units.of_rig(rig.voltage_limit, "V")[0] == pytest.approx(0.025)
    assert rig["encoder_quantisation.encoder_1.quantum"] == 0.0


def test_the_lab_keeps_the_handouts_task():
    assert on_lab_scale(DRIVE) is DRIVE
    unknown = described(RADIANS).replace(recorded=None)
    assert on_lab_scale(unknown) is unknown


def told(units: Units) -> list[float]:
    """Return a comparison's figures in the lab's units, told by a rig with these."""
    rig = on_lab_scale(described(units))
    chosen, _ = entries(rig, ["p_x2", "lab4"])
    found = compare(rig, chosen, draws=0, effects=False, references=["sine"], duration=2.0, backend="sequential")
    shown = in_rig_units(found, rig.units)
    figures = []
    for r in shown.results:
        m = r.nominal
        lengths = [m.rms, m.peak, r.swing, r.unseen["sine"].rms]
        figures += [value * units.per_length for value in lengths]
        figures += [m.effort * units.per_command, m.effort_peak * units.per_command, r.margins.gain_margin]
        figures += [m.vibration * units.per_length * units.per_command]
        figures += [r.margins.stiffness * units.per_command / units.per_length, r.on_rig.delay_margin]
    return figures


def test_a_comparison_does_not_depend_on_the_units():
    np.testing.assert_allclose(told(RADIANS), told(COUNTS), rtol=1e-6, atol=1e-6)


def test_gains_in_a_file_are_the_rigs(tmp_path):
    """1.5 N m/rad is 0.15 V/mm where 1 rad is 1000 mm and 1 N m is 100 V; a black box hears radians."""
    (tmp_path / "p.toml").write_text("limit = 0.04\n[tf]\nnumerator = [1.5]\ndenominator = [1.0]\ndomain = 'z'\n")
    (tmp_path / "own.py").write_text(
        "class Mine:\n"
        "    def __init__(self, drive): self.gain = 1.5 * drive['k'] / drive['k']; self.k = drive['k']\n"
        "    def reset(self): self.most = 0.0\n"
        "    def __call__(self, o): return self.gain * (o.xr - o.x2)\n"
    )
    rig = described(RADIANS)
    linear = load_own(str(tmp_path / "p.toml"), rig).controller
    assert linear.D[0] == pytest.approx([0.15, 0.0, -0.15])
    assert linear.limit == pytest.approx(4.0)
    mine = load_own(f"{tmp_path / 'own.py'}:Mine", rig)
    assert mine.controller.controller.k == pytest.approx(DRIVE["k"] / 100.0 * 1000.0)
    t = np.arange(500) * 1e-3
    one, two = (rig.simulate_closed_loop(t, np.full(500, 20.0), c) for c in (linear, mine.controller))
    np.testing.assert_allclose(one.x2, two.x2, atol=1e-6)


@pytest.mark.parametrize("command", ["design", pytest.param("compare", marks=pytest.mark.slow)])
def test_commands_tell_no_unit_of_the_lab(command, files, tmp_path):
    quick = [
        "-c",
        "p_x2",
        "-a",
        "none",
        "-r",
        "none",
        "--draws",
        "0",
        "--no-effects",
        "--no-empirical",
        "--periods",
        "1",
    ]
    options = [] if command == "design" else quick
    shown = called(command, str(files["rad"]), *options, "-o", str(tmp_path))
    assert shown.exit_code == 0, shown.output
    pages = "".join(p.read_text(encoding="utf-8") for p in tmp_path.glob("*.html"))
    # without scripts, styles and what is packed in base64
    text = re.sub(r"(?s)<(style|script)[^>]*>.*?</\1>|[\w+/=]{80,}", "", pages)
    for where in (shown.output, text):
        assert "rad" in where
        assert not re.search(r"\d ?(mm|V)\b(?!/)|\[(mm|V|V/mm|mm/s|V mm)\]", where)


def test_design_as_json_is_the_same_drive_in_other_units(files):
    found = {}
    for name, path in files.items():
        run = called("design", str(path), "--json")
        assert run.exit_code == 0, run.output
        found[name] = json.loads(run.stdout)
    one, two = (found[u.length]["refined"]["values"]["Kp"] for u in (RADIANS, COUNTS))
    assert (one["unit"], two["unit"]) == ("N m/rad", "DAC/counts")
    in_lab = [kp["value"] * u.per_command / u.per_length for kp, u in ((one, RADIANS), (two, COUNTS))]
    assert in_lab[0] == pytest.approx(in_lab[1], rel=1e-6)
    assert found["rad"]["units"] == {"length": "rad", "command": "N m"}
    steps = found["rad"]["stages"]["lab4"]["tracking"]
    assert list(steps) == ["0.04 N m", "0.08 N m"]


def test_an_experiment_is_read_back_as_the_same_rig(files, tmp_path):
    options = ["--frequency", "2", "--square", "0.02", "-o", str(tmp_path)]
    run = called("experiment", str(files["rad"]), *options)
    assert run.exit_code == 0, run.output
    assert "square ±0.02 N m" in run.output
    shown = called("check", str(tmp_path), "--rig", str(tmp_path / "rig.toml"), "--json")
    found = json.loads(shown.stdout)
    assert found["skipped"] == []
    assert {r["experiment"] for r in found["recordings"]} == {"p_control", "square", "sine"}
    assert load_drive(files["rad"]).units == RADIANS
