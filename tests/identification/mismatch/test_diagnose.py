"""A whole diagnosis: what was left out is named, and where nothing was, nothing is."""

from types import SimpleNamespace

import pytest

from flexdrive_gym import Drive
from identification import Diagnosis, diagnose
from identification.mismatch.diagnose import spring_notes
from identification.mismatch.shapes import ALONG_TRACK
from identification.mismatch.split import split_recordings
from identification.mismatch.unnamed import left_unnamed
from identification.replay.output_error import prepare
from tests.drive.drives import RIG
from tests.identification.lab import COUNTS, lab_day
from tests.identification.mismatch.lab import SHORT, T, short_day

STRIBECK = {"stribeck.cart_1.extra": 0.3, "stribeck.cart_1.vs": 40.0}


def test_the_same_seed_gives_the_same_answer_on_any_number_of_threads():
    day = short_day({"hardening_spring.k3": 2e-4}, kinds=SHORT[3:], t=T[:2001])
    one, two = (diagnose(day, seed=3, jobs=jobs).as_json() for jobs in (1, 3))
    for found in (one, two):
        found.pop("seconds")
    assert one == two


@pytest.mark.parametrize(
    "effect",
    # k + 3 k3 δ² and k + 2 k2 δ vanish at 29 mm
    [{"hardening_spring.k3": -RIG["k"] / (3.0 * 29.0**2)}, {"asymmetric_spring.k2": RIG["k"] / (2.0 * 29.0)}],
)
def test_a_spring_whose_force_falls_is_not_trusted_beyond_what_was_recorded(effect):
    runs = [prepare(r) for r in short_day({}, kinds=SHORT[:1], t=T[:2001])]
    (note,) = spring_notes(Drive({**RIG, **effect}), runs)
    assert "falls again beyond 29 mm" in note


@pytest.mark.parametrize("effect", [{}, {"hardening_spring.k3": 1e-4}, {"coupling_backlash.g": 1.0}])
def test_of_a_spring_that_holds_nothing_is_said(effect):
    runs = [prepare(r) for r in short_day({}, kinds=SHORT[:1], t=T[:2001])]
    assert spring_notes(Drive({**RIG, **effect}), runs) == ()


def test_nothing_is_refused():
    with pytest.raises(ValueError, match="at least one run"):
        split_recordings([])


@pytest.mark.slow
def test_a_stribeck_effect_on_cart_1_is_named():
    found = diagnose(lab_day(Drive({**RIG, **COUNTS, **STRIBECK})))
    assert isinstance(found, Diagnosis)
    assert [(f.id, f.where) for f in found.findings] == [("stribeck", "cart_1")]
    assert found.findings[0].parameters["extra"].value == pytest.approx(0.3, rel=0.1)
    assert found.findings[0].parameters["vs"].value == pytest.approx(40.0, rel=0.2)
    assert found.findings[0].heldout_rms_after < found.findings[0].heldout_rms_before


@pytest.mark.slow
def test_nothing_is_named_where_nothing_was_left_out():
    found = diagnose(lab_day(Drive({**RIG, **COUNTS})))
    assert found.verdict == "no_mismatch"
    assert found.findings == ()
    assert found.before_rms == pytest.approx(found.after_rms)


def _searched(gains, first, last, variable="u"):
    """A search that named effects with these gains; free shapes by what they predict, before and after."""

    def shapes(predicted):
        return tuple(
            SimpleNamespace(predicted=p, probability=0.01, variable=variable, where="cart_1") for p in predicted
        )

    steps = tuple(SimpleNamespace(rival=SimpleNamespace(gain=g, name=("cogging", "drivetrain"))) for g in gains)
    return SimpleNamespace(
        steps=steps, first_shapes=shapes(first), last_shapes=shapes(last), stages=("first",), last="last"
    )


@pytest.mark.parametrize(
    ("gains", "first", "last", "unnamed", "overrules"),
    [
        ([], [0.2], [0.2], (0.2, "last"), False),
        ([], [0.02], [0.02], None, False),
        # goes far beyond the names, before them or beside them
        ([0.1], [0.3], [0.01], (0.3, "first"), True),
        ([0.02], [0.03], [0.07], (0.07, "last"), True),
        # beside names that explain most of it
        ([0.3], [0.3], [0.1], (0.1, "last"), False),
        ([0.9], [0.9], [0.3], None, False),
    ],
)
def test_a_shape_beyond_all_names_overrules_them(gains, first, last, unnamed, overrules):
    found = _searched(gains, first, last)
    left, over = left_unnamed(found)
    assert (left and (left[0].predicted, left[1])) == unnamed
    assert over == (found.steps if overrules else ())


def test_a_force_along_the_track_that_is_left_overrules_the_name_of_a_piece_of_it():
    found = _searched([0.3], [0.3], [0.1], ALONG_TRACK)
    left, over = left_unnamed(found)
    assert left is not None
    assert over == found.steps
    found.steps[0].rival.name = ("stribeck", "cart_1")
    assert left_unnamed(found)[1] == ()


@pytest.mark.parametrize(("second", "overruled"), [(0.1, 2), (0.3, 1)])
def test_what_was_found_beside_an_overruled_name_is_held_against_the_shape_by_itself(second, overruled):
    found = _searched([0.2, second], [0.3], [0.2], ALONG_TRACK)
    found.steps[1].rival.name = ("presliding", "cart_1")
    assert len(left_unnamed(found)[1]) == overruled
