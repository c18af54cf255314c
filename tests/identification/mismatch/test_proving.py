"""What is found must be seen in recordings kept away, each with its own friction."""

import math
from types import SimpleNamespace

import pytest

from identification.mismatch.comes_again import Again
from identification.mismatch.crew import Crew
from identification.mismatch.proof import Proof
from identification.mismatch.prove import own_friction
from tests.drive.drives import RIG
from tests.identification.mismatch.lab import SHORT, short_day, workbench

# a finding that chance would hardly reach in the search, seen among comparable residuals
STEP = SimpleNamespace(probability=0.008, view="comparable", suspected=False)


@pytest.mark.parametrize(
    ("share", "learnt", "kept", "ratio", "holds"),
    [
        (0.3, 0.3, 0.2, 0.9, True),
        # rough track hides what recordings kept away have among comparable residuals
        (0.05, 0.05, 0.03, 1.001, True),
        # the more the louder the day
        (0.137, 0.137, 0.096, 1.011, True),
        (0.137, 0.137, 0.01, 1.011, False),
        # an effect that is there makes a plain fit worse when another one is missing beside it
        (0.417, 0.417, 0.413, 1.089, True),
        (0.2, 0.2, 0.2, 1.089, False),
        # but not what is small as well
        (0.015, 0.015, 0.03, 1.001, False),
        (0.015, 0.015, 0.03, 0.98, True),
        (0.015, 0.015, -0.1, 0.98, False),
        (0.05, 0.05, 0.001, 1.001, False),
        (0.05, 0.001, 0.03, 0.96, False),
        # lower plain rms alone will do, unless comparable residuals are plainly against it
        (0.132, 0.132, -0.05, 0.9887, True),
        (0.066, 0.012, -0.0135, 0.985, False),
        # a spring that hardens is little in the motion it was learnt from
        (0.0043, 0.0043, 0.042, 0.84, True),
        (0.0043, 0.0043, 0.042, 0.97, False),
        (0.0043, 0.0043, 0.01, 0.84, False),
    ],
)
def test_what_is_small_must_be_plain_in_recordings_kept_away(share, learnt, kept, ratio, holds):
    assert Proof(STEP, 8.0, 8.0, share, learnt, kept, ratio).holds is holds


def test_every_run_is_met_with_its_own_friction():
    rubbing = {"d2": 1.3 * RIG["d2"]}
    day = [*short_day(kinds=SHORT[1:2]), *short_day(rubbing, kinds=SHORT[1:2])]
    with Crew(2) as pool:
        bench = workbench(day, pool)
        bench.weigh(bench.residual(RIG))
        usual, other = own_friction(bench, RIG, 0.1)
    assert usual["d2"] == pytest.approx(RIG["d2"], rel=0.06)
    assert other["d2"] == pytest.approx(rubbing["d2"], rel=0.06)
    # nothing but friction is a run's own
    assert {k: v for k, v in other.items() if k[0] != "d"} == {k: v for k, v in RIG.items() if k[0] != "d"}


@pytest.mark.parametrize(
    ("steady", "kept", "ratio", "holds"),
    [(3.2, -0.003, 0.991, True), (1.2, -0.003, 0.991, False), (3.2, -0.003, 1.002, False), (3.2, -0.05, 0.995, False)],
)
def test_what_all_recordings_learnt_from_foretell_stands_if_those_kept_away_do_not_object(steady, kept, ratio, holds):
    assert Proof(STEP, 8.0, 8.0, 0.03, 0.03, kept, ratio, steady=steady).holds is holds


@pytest.mark.parametrize(
    ("share", "kept", "steady", "plain"),
    [
        (0.3, 0.01, 0.0, True),
        (0.1, 0.11, 1.2, True),
        (0.017, 0.01, 2.7, True),
        (0.08, 0.03, 0.9, False),
        # a hardening spring beside a hysteresis with another law
        (0.038, 0.073, 0.3, False),
    ],
)
def test_a_second_name_is_plain_by_what_it_explains_what_it_predicts_or_how_steadily(share, kept, steady, plain):
    assert Proof(STEP, 8.0, 8.0, share, share, kept, 0.98, steady=steady).plain_beside is plain


