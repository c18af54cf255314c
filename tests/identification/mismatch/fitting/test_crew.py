"""Work that is shared out within work that was shared out."""

import threading

import pytest

from identification.mismatch.fitting.crew import Crew


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_items_come_in_order(threads):
    with Crew(threads) as crew:
        assert list(crew.map(lambda a, b: a - b, range(20), range(0, 40, 2))) == [-i for i in range(20)]
        assert list(crew.map(abs, [])) == []


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_a_task_may_map(threads):
    with Crew(threads) as crew:
        found = crew.map(lambda i: sum(crew.map(lambda j: i * j, range(5))), range(8))
        assert list(found) == [10 * i for i in range(8)]


def test_no_more_threads_work_than_were_asked_for():
    both = threading.Barrier(2)
    with Crew(2) as crew:
        who = set(crew.map(lambda _: (both.wait(5.0), threading.get_ident())[1], range(2)))
    assert len(who) == 2
    assert threading.get_ident() in who
    with Crew(1) as crew:
        assert set(crew.map(lambda _: threading.get_ident(), range(5))) == {threading.get_ident()}


def test_an_error_reaches_who_asked():
    def fails(i):
        raise ValueError(f"item {i}")

    with Crew(2) as crew, pytest.raises(ValueError, match="item"):
        crew.map(fails, range(3))
