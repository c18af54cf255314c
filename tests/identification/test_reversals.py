"""The mean of all reversals, aligned."""

from dataclasses import replace

import numpy as np
import pytest

from flexdrive_gym import Drive
from flexdrive_gym.recording import Fault
from identification.plots.reversals import plot_reversals
from identification.reversals import mean_reversal
from tests.drive.drives import RIG
from tests.identification.lab import run

T = np.arange(8001) * 1e-3
FREE = Drive(RIG)
TRACK = {"base_recoil.compliance": 0.01, "base_recoil.frequency": 34.0, "base_recoil.zeta": 0.05}


def test_a_reversal_is_the_command_over_the_mass_and_nothing_at_cart_2():
    found = mean_reversal(run(FREE, "square", 2.0, 0.5, t=T))
    assert found.count == 7
    # 10 ms of 4 V, less what viscous friction and the spring take
    v1, v2 = found.jumps()
    assert v1 == pytest.approx(4.0 / RIG["m1"] * 0.01, rel=0.12)
    assert abs(v2) < 1.0


def test_a_track_that_gives_way_shows_in_both_encoders_at_once():
    free, given = (mean_reversal(run(d, "square", 2.0, 0.5, t=T)) for d in (FREE, FREE.replace(TRACK)))
    # Δu/(M·ω_b) with M·ω_b = kb/ω_b, less what damping and the slowing cart 1 take in a quarter period
    quarter = 4.0 * 0.01 * 2 * np.pi * 34.0
    assert given.jumps()[1] - free.jumps()[1] == pytest.approx(0.8 * quarter, rel=0.12)


def test_reversals_with_a_fault_and_runs_without_any_are_left_out():
    whole = run(FREE, "square", 2.0, 0.5, t=T)
    fault = Fault(whole.name, "encoder_1", "encoder_dropout", 2.001, 2.003)
    assert mean_reversal(replace(whole, faults=(fault,))).count == 6
    assert mean_reversal(run(FREE, "sine", 2.0, 1.0)) is None


def test_picture_has_two_panels_an_amplitude():
    found = mean_reversal(run(FREE, "square", 2.0, 0.5, t=T))
    figure = plot_reversals({"±2 V": [found, found]}, {"free drive": {"±2 V": [found]}})
    assert len(figure.axes) == 2
    assert [len(a.lines) for a in figure.axes] == [3, 3]