@pytest.mark.parametrize(
    ("kept", "steady", "comparable", "weighted", "holds"),
    [
        # as large as foretold, though rough tracks hide it among plain residuals
        (0.02, 1.4, Again(0.83, 0.12, 0.004), Again(-0.2, 0.9, 0.57), True),
        # chance points as much along it
        (0.02, 1.4, Again(0.83, 0.12, 0.03), Again(-0.2, 0.9, 0.57), False),
        # plainly there, but not the size of it: it only resembles what is
        (0.02, 1.4, Again(1.9, 0.3, 0.004), Again(0.9, 0.3, 0.1), False),
        (0.02, 1.4, Again(0.9, 0.3, 0.004), Again(-0.2, 0.35, 0.7), False),
        # comparable residuals grow
        (-0.05, 1.4, Again(1.05, 0.38, 0.008), Again(0.5, 0.67, 0.2), False),
        # recordings learnt from do not foretell it of one another
        (0.046, -1.7, Again(1.16, 0.16, 0.004), Again(0.43, 0.62, 0.25), False),
    ],
)
def test_what_comes_again_as_large_as_it_was_stands(kept, steady, comparable, weighted, holds):
    again = {"comparable": comparable, "weighted": weighted}
    assert Proof(STEP, 8.0, 8.0, 0.012, 0.012, kept, 1.03, steady=steady, again=again).holds is holds


@pytest.mark.parametrize(
    ("share", "again", "beside"),
    [
        (0.1, {"comparable": Again(0.87, 0.04, 0.004), "weighted": Again(0.2, 0.4, 0.3)}, True),
        # one view is enough, and two effects may bend each other's sizes
        (0.1, {"comparable": Again(0.23, 0.09, 0.008), "weighted": Again(0.76, 0.26, 0.004)}, True),
        (0.1, {"comparable": Again(1.64, 0.11, 0.004), "weighted": Again(1.68, 0.65, 0.008)}, True),
        # what the law of a larger finding lacks does not come again, or less, or chance points as much along it
        (0.1, {"comparable": Again(-0.03, 0.13, 0.61), "weighted": Again(-0.24, 0.13, 0.95)}, False),
        (0.1, {"comparable": Again(0.23, 0.09, 0.008), "weighted": Again(0.3, 0.1, 0.004)}, False),
        (0.1, {"comparable": Again(0.62, 0.28, 0.017), "weighted": Again(0.77, 0.62, 0.13)}, False),
        # what explains much is not what a law lacks
        (0.24, {"comparable": Again(0.19, 0.08, 0.008), "weighted": Again(0.7, 0.35, 0.033)}, True),
        # one recording leaves none to ask
        (0.1, {}, True),
    ],
)
def test_beside_a_larger_finding_another_must_come_again_and_not_plainly_smaller(share, again, beside):
    assert Proof(STEP, 8.0, 8.0, share, share, 0.1, 0.97, steady=3.0, again=again).beside is beside


@pytest.mark.parametrize(
    ("learnt", "searched", "again", "ratio", "holds"),
    [
        (0.015, 0.1, 0.004, 0.9, True),
        # both together are not seldom enough
        (0.015, 0.1, 0.02, 0.9, False),
        (0.015, 0.04, 0.02, 0.9, True),
        # a suspicion must lower the error of recordings kept away as any finding must, and be more than the least
        (0.015, 0.1, 0.004, 1.03, False),
        (0.006, 0.1, 0.004, 0.9, False),
    ],
)
def test_what_is_only_suspected_stands_if_search_and_recordings_kept_away_make_it_certain(
    learnt, searched, again, ratio, holds
):
    step = SimpleNamespace(probability=searched, view="comparable", suspected=True)
    proof = Proof(step, 8.0, 8.0, learnt, learnt, 0.05, ratio, again={"comparable": Again(0.9, 0.2, again)})
    assert proof.holds is holds
    # Fisher's: that a product of two numbers between 0 and 1 is as small
    assert proof.probability == pytest.approx(searched * again * (1.0 - math.log(searched * again)))


def test_what_is_chosen_beside_something_rarer_is_no_suspicion():
    """Of what is plainly there the best is taken up, though chance feeds it more often: dry friction of a carriage."""
    step = SimpleNamespace(probability=0.033, view="comparable", suspected=False)
    assert Proof(step, 8.0, 8.0, 0.35, 0.35, 0.54, 0.68).holds
