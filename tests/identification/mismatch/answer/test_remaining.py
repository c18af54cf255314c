"""With the true drive as the diagnosed one, nothing remains of the missing force."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from flexdrive_gym import Drive
from identification.mismatch.answer.remaining import remaining, replay
from identification.mismatch.split import Split
from identification.plots.mismatch import plot_before_after, plot_maps, plot_telling_map, telling_window
from tests.drive.drives import RIG
from tests.identification.mismatch.lab import data_set, diagnosis

HARD = {"hardening_spring.k3": 2e-4}


@pytest.fixture(scope="module")
def found():
    recordings = tuple(data_set(HARD, force=0.02))
    d = diagnosis(base=Drive(RIG), drive=Drive({**RIG, **HARD}), split=Split(recordings, (), ()))
    with ThreadPoolExecutor(2) as pool:
        return d, remaining(d, pool)


def test_the_true_physics_leaves_little(found):
    _, forces = found
    i = forces.most_telling()
    assert forces.before[i].variable == "δ"
    assert forces.after[i].size < 0.35 * forces.before[i].size
    assert forces.before[i].explained > 0.5


def test_wrong_physics_leaves_all(found):
    d, _ = found
    other = diagnosis(base=d.base, drive=d.base, split=d.split)
    with ThreadPoolExecutor(2) as pool:
        forces = remaining(other, pool)
    assert forces.after[0].size == pytest.approx(forces.before[0].size, rel=0.1)


def test_figures_show_the_stretch_that_differs(found):
    d, forces = found
    run = d.split.estimation[3]
    before, after = replay(d.base, run), replay(d.drive, run)
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
