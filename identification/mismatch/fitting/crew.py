"""Threads whose tasks may share out work themselves.

A pool of the standard library waits for itself where one of its tasks maps over it. But fits that are compared take different
times, and the derivatives of each are several simulations. So the thread that asks works, too, and those that are free help.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

T = TypeVar("T")


class Crew(ThreadPoolExecutor):
    """A thread pool of which the one that maps is a thread.

    Parameters
    ----------
    threads
        How many work at once.
    """

    def __init__(self, threads: int) -> None:
        # a pool has one thread at least, even where it has nothing to do
        super().__init__(max(threads - 1, 1))
        self._helpers = threads - 1

    def map(
        self, fn: Callable[..., T], *iterables: Iterable[Any], timeout: float | None = None, chunksize: int = 1
    ) -> Iterator[T]:
        """Return what a function makes of the items, in their order; each is made by itself, whatever the number of threads."""
        del timeout, chunksize
        todo = list(zip(*iterables, strict=False))
        found: dict[int, T] = {}
        # a step of this iterator is never divided between threads
        left = iter(range(len(todo)))

        def work() -> None:
            while (i := next(left, None)) is not None:
                found[i] = fn(*todo[i])

        helpers = [self.submit(work) for _ in range(min(self._helpers, len(todo) - 1))]
        try:
            work()
        finally:
            # who has not begun is not waited for
            begun = [helper for helper in helpers if not helper.cancel()]
        for helper in begun:
            helper.result()
        return (found[i] for i in range(len(todo)))
