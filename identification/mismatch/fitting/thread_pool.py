"""A thread pool whose tasks may use it.

A pool of the standard library waits for itself where one of its tasks maps over it. But fits that are compared take different
times, and the derivatives of each are several simulations. So the thread that maps works, too, and those that are free help.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

T = TypeVar("T")


class ThreadPool(ThreadPoolExecutor):
    """A thread pool of which the thread that maps is one.

    Parameters
    ----------
    threads
        How many work at once.
    """

    def __init__(self, threads: int) -> None:
        # a pool has one thread at least, even where it has nothing to do
        super().__init__(max(threads - 1, 1))
        self._others = threads - 1

    def map(
        self,
        fn: Callable[..., T],
        *iterables: Iterable[Any],
        timeout: float | None = None,  # noqa: ARG002
        chunksize: int = 1,  # noqa: ARG002
    ) -> Iterator[T]:
        """Return what a function makes of the items, in their order, when all are made.

        Every item is made by itself, so the number of threads changes nothing. An error or an interruption ends all threads after
        the items that they have begun. ``timeout`` and ``chunksize`` are those of the base class and mean nothing here.
        """
        todo = list(zip(*iterables, strict=False))
        found: dict[int, T] = {}
        # a step of this iterator is never divided between threads
        left = iter(range(len(todo)))

        def work() -> None:
            try:
                while (i := next(left, None)) is not None:
                    found[i] = fn(*todo[i])
            except BaseException:
                list(left)
                raise

        others = [self.submit(work) for _ in range(min(self._others, len(todo) - 1))]
        try:
            work()
        finally:
            # who has not begun is not waited for
            begun = [other for other in others if not other.cancel()]
        for other in begun:
            other.result()
        return (found[i] for i in range(len(todo)))
