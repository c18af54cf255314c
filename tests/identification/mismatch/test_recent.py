"""What was found lately is handed out again, unchanged, and the oldest is forgotten."""

import numpy as np
import pytest

from identification.mismatch.recent import Recent


def test_the_one_not_asked_for_longest_is_forgotten():
    recent, asked = Recent(2), []

    def find(key):
        def found():
            asked.append(key)
            return np.zeros(3)

        return recent.of(key, found)

    for key in "abacab":
        find(key)
    # c takes the place of b, which was asked for before a
    assert asked == ["a", "b", "c", "b"]


def test_what_is_handed_out_cannot_be_written_to():
    found = Recent(1).of("key", lambda: np.zeros(3))
    with pytest.raises(ValueError, match="read-only"):
        found[0] = 1.0
