"""What was found lately, for several threads: rivals begin at the same drives and are asked for the same residuals."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable

from flexdrive_gym.recording import FloatArray


class Recent:
    """Arrays that were found lately, by what they were found for.

    Parameters
    ----------
    most
        How many are kept.
    """

    def __init__(self, most: int) -> None:
        self._most, self._found, self._lock = most, OrderedDict[Hashable, FloatArray](), threading.Lock()

    def of(self, key: Hashable, find: Callable[[], FloatArray]) -> FloatArray:
        """Return what was found for a key, not to be written to; find it if need be."""
        with self._lock:
            if key in self._found:
                self._found.move_to_end(key)
                return self._found[key]
        found = find()
        found.flags.writeable = False
        with self._lock:
            self._found[key] = found
            while len(self._found) > self._most:
                self._found.popitem(last=False)
        return found
