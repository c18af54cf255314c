"""The report holds every part that handout 3.5 asks for, and answers its questions from numbers."""

import json
import re

import pytest
from typer.testing import CliRunner

from baselines.cli import app
from baselines.lab.sample import FOLDER
from baselines.report import build_report
from baselines.report.discussion import measure_p_control
from baselines.report.findings import find
from baselines.report.sections import p_control_section
from identification import read_recordings


@pytest.fixture(scope="module")
def recordings():
    return read_recordings(FOLDER)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """The page, and what the command printed."""
    file = tmp_path_factory.mktemp("report") / "out" / "report.html"
    run = CliRunner().invoke(app, ["report", str(FOLDER), "--title", "Test report", "-o", str(file), "--json"])
    assert run.exit_code == 0, run.output
    return file, run.stdout


@pytest.fixture(scope="module")
def page(written):
    return written[0].read_text(encoding="utf-8")


def test_the_command_prints_one_object(written):
    file, printed = written
    assert json.loads(printed) == {"report": str(file), "skipped": []}


def plain(page):
    """Return a page with cells that carry nothing but their text."""
    return re.sub(r"<td [^>]*>", "<td>", page)


def test_every_part_of_the_handouts_report_is_there(page):
    for anchor in ("faults", "p-control", "steps", "sines", "identification", "time", "frequency", "stability"):
        assert f'id="{anchor}"' in page
    for symbol in ("bT", "b1", "b2", "dT", "d1", "d2", "p", "mT", "m1", "m2", "ωd", "k", "ζ", "ωn", "C"):
        assert f"<td>{symbol}</td>" in plain(page), symbol
    assert page.count('src="data:image/png;base64,') >= 14
    assert "Phase ∠(v2/u) [deg]" in page


def test_page_is_self_contained(page):
    assert not re.findall(r"""(?:src|href)=["'](?!data:|#)""", page)


def test_discussions_are_answered_with_numbers(page):
    assert re.search(r"Raising Kp from 0\.05 V/mm to 0\.1915 V/mm", page)
    assert "Advantage: stability" in page
    assert "Disadvantage: accuracy" in page


def test_faults_of_the_sample_are_listed(page):
    # the two frozen encoders that the sample's maker put in
    for name in ("sine_2.5V_1.0Hz", "square_2.0V_0.5Hz_a"):
        assert f"<td>{name}</td><td>encoder 1</td><td>encoder dropout" in plain(page)


def test_report_without_p_control_simulates_it(recordings):
    section = p_control_section(find([r for r in recordings if not r.closed_loop]))
    assert "No P-control run was recorded" in section.blocks[0].text
    text = " ".join(line for block in section.blocks for line in block.lines)
    assert "Raising Kp" in text
    assert "Advantage: stability" in text
    assert sum(block.kind == "figure" for block in section.blocks) == 4


def test_dwell_error_is_that_of_the_definition(recordings):
    run = next(r for r in recordings if r.name == "pctrl_x2_kp0.05")
    m = measure_p_control(run)
    assert m.gain == pytest.approx(0.05, rel=1e-3)
    assert not m.unstable
    assert m.error_peak == pytest.approx(abs(run.xr - run.x2).max())


@pytest.mark.slow
def test_report_of_real_recordings(shared_recordings):
    page = build_report(read_recordings(shared_recordings / "mte360_2022"), title="Real")
    assert "On the rig 0.2345 V/mm held and 0.235 V/mm grew" in page
