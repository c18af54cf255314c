"""Work that is shared out, also from within work that was shared out."""

import threading
import time

import pytest

from identification.mismatch.fitting.thread_pool import ThreadPool


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_items_come_in_order(threads):
    with ThreadPool(threads) as pool:
        assert list(pool.map(lambda a, b: a - b, range(20), range(0, 40, 2))) == [-i for i in range(20)]
        assert list(pool.map(abs, [])) == []


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_a_task_may_map(threads):
    with ThreadPool(threads) as pool:
        found = pool.map(lambda i: sum(pool.map(lambda j: i * j, range(5))), range(8))
        assert list(found) == [10 * i for i in range(8)]


def test_as_many_threads_work_as_were_asked_for():
    both = threading.Barrier(2)
    with ThreadPool(2) as pool:
        who = set(pool.map(lambda _: (both.wait(5.0), threading.get_ident())[1], range(2)))
    assert len(who) == 2
    assert threading.get_ident() in who
    with ThreadPool(1) as pool:
        assert set(pool.map(lambda _: threading.get_ident(), range(5))) == {threading.get_ident()}


def test_while_one_waits_for_anothers_last_item_a_further_one_works():
    """Items that wait for each other: one thread alone would never end them."""
    begun, both, mine = threading.Barrier(2), threading.Barrier(2), threading.get_ident()

    def item(_):
        begun.wait(5.0)
        return [] if threading.get_ident() == mine else list(pool.map(lambda _: both.wait(5.0), range(2)))

    with ThreadPool(2) as pool:
        assert sorted(map(sorted, pool.map(item, range(2)))) == [[], [0, 1]]
        # the thread that maps works; the other has nothing to do
        assert pool.free


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_an_error_in_any_thread_ends_all_of_them(error):
    """An interrupted diagnosis must not finish the fits that nobody asks for any more."""
    both, made = threading.Barrier(2), []
    mine = threading.get_ident()

    def fails(i):
        if i < 2:
            both.wait(5.0)
        if threading.get_ident() == mine:
            raise error(f"item {i}")
        made.append(i)
        time.sleep(0.05)

    with ThreadPool(2) as pool, pytest.raises(error, match="item"):
        pool.map(fails, range(200))
    assert len(made) < 5

    def helper_fails(i):
        if i < 2:
            both.wait(5.0)
        if threading.get_ident() != mine:
            raise error(f"item {i}")

    with ThreadPool(2) as pool, pytest.raises(error, match="item"):
        pool.map(helper_fails, range(2))
