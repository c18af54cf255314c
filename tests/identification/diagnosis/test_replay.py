"""With the true drive as the diagnosed one, nothing remains of the missing force."""

import numpy as np
import pytest

from flexdrive_gym import Drive
from identification.mismatch.along_track import ALONG_TRACK
from identification.mismatch.crew import Crew
from identification.diagnosis.replay import remaining, replay
from identification.mismatch.shapes import _families, _Motion
from identification.mismatch.split import Split
from identification.mismatch.verdict import Curve
from identification.plots.mismatch import plot_before_after, plot_curve, plot_maps, plot_telling_map, telling_window
from tests.drive.drives import RIG
from tests.identification.mismatch.lab import diagnosis, short_day

HARD = {"hardening_spring.k3": 2e-4}


@pytest.fixture(scope="module")
def found():
    recordings = tuple(short_day(HARD, force=0.02))
    d = diagnosis(free=Drive(RIG), drive=Drive({**RIG, **HARD}), split=Split(recordings, (), ()))
    with Crew(2) as pool:
        return d, remaining(d, pool)


def test_the_true_physics_leaves_little(found):
    _, forces = found
    i = forces.most_telling()
    assert forces.before[i].variable == "δ"
    assert forces.after[i].size < 0.35 * forces.before[i].size
    assert forces.before[i].explained > 0.5


def test_wrong_physics_leaves_all(found):
    d, _ = found
    other = diagnosis(free=d.free, drive=d.free, split=d.split)
    with Crew(2) as pool:
        forces = remaining(other, pool)
    assert forces.after[0].size == pytest.approx(forces.before[0].size, rel=0.1)


def test_figures_show_the_stretch_that_differs(found):
    d, forces = found
    run = d.split.learn[3]
    before, after = replay(d.free, run), replay(d.drive, run)
    begin, end = telling_window(run, before, after)
    assert 0.0 <= begin < end <= run.t[-1]
    assert end - begin == pytest.approx(1.0, abs=0.01)  # two periods of 2 Hz
    part = (run.t >= begin) & (run.t <= end)
    error = [np.mean((run.v2 - r.v2)[part] ** 2) for r in (before, after)]
    assert error[0] > 2.0 * error[1]
    figure = plot_before_after(run, before, after, titles=("tied", "free"))
    assert [a.get_title(loc="left").split(":")[0] for a in figure.axes[:2]] == ["tied", "free"]
    assert "rms" in figure.axes[0].get_title(loc="left")
    assert len(plot_maps(forces.before, forces.after).axes) == 14
    both = plot_telling_map(forces.measured, forces.before[0], forces.left, forces.supply[0], forces.after[0])
    assert len(both.axes) == 2
    assert len(plot_telling_map(forces.measured, forces.before[0]).axes) == 1


def test_every_free_shape_can_be_drawn_with_its_unit():
    still = [_Motion(np.arange(3) * 1e-3, np.zeros(3), np.zeros((2, 3)))]
    names = {name for cart in (0, 1) for _, name, _, _ in _families(still, cart)} | {ALONG_TRACK}
    at = np.linspace(-1.0, 1.0, 7)
    for name in names:
        (axes,) = plot_curve(Curve(name, at, at, 0.1 * np.ones(7)), "cart_2").axes
        assert "[" in axes.get_xlabel()
        assert ("friction" in axes.get_ylabel()) is name.startswith("friction")
