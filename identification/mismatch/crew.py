"""Threads that lend a hand: a map within a map uses those that have nothing else to do.

A diagnosis refits some rivals side by side, each a chain of many small maps over the recordings. When fewer rivals are left than
threads, a pool of the standard library lets the others wait, and a map that its own workers ask for can never end.
Here whoever asks works, too, and takes along as many others as are free. Who becomes free later joins the oldest map with
items left, and who waits for the last items of a map of their own helps with the maps that those ask for.
"""

from __future__ import annotations

import itertools
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from typing import Any


class _Map:
    """One map on its way: what is left to do, at work and done."""

    def __init__(self, number: int, fn: Callable[..., Any], items: list[Any]) -> None:
        self.number, self.fn, self.items = number, fn, items
        self.results: list[Any] = [None] * len(items)
        self.errors: list[BaseException] = []
        self.begun = self.at_work = 0

    @property
    def has_items(self) -> bool:
        return not self.errors and self.begun < len(self.items)

    def work(self, i: int) -> None:
        try:
            self.results[i] = self.fn(*self.items[i])
        except BaseException as error:  # noqa: BLE001  (raised where the map was asked for)
            self.errors.append(error)


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
        self._threads, self._free = threads, threads - 1
        self._others = ThreadPoolExecutor(max(threads - 1, 1))
        self._changed = threading.Condition()
        self._open: list[_Map] = []
        self._numbers = itertools.count()

    @property
    def threads(self) -> int:
        """How many work at once."""
        return self._threads

    def map(self, fn: Callable[..., Any], *iterables: Iterable[Any], **_: Any) -> Iterator[Any]:
        """Return the results in order, all of them ready; the first error of any item is raised when no item is at work."""
        job = _Map(next(self._numbers), fn, list(zip(*iterables, strict=False)))
        if len(job.items) > 1 and self._threads > 1:
            with self._changed:
                self._open.append(job)
                for _helper in range(min(len(job.items) - 1, self._free)):
                    self._free -= 1
                    self._others.submit(self._help_out)
                # those that wait can help, too
                self._changed.notify_all()
        while (task := self._next_of(job)) is not None:
            self._do(*task)
        if job.errors:
            raise job.errors[0]
        return iter(job.results)

    def _next_of(self, job: _Map) -> tuple[_Map, int] | None:
        """Return what who asked for a map does next; None when all of it is done."""
        with self._changed:
            while True:
                if job.has_items:
                    return self._begin(job)
                if not job.at_work:
                    self._close(job)
                    return None
                # what was asked for later may be what the last items wait for
                later = next((m for m in self._open if m.number > job.number and m.has_items), None)
                if later is not None:
                    return self._begin(later)
                self._changed.wait()

    def _help_out(self) -> None:
        while True:
            with self._changed:
                oldest = next((m for m in self._open if m.has_items), None)
                if oldest is None:
                    self._free += 1
                    return
                task = self._begin(oldest)
            self._do(*task)

    def _begin(self, job: _Map) -> tuple[_Map, int]:
        i = job.begun
        job.begun, job.at_work = job.begun + 1, job.at_work + 1
        if not job.has_items:
            self._close(job)
        return job, i

    def _close(self, job: _Map) -> None:
        if job in self._open:
            self._open.remove(job)

    def _do(self, job: _Map, i: int) -> None:
        job.work(i)
        with self._changed:
            job.at_work -= 1
            if not job.at_work and not job.has_items:
                self._changed.notify_all()

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Let the others go; whoever asks from now on works alone."""
        self._threads, self._free = 1, 0
        self._others.shutdown(wait, cancel_futures=cancel_futures)
