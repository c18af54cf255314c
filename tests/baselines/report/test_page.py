"""Blocks of a page: terms are explained, figures carry their data, moving pictures can be stopped, nothing comes from outside."""

import base64
import gzip
import io
import re

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from baselines.report.glossary import explained
from baselines.report.page import Section, render
from baselines.report.words import by_number
from flexdrive_gym import Fault
from identification.plots.style import FAULTS, SATURATION, shade_faults
from tests.each import each


def page(*sections):
    return render(title="Page on floors", subtitle="", summary=["What the floor is."], sections=sections, footer="made")


def test_a_term_is_linked_once_where_it_first_stands_and_explained_at_the_end():
    section = Section("The floor", "floor")
    section.text("The floor again, and VAF & more <VAF>; a floor-board is none.")
    html = page(section)
    assert html.count('href="#term-floor"') == html.count('href="#term-vaf"') == 1
    assert html.index('href="#term-floor"') < html.index('<h2 id="floor">')
    assert '<dt id="term-vaf">VAF</dt>' in html
    assert "term-dwell" not in html
    assert "<title>Page on floors</title>" in html
    assert explained("<p>nothing to explain</p><footer></footer>") == "<p>nothing to explain</p><footer></footer>"


def test_a_figure_carries_its_data(monkeypatch):
    figure = Figure()
    axes = figure.subplots()
    axes.plot([0.0, 1.0, 2.0], [0.5, 1.5, -2.0], label="$v_1$")
    axes.axhline(0.0)
    axes.set(xlabel="time [s]", ylabel="velocity [mm/s]")
    section = Section("One", "one")
    section.figure(figure, "A figure.")
    html = page(section)
    files = {kind: gzip.decompress(base64.b64decode(data)).decode() for kind, data in
             re.findall(r'data-kind="(\w+)" data-file="([^"]+)"', html)}  # fmt: skip
    assert files["csv"].splitlines() == [
        "panel,x label,y label,series,x,y",
        '1,"time [s]","velocity [mm/s]","v_1",0,0.5',
        '1,"time [s]","velocity [mm/s]","v_1",1,1.5',
        '1,"time [s]","velocity [mm/s]","v_1",2,-2',
    ]
    assert "<svg" in files["svg"]
    assert not re.findall(r"""(?:src|href)=["'](?!data:|#)""", html)


def test_a_moving_picture_can_be_stepped_through():
    pictures = [Image.fromarray(np.full((4, 6, 3), level, np.uint8)) for level in (0, 120, 255)]
    stream = io.BytesIO()
    pictures[0].save(stream, "GIF", save_all=True, append_images=pictures[1:], duration=100)
    section = Section("One", "one")
    section.gallery([(stream.getvalue(), "It moves.")])
    html = page(section)
    (frames,) = re.findall(r'<script type="text/plain">([^<]*)</script>', html)
    assert len(frames.split(" ")) == 3
    shown = Image.open(io.BytesIO(base64.b64decode(frames.split(" ")[-1]))).convert("RGB")
    assert shown.getpixel((0, 0)) == (255, 255, 255)
    assert f'src="data:image/png;base64,{frames.split(" ")[-1]}"' in html
    assert 'type="range" min="0" max="2"' in html


def test_a_long_table_can_be_folded():
    section = Section("One", "one")
    section.table(("a", "b"), [("x", "1")], folded="All 1 rows")
    assert "<details><summary>All 1 rows</summary>" in page(section)


def test_names_are_sorted_by_their_numbers():
    names = ["sine_2.5V_12.0Hz", "sine_2.5V_2.0Hz", "square_1.5V", "sine_2.5V_0.5Hz"]
    assert sorted(names, key=by_number) == ["sine_2.5V_0.5Hz", "sine_2.5V_2.0Hz", "sine_2.5V_12.0Hz", "square_1.5V"]


@each(("kind", "colour"), [("saturation", SATURATION), ("encoder_dropout", FAULTS[0])])
def test_a_command_at_its_limit_has_a_colour_of_its_own(kind, colour):
    class Run:
        t = np.arange(10.0)
        faults = (Fault("run", "actuator", kind, 1.0, 2.0), Fault("run", "actuator", "lost_counts", 3.0, 4.0))

    axes = Figure().subplots()
    shade_faults(axes, Run, "actuator")
    patch = next(p for p in axes.patches if p.get_label() in {"command at its limit", "encoder dropout"})
    assert patch.get_facecolor()[:3] == pytest.approx([int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5)])
    assert SATURATION not in FAULTS
