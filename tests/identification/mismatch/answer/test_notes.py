"""What a reader of a diagnosis is told beside its figures."""

import pytest

from flexdrive_gym.units import LAB
from identification.mismatch.answer.notes import _loop_note
from identification.mismatch.answer.verdict import RecordingFit


def _loop(name: str, before: float, after: float) -> RecordingFit:
    return RecordingFit(name, "report", before, after, unit="mm", how="in the loop")


@pytest.mark.parametrize(
    ("loops", "says"),
    [
        (
            [(5.0, 2.0)],
            "1 closed loop, which nothing was estimated from, bears the findings out: off by 5 mm before and 2 mm after",
        ),
        ([(5.0, 2.0), (1.0, 1.0)], "2 closed loops, which nothing was estimated from, bear the findings out"),
        ([(2.0, 5.0)], "speaks against the findings: off by 2 mm before and 5 mm after"),
        ([(2.0, 2.001)], "is off by 2 mm, with or without what was found"),
    ],
)
def test_closed_loops_bear_findings_out_or_speak_against_them(loops, says):
    assert says in _loop_note([_loop(str(i), *each) for i, each in enumerate(loops)], "mm", LAB)
