"""Threads that lend a hand: nested maps end, in order, with no more threads at work than there are."""

import threading
import time

import pytest

from identification.mismatch.crew import Crew


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_maps_within_maps_end_and_keep_their_order(threads):
    with Crew(threads) as crew:
        found = crew.map(lambda a: list(crew.map(lambda b: (a, b), range(7))), range(5))
        assert list(found) == [[(a, b) for b in range(7)] for a in range(5)]
        assert list(crew.map(lambda a: a, [])) == []
    # what outlives its crew works alone
    assert list(crew.map(str, range(3))) == ["0", "1", "2"]


def test_never_do_more_threads_work_than_there_are():
    lock, at_work, most = threading.Lock(), 0, 0

    def leaf(_):
        nonlocal at_work, most
        with lock:
            at_work += 1
            most = max(most, at_work)
        time.sleep(0.002)
        with lock:
            at_work -= 1

    with Crew(3) as crew:
        list(crew.map(lambda _: list(crew.map(leaf, range(6))), range(5)))
    assert most == 3


def test_who_has_nothing_to_do_helps_the_last():
    seen = set()

    def slow(_):
        seen.add(threading.get_ident())
        time.sleep(0.005)

    with Crew(2) as crew:
        # one task, whose own map is shared
        list(crew.map(lambda _: list(crew.map(slow, range(20))), [0]))
    assert len(seen) == 2


def test_an_error_is_raised_where_the_map_was_asked_for():
    with Crew(2) as crew:
        with pytest.raises(ZeroDivisionError):
            crew.map(lambda x: 1 / x, [1, 0, 2])
        # and the crew works on
        assert list(crew.map(str, range(3))) == ["0", "1", "2"]


def test_a_crew_of_none_is_refused():
    with pytest.raises(ValueError, match="threads: must be at least 1; got 0"):
        Crew(0)


@pytest.mark.parametrize("asks", [0, 1])
def test_who_is_done_sooner_helps_with_what_the_other_asks_for(asks):
    """Whether a helper becomes free while the map is on its way, or who asked for all waits for the last item."""
    seen, both_at_work = set(), threading.Barrier(2)

    def leaf(_):
        seen.add(threading.get_ident())
        time.sleep(0.005)

    def task(i):
        both_at_work.wait(5.0)
        if i == asks:
            return list(crew.map(leaf, range(20)))
        return time.sleep(0.02)

    with Crew(2) as crew:
        list(crew.map(task, range(2)))
    assert len(seen) == 2
