"""The search names one effect, and lists what is as good."""

from types import SimpleNamespace

import pytest

from identification.mismatch.search import _as_good, _rough


def rival(*gains, probability=0.01):
    return SimpleNamespace(gains=gains, probability=probability)


@pytest.mark.parametrize(
    ("other", "tied"),
    [
        (rival(0.01, 0.449), True),
        (rival(0.03, 0.30), False),
        (rival(0.01, 0.449, probability=0.5), False),
    ],
)
def test_what_explains_as_much_where_most_is_explained_is_a_tie(other, tied):
    """A constant force is one on either cart and one on the command: comparable residuals tell them apart by chance."""
    assert _as_good(other, rival(0.03, 0.45)) is tied


@pytest.mark.parametrize(("wave", "rough"), [(0.05, True), (0.09, True), (0.13, False)])
def test_a_track_as_rough_as_those_that_were_measured_is_no_effect(wave, rough):
    """Measured tracks are rough by up to 0.14 of the dry friction (rms), here 0.4 V."""
    values = {"d1": 0.4, "position_friction.cart_1.a_sin": wave, "position_friction.cart_1.P": 40.0}
    candidate = SimpleNamespace(id="position_friction", where="cart_1")
    assert _rough(SimpleNamespace(candidate=candidate, fit=SimpleNamespace(values=values)), 2.5) is rough


def test_another_effect_is_never_a_rough_track():
    candidate = SimpleNamespace(id="cogging", where="drivetrain")
    assert not _rough(SimpleNamespace(candidate=candidate), 2.5)
