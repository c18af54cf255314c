"""What a strip chart remembers."""

from dataclasses import replace
from math import inf, nan

import numpy as np
import pytest

from flexdrive_gym.rendering.history import MOST_SAMPLES, History
from tests.rendering.frames import REST, swing


class TestHistory:
    def test_keeps_the_window_and_one_sample_more(self):
        history = History(2.0)
        for frame in swing(900, 0.01):
            history.add(frame)
        t = history.columns()[0]
        assert t[-1] == pytest.approx(8.99)
        assert t[0] <= 6.99 + 1e-9
        assert t[1] >= 6.99 - 1e-9

    def test_of_fast_samples_is_thinned_but_always_current(self):
        history = History(1.0)
        for k in range(30_000):
            history.add(replace(REST, t=k * 1e-4, x1=float(k)))
        t, x1 = history.columns()[:2]
        assert len(t) <= MOST_SAMPLES + 2
        assert np.all(np.diff(t) > 0.0)
        assert x1[-1] == 29_999.0

    def test_of_the_rig_s_own_millisecond_is_complete(self):
        history = History(4.0)
        for k in range(4000):
            history.add(replace(REST, t=k * 1e-3))
        assert history.columns().shape == (5, 4000)

    def test_restarts_when_time_runs_backwards(self):
        history = History(4.0)
        history.add(replace(REST, t=3.0, x1=300.0))
        history.add(replace(REST, t=0.0))
        assert history.columns().shape == (5, 1)
        assert history.highest == 0.0

    def test_extremes_last_and_ignore_what_is_no_number(self):
        history = History(1.0)
        for t, x in ((0.0, -70.0), (1.0, nan), (2.0, inf), (9.0, 30.0)):
            history.add(replace(REST, t=t, x1=x, u=x))
        assert (history.lowest, history.highest, history.largest_command) == (-70.0, 30.0, 70.0)
