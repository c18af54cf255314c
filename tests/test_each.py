"""A merged test runs all its cases and names those that fail."""

import pytest

from tests.each import each

SEEN = []


@each("number", [1, 2, pytest.param(3, id="three"), 4], ids=lambda n: f"number {n}")
def odd(number):
    SEEN.append(number)
    assert number % 2


@each(("a", "b"), [(1, 1), (1, 2)])
@each("c", [1])
def equal(a, b, c):
    assert a == b == c


def test_every_case_runs_and_the_failed_are_named():
    with pytest.raises(BaseExceptionGroup, match="2 of 4 cases fail: number 2; number 4") as failed:
        odd()
    assert SEEN == [1, 2, 3, 4]
    assert [error.__notes__ for error in failed.value.exceptions] == [["case: number 2"], ["case: number 4"]]


def test_one_failure_is_raised_as_it_is():
    with pytest.raises(AssertionError) as failed:
        equal()
    assert "case: 1, 2" in failed.value.__notes__


@each("value", [1, 2])
def test_fixtures_are_passed_on(value, tmp_path):
    assert value in (1, 2)
    # a case finds nothing of another
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "left").touch()
