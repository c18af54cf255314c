"""A thread pool whose tasks may use it.

A pool of the standard library waits for itself where one of its tasks maps over it. But fits that are compared take different
times, and the derivatives of each are several simulations. So the thread that maps works, too, those that are free help, and
while one waits for another's last item, a further one works in its place.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor, wait
from threading import Condition
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
        # threads that wait do not work, and need another in their place
        super().__init__(2 * threads)
        self._most, self._working, self._changed = threads, 1, Condition()

    @property
    def free(self) -> bool:
        """Whether fewer threads work at present than may."""
        return self._working < self._most

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

        def help_out() -> None:
            self._begin()
            try:
                work()
            finally:
                self._end()

        others = [self.submit(help_out) for _ in range(min(self._most, len(todo)) - 1)]
        try:
            work()
        finally:
            # who has not begun is not waited for
            begun = [other for other in others if not other.cancel()]
            if begun:
                self._end()
                wait(begun)
                self._begin()
        for other in begun:
            other.result()
        return (found[i] for i in range(len(todo)))

    def _begin(self) -> None:
        with self._changed:
            self._changed.wait_for(lambda: self.free)
            self._working += 1

    def _end(self) -> None:
        with self._changed:
            self._working -= 1
            self._changed.notify()
