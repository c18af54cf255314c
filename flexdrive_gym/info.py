"""The ``info`` of a step, made only when somebody looks.

Making fifteen numbers into a dictionary takes longer than the physics of a step, and most steps' ``info`` nobody reads. So a
step returns a dictionary that has its numbers as bytes and fills itself at the first use; from then on it is like any other.

Code that reads a dictionary's memory without asking its methods (few C extensions do) sees one entry, ``x1``: ``None``;
``dict(info)`` is an ordinary dictionary.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flexdrive_gym.fleet import KEYS

# Not empty, because some C code (the encoder of json) asks for the size of a dictionary before it asks for its items.
PLACEHOLDER: dict[str, Any] = {KEYS[0]: None}


class Info(dict[str, Any]):
    """Physical units and terms of the reward of one step; :data:`~flexdrive_gym.fleet.KEYS` to floats."""

    __slots__ = ("record",)
    record: bytes | None

    # copies and pickles are plain dictionaries
    def __reduce_ex__(self, protocol: Any) -> tuple[Any, ...]:
        return dict, (dict(self),)


class Unread(Info):
    """One that nobody looked at yet; ``record`` has its numbers. Made by ``Unread(PLACEHOLDER)``."""

    __slots__ = ()


def _read(info: Unread) -> None:
    """Fill it and make it an ordinary dictionary, with the speed of one."""
    info.__class__ = Info  # type: ignore[assignment]
    record = getattr(info, "record", None)
    if record is not None:
        info.update(zip(KEYS, memoryview(record).cast("d"), strict=True))
        info.record = None


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
