"""Threads that lend a hand: a map within a map uses those that have nothing else to do.

A diagnosis refits some rivals side by side, each a chain of many small maps over the recordings. When fewer rivals are left than
threads, a pool of the standard library lets the others wait, and a map that its own workers ask for can never end.
Here whoever asks works, too, and takes along as many others as are free at that moment.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor, wait
from typing import Any


class Crew(Executor):
    """Threads for maps, which may be nested, and nothing else; results come in order, however many threads there are.

    Parameters
    ----------
    threads
        How many work at once, the one that asks among them; at least 1.
    """

    def __init__(self, threads: int) -> None:
        if threads < 1:
            raise ValueError(f"threads: must be at least 1; got {threads}. One thread is the one that asks.")
        self._free = threading.Semaphore(threads - 1)
        self._others = ThreadPoolExecutor(max(threads - 1, 1))
        self._threads = threads

    @property
    def threads(self) -> int:
        """How many work at once."""
        return self._threads

    def map(self, fn: Callable[..., Any], *iterables: Iterable[Any], **_: Any) -> Iterator[Any]:
        """Return the results in order, all of them ready; the first error of any item is raised when no item is at work."""
        items = list(zip(*iterables, strict=False))
        results: list[Any] = [None] * len(items)
        todo, errors = iter(range(len(items))), list[BaseException]()
        lock = threading.Lock()

        def work() -> None:
            while True:
                with lock:
                    i = None if errors else next(todo, None)
                if i is None:
                    return
                try:
                    results[i] = fn(*items[i])
                except BaseException as error:  # noqa: BLE001  (raised where the map was asked for)
                    errors.append(error)

        def help_out() -> None:
            try:
                work()
            finally:
                self._free.release()

        helpers: list[Future[None]] = []
        while len(helpers) < min(len(items), self._threads) - 1 and self._free.acquire(blocking=False):
            helpers.append(self._others.submit(help_out))
        work()
        wait(helpers)
        if errors:
            raise errors[0]
        return iter(results)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Let the others go; whoever asks from now on works alone."""
        self._threads = 1
        self._others.shutdown(wait, cancel_futures=cancel_futures)
