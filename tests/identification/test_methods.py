"""What identification tells of a rig beside its parameters."""

from dataclasses import replace

import numpy as np

from identification.methods import rig_parameters
from tests.identification.lab import data_set


def test_a_limit_is_what_no_run_exceeds():
    # a controller rests at 1.5 V, which another run exceeds: the amplifier limits neither
    runs = data_set()[:2]
    resting = replace(runs[0], excitation=replace(runs[0].excitation, limit=1.5))
    assert rig_parameters([resting])["saturation.limit"] == 1.5
    assert "saturation.limit" not in rig_parameters([resting, runs[1]])
    rounded = replace(runs[1], u=np.clip(runs[1].u, -1.5007, 1.5007))
    assert rig_parameters([resting, rounded])["saturation.limit"] == 1.5
