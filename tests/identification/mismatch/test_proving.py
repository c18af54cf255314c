"""What is found must be there: in every recording, and as the effect that it is called."""

from types import SimpleNamespace

import pytest

from flexdrive_gym import Drive
from identification.mismatch.candidates import catalogue
from identification.mismatch.proving import Proof, _vanishes
from tests.drive.drives import RIG


@pytest.mark.parametrize(("interval", "vanishes"), [((0.013, 0.035), True), ((0.03, 0.2), False)])
def test_bristles_that_may_be_stiff_are_dry_friction(interval, vanishes):
    name = "presliding", "cart_2"
    values = {**RIG, "presliding.cart_2.fd": 0.02, "presliding.cart_2.xs": 0.05}
    candidate = next(c for c in catalogue() if c.name == name)
    step = SimpleNamespace(rival=SimpleNamespace(candidate=candidate))
    assert _vanishes(step, Drive(values, {"presliding.cart_2.xs": interval})) is vanishes


@pytest.mark.parametrize(
    ("share", "learnt", "kept", "ratio", "holds"),
    [
        (0.3, 0.3, 0.2, 0.9, True),
        # rough track hides what recordings kept away have among comparable residuals
        (0.05, 0.05, 0.03, 1.001, True),
        # but not what is small as well
        (0.015, 0.015, 0.03, 1.001, False),
        (0.015, 0.015, 0.03, 0.98, True),
        (0.015, 0.015, -0.1, 0.98, False),
        (0.05, 0.05, 0.001, 1.001, False),
        (0.05, 0.001, 0.03, 0.9, False),
    ],
)
def test_what_is_small_must_be_plain_in_recordings_kept_away(share, learnt, kept, ratio, holds):
    assert Proof(SimpleNamespace(), 8.0, 8.0, share, learnt, kept, ratio).holds is holds
