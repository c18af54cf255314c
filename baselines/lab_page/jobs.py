"""Computations that take long, each a ``flexdrive`` command in a process of its own: a crash there leaves the page alive."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

from baselines.lab_page import texts

# of a whole diagnosis on a slow machine
_LONGEST_S = 3600.0
_LARGEST_LINE = 64_000_000
_PREFIX = "flexdrive: "
# commands of all visitors that run at the same time
_AT_ONCE = 2


class JobError(RuntimeError):
    """A command that ended without an answer; the message is for the visitor."""


class Job:
    """One visitor's computation at a time."""

    def __init__(self) -> None:
        self._process: asyncio.subprocess.Process | None = None
        self._cancelled = False

    @property
    def running(self) -> bool:
        """Whether a command runs now."""
        return self._process is not None

    def cancel(self) -> None:
        """End the command that runs, with everything it started."""
        process = self._process
        if process is not None and process.returncode is None:
            self._cancelled = True
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGTERM) if os.name == "posix" else process.terminate()

    async def run(self, arguments: Sequence[str], tell: Callable[[str], None]) -> dict[str, Any]:
        """Run ``flexdrive ARGUMENTS --json`` and return its answer.

        Parameters
        ----------
        arguments
            Command and options.
        tell
            Called with each stage.

        Raises
        ------
        JobError
            With the command's own sentence, where it fails, crashes or is cancelled.
        """
        if self.running:
            raise JobError(texts.BUSY)
        self._cancelled = False
        environment = os.environ | {"FLEXDRIVE_PROGRESS": "lines", "PYTHONUNBUFFERED": "1"}
        async with _gate():
            self._process = await asyncio.create_subprocess_exec(
                sys.executable, "-m", "baselines.cli", *arguments, "--json",
                stdin=asyncio.subprocess.DEVNULL, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.PIPE,
                env=environment, limit=_LARGEST_LINE, start_new_session=True,
            )  # fmt: skip
            try:
                async with asyncio.timeout(_LONGEST_S):
                    answer, reason = await asyncio.gather(
                        _read(self._process.stdout), _stages(self._process.stderr, tell)
                    )
                    code = await self._process.wait()
            except TimeoutError:
                self.cancel()
                raise JobError(f"{arguments[0]}: longer than {_LONGEST_S:g} s") from None
            finally:
                if self._process.returncode is None:
                    self.cancel()
                self._process = None
        if self._cancelled:
            raise JobError(texts.CANCELLED)
        if code != 0:
            why = reason or texts.CRASHED.format(code=code)
            raise JobError(texts.FAILED.format(what=f"flexdrive {arguments[0]}", reason=why))
        found: dict[str, Any] = json.loads(answer)
        return found


_gates: dict[asyncio.AbstractEventLoop, asyncio.Semaphore] = {}


def _gate() -> asyncio.Semaphore:
    return _gates.setdefault(asyncio.get_running_loop(), asyncio.Semaphore(_AT_ONCE))


async def _read(stream: asyncio.StreamReader | None) -> str:
    assert stream is not None
    return (await stream.read()).decode("utf-8", "replace")


async def _stages(stream: asyncio.StreamReader | None, tell: Callable[[str], None]) -> str:
    """Tell every stage; return the command's error, which may have several lines, or nothing."""
    assert stream is not None
    error: list[str] = []
    async for line in stream:
        words = line.decode("utf-8", "replace").rstrip()
        if error or words.startswith(_PREFIX):
            error.append(words)
        elif words:
            tell(words)
    return "\n".join(error).removeprefix(_PREFIX)
