"""The search names one effect, and lists what is as good."""

from types import SimpleNamespace

import pytest

from identification.mismatch.search import _as_good


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
