"""The ``info`` of a step, made only when somebody looks.

Making fifteen numbers into a dictionary takes longer than the physics of a step, and most steps' ``info`` nobody reads. So a
step returns a dictionary that knows where its numbers are recorded and fills itself at the first use; from then on it is
like any other. The record is not written again as long as the dictionary exists, so it does not matter when that is.

Code that reads a dictionary's memory without asking its methods (few C extensions do) sees one entry, ``x1``: ``None``;
``dict(info)`` is an ordinary dictionary.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flexdrive_gym.fleet import KEYS
from flexdrive_gym.recording import FloatArray

# Not empty, because some C code (the encoder of json) asks for the size of a dictionary before it asks for its items.
PLACEHOLDER: dict[str, Any] = {KEYS[0]: None}


class Info(dict[str, Any]):
    """Physical units and terms of the reward of one step; :data:`~flexdrive_gym.fleet.KEYS` to floats."""

    __slots__ = ("record",)
    record: FloatArray | None

    # copies and pickles are plain dictionaries
    def __reduce_ex__(self, protocol: Any) -> tuple[Any, ...]:
        return dict, (dict(self),)


class Unread(Info):
    """One that nobody looked at yet; ``record`` has its numbers."""

    __slots__ = ()


def _read(info: Unread) -> None:
    """Fill it and make it an ordinary dictionary, with the speed of one."""
    info.__class__ = Info  # type: ignore[assignment]
    record = getattr(info, "record", None)
    if record is not None:
        info.update(zip(KEYS, record.tolist(), strict=True))
        info.record = None


def unread(record: FloatArray) -> Unread:
    """Return a dictionary of the numbers in ``record``, shape (keys,), which shall not change before it is read."""
    info = Unread(PLACEHOLDER)
    info.record = record
    return info


def _reading(name: str) -> Callable[..., Any]:
    def method(self: Unread, *arguments: Any, **named: Any) -> Any:
        _read(self)
        return getattr(self, name)(*arguments, **named)

    method.__name__ = name
    return method


for _name in (
    "__contains__", "__delitem__", "__eq__", "__getitem__", "__ior__", "__iter__", "__len__", "__ne__", "__or__",
    "__repr__", "__reversed__", "__ror__", "__setitem__", "clear", "copy", "get", "items", "keys", "pop", "popitem",
    "setdefault", "update", "values",
):  # fmt: skip
    setattr(Unread, _name, _reading(_name))
