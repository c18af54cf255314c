"""What is kept for the report, and what is cut off."""

from dataclasses import replace

import numpy as np
import pytest

from flexdrive_gym import Excitation, Recording
from identification.mismatch.split import cut, split_recordings, without_rest
from tests.identification.mismatch.lab import data_set


def test_a_closed_loop_run_and_every_fourth_of_other_kinds_are_kept_for_the_report():
    runs = [replace(r, name=f"r{i}", excitation=Excitation("other")) for i, r in enumerate(data_set())]
    loop = replace(runs[0], name="loop", excitation=Excitation("closed_loop", 50.0))
    split = split_recordings([*runs, loop])
    assert [r.name for r in split.report] == ["r2"]
    assert [r.name for r in split.loops] == ["loop"]
    assert len(split.estimation) == 5


def test_nothing_to_estimate_from_is_an_error_that_says_what_to_record():
    with pytest.raises(ValueError, match="needs at least one run of the drive; got none. Record squares and sines"):
        split_recordings([])


def test_rest_before_the_first_command_is_cut_off():
    t = np.arange(4000) * 1e-3
    u = np.where(t < 2.0, 0.0, 1.0)
    x = np.where(t < 2.0, 0.0, (t - 2.0) * 30.0)
    short = without_rest(Recording("step", t, u, x1=x, x2=x, quantum=(0.01, 0.01)))
    assert short.n == 2100
    assert short.t[0] == 0.0
    assert short.u[99] == 0.0
    assert short.u[100] == 1.0


def test_blocks_of_a_single_recording_keep_its_places():
    recording = data_set()[0]
    parts = cut(replace(recording, t=recording.t * 4.0, v1=recording.v1, v2=recording.v2))
    assert len(parts) == 6
    assert sum(p.n for p in parts) == recording.n
    assert parts[1].x1[0] == pytest.approx(np.cumsum(recording.v1)[parts[0].n] * 4e-3)
