"""What is kept away must lie between what is learnt from, and nothing is lost or used twice."""

import numpy as np
import pytest

from flexdrive_gym import Excitation, Recording
from flexdrive_gym.recording import Fault
from identification.mismatch.split import split_recordings

T = np.arange(10) * 1e-3


def recording(name, kind, amplitude=0.0, frequency=0.0, faults=()):
    return Recording(
        name,
        T,
        T,
        xr=T if kind == "closed_loop" else None,
        excitation=Excitation(kind, amplitude, frequency),
        faults=faults,
    )


DAY = [
    *(recording(f"square {a} {c}", "square", a, 0.5) for a in (1.0, 1.5, 2.0) for c in "ab"),
    *(recording(f"sine {f}", "sine", 2.5, f) for f in (0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 8.0)),
    recording("loop", "closed_loop", 50.0, 0.5),
]


def test_every_recording_is_used_once():
    split = split_recordings(DAY)
    names = [r.name for part in (split.learn, split.prove, split.loops) for r in part]
    assert sorted(names) == sorted(r.name for r in DAY)


def test_kept_sines_and_squares_lie_between_others():
    split = split_recordings(DAY)
    for kind, of in (("sine", "frequency"), ("square", "amplitude")):
        learnt = [getattr(r.excitation, of) for r in split.learn if r.excitation.kind == kind]
        kept = [getattr(r.excitation, of) for r in split.prove if r.excitation.kind == kind]
        assert kept
        assert min(learnt) < min(kept) <= max(kept) < max(learnt)
        # a replicate that was learnt from would prove nothing
        assert not set(kept) & set(learnt)


def test_loops_are_kept_away_unless_there_is_nothing_else():
    assert [r.name for r in split_recordings(DAY).loops] == ["loop"]
    assert [r.name for r in split_recordings(DAY[-1:]).learn] == ["loop"]


def test_few_recordings_are_all_learnt_from():
    split = split_recordings(DAY[4:7])
    assert len(split.learn) == 3
    assert not split.prove


def test_a_copy_is_left_out():
    copy = recording("copy", "sine", 2.5, 1.0, (Fault("copy", "recording", "duplicate_recording", 0.0, 1.0),))
    split = split_recordings([*DAY, copy])
    assert "copy" not in {r.name for part in (split.learn, split.prove, split.loops) for r in part}


def test_nothing_is_refused_with_a_remedy():
    with pytest.raises(ValueError, match=r"at least one run.*Record squares and sines"):
        split_recordings([])
