"""Velocities of recordings, whichever signals they have."""

import numpy as np
import pytest

from flexdrive_gym import Excitation, Recording
from identification import read_recordings
from identification.signals import velocities

T = np.arange(2000) * 1e-3


def test_a_position_gives_a_velocity():
    recording = Recording("ramp", T, np.ones(len(T)), x1=5.0 * T, excitation=Excitation("other"))
    (v1,) = velocities(recording)
    assert v1[1:] == pytest.approx(5.0)


def test_a_column_of_unknown_unit_is_named_where_it_would_have_helped(tmp_path):
    u = np.sin(2.0 * np.pi * T)
    head = "t [s],u [V],v1 [furlong/fortnight],v2 [mm/s]"
    np.savetxt(tmp_path / "a.csv", np.column_stack([T, u, 3.0 * u, 2.0 * u]), delimiter=",", header=head, comments="")
    (recording,) = read_recordings(tmp_path)
    with pytest.raises(ValueError, match=r"needs v1 or x1.*furlong/fortnight"):
        velocities(recording)
