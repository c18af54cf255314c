"""Suggested experiments separate what ties, and stay within the rig's limits."""

import numpy as np
import pandas as pd
import pytest

from flexdrive_gym import Drive
from identification.mismatch.answer.finding import Finding, Named
from identification.mismatch.answer.suggest import (
    COMMAND_LIMIT_V,
    TRAVEL_MM,
    command,
    suggest_experiments,
    write_suggestions,
)
from identification.mismatch.answer.verdict import RecordingFit
from tests.drive.drives import RIG
from tests.identification.mismatch.lab import diagnosis

OURS = {**RIG, "stribeck.cart_1.extra": 0.12, "stribeck.cart_1.vs": 40.0}
THEIRS = {**RIG, "quadratic_drag.cart_1.c": 3e-6}
FOUND = diagnosis(
    drive=Drive(OURS),
    findings=(
        Finding(
            "stribeck",
            "cart_1",
            {},
            (Named("quadratic_drag", "cart_1"),),
            None,
            0.5,
            0.001,
            9.0,
            5.0,
            drives=(Drive(OURS, name="stribeck@cart_1"), Drive(THEIRS, name="quadratic_drag@cart_1")),
        ),
    ),
    per_recording=(RecordingFit("a", "estimation", 9.0, 5.0, 2.5), RecordingFit("b", "report", 9.0, 5.0, 50.0)),
)


@pytest.fixture(scope="module")
def suggestions():
    return suggest_experiments(FOUND)


def test_without_ties_there_is_nothing_to_suggest():
    assert suggest_experiments(diagnosis()) == ()


def test_separation_is_the_rms_difference_over_the_floor(suggestions):
    assert len(suggestions) == 3
    for s in suggestions:
        runs = [Drive({**values, "saturation.limit": COMMAND_LIMIT_V}).simulate(s.t, s.u) for values in (OURS, THEIRS)]
        difference = np.concatenate([runs[0].v1 - runs[1].v1, runs[0].v2 - runs[1].v2])
        assert s.separation == {
            "stribeck@cart_1 or quadratic_drag@cart_1": pytest.approx(np.sqrt(np.mean(difference**2)) / 2.5)
        }


def test_the_best_comes_first_and_beats_the_lab_day(suggestions):
    best = [min(s.separation.values()) for s in suggestions]
    assert best == sorted(best, reverse=True)
    t, u = command("sine", 2.5, 1.0)
    runs = [Drive(values).simulate(t, u) for values in (OURS, THEIRS)]
    assert best[0] > np.sqrt(np.mean((runs[0].v1 - runs[1].v1) ** 2)) / 2.5


def test_limits_of_the_rig_are_kept(suggestions):
    for s in suggestions:
        run = Drive(OURS).simulate(s.t, s.u)
        assert np.max(np.abs(s.u)) <= COMMAND_LIMIT_V
        assert max(np.max(np.abs(run.x1)), np.max(np.abs(run.x2))) <= TRAVEL_MM


def test_input_files_are_what_the_rig_plays(suggestions, tmp_path):
    for s, path in zip(suggestions, write_suggestions(suggestions, tmp_path), strict=True):
        assert path.name == f"suggest_{s.rank}_{s.kind}_{s.amplitude:g}V_{s.frequency:g}Hz.csv"
        table = pd.read_csv(path)
        assert list(table.columns) == ["t_s", "u_V"]
        assert np.allclose(np.diff(table.t_s), 1e-3)
        assert table.t_s.iloc[-1] == pytest.approx(8.0)
        assert np.allclose(table.u_V, s.u, atol=1e-5)


def test_a_ramp_is_a_triangle_from_zero():
    _t, u = command("ramp", 2.0, 0.25)
    assert u[0] == pytest.approx(0.0)
    assert u[1000] == pytest.approx(2.0)
    assert u[3000] == pytest.approx(-2.0)
    assert np.max(np.abs(np.diff(u))) == pytest.approx(2.0 * 4 * 0.25 * 1e-3)
