"""The compiled step in MATLAB: its Python source, specialised for one drive and written down in the other language.

The step, the friction's events and every effect are plain functions on scalars (:mod:`flexdrive_gym.drive`). Their syntax trees
are walked from an entry point; what is known of the drive is decided on the way (which effects are present, where their
parameters and states are), and what remains is written as MATLAB. So there is one physics: an effect that is added to the
catalogue can be exported at once, and the exported step does the same operations in the same order as ours.

Known and left out: the table of a linear drive (the integrator that fills it is used itself), anchors and forces of a replay.
Arrays that a function writes (``z``, ``memory``) become outputs, since MATLAB passes values.
"""

from __future__ import annotations

import ast
import inspect
import re
import textwrap
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from itertools import count
from typing import Any

from baselines.export.translation.function import Function, Scope, UntranslatableError, parameters_of
from baselines.export.translation.placement import Placement, field_name
from baselines.export.translation.statements import Writer
from flexdrive_gym.drive.effects import ARGUMENTS, LAYOUT, REMEMBERING
from flexdrive_gym.drive.effects.motor_gear_backlash import EFFECT as BACKLASH


@dataclass
class Translation:
    """A translated step.

    Attributes
    ----------
    functions
        Their text, entry points first.
    entries
        How each entry point is called on a ``state`` of the template.
    parameters
        Keys of the drive's parameters that the functions read, in the drive's order.
    cells
        How many numbers the effects remember, and what each is, counted from 1.
    """

    functions: str
    entries: list[str]
    parameters: list[str]
    cells: dict[int, str]


class Translator:
    """Translate functions of the step for one drive.

    Parameters
    ----------
    present
        (effect id, place) of the effects beyond the base that the drive has.
    constants
        Factors on constants with a unit, by name: the step may run in other units than the lab's.
    """

    def __init__(self, present: Collection[tuple[str, str]], constants: Mapping[str, float] | None = None) -> None:
        self._placement = Placement(present, constants or {})
        self._done: dict[Any, Function] = {}
        self._order: list[Function] = []
        self._taken: set[str] = set()
        self._count = count()
        self._entries: set[Callable[..., Any]] = set()

    def translate(self, *entries: Callable[..., Any], **bound: Any) -> Translation:
        """Translate entry points and everything they call.

        Raises
        ------
        UntranslatableError
            For a construct that is not known here, naming it.
        """
        self._entries = set(entries)
        begun = [self.function(e, {k: v for k, v in bound.items() if k in parameters_of(e)}) for e in entries]
        marked = {f.mark: f for f in self._order}
        # what was written in place of its calls is called no more
        wanted, found = [f.mark for f in begun], list[str]()
        while wanted:
            mark = wanted.pop(0)
            if mark not in found:
                found.append(mark)
                wanted += re.findall(r"@\d+@", marked[mark].text)
        text = "\n\n".join(marked[mark].text for mark in found)
        text = re.sub(r"@\d+@", lambda mark: marked[mark[0]].name, text)
        fields = set(re.findall(r"\bp\.(\w+)", text))
        keys = ["m1", "m2", *(key for key in LAYOUT if field_name(key) in fields)]
        return Translation(text, [_entry_call(f) for f in begun], keys, self._placement.cells)

    def function(self, called: Callable[..., Any], bound: Mapping[str, Any], name: str = "") -> Function:
        """Return the function for these deciding arguments, translated once."""
        plain = getattr(called, "py_func", called)
        key = (plain, tuple(sorted(bound.items(), key=lambda item: item[0])))
        if key not in self._done:
            which = getattr(plain, "chain", None)
            if which is not None:
                tree, scope, given = self._chain(*which)
            else:
                tree = ast.parse(textwrap.dedent(inspect.getsource(plain))).body[0]
                scope, given = plain.__globals__, plain.__name__.strip("_")
                if given in self._taken:
                    given = f"{plain.__module__.rpartition('.')[2]}_{given}"
            if not isinstance(tree, ast.FunctionDef):
                raise UntranslatableError(f"function: must be a function; got {plain!r}.")
            done = Function(self._named(name or given), f"@{next(self._count)}@")
            writer = Writer(self._placement, self.function, tree, scope, bound, plain.__module__, done)
            same = writer.write(self._order, keep=plain in self._entries)
            if same is not None:
                # a mere wrapper: what it calls takes its name
                self._taken.discard(same.name)
                same.name, done.mark = done.name, same.mark
            else:
                self._order.append(done)
            self._done[key] = done
        return self._done[key]

    def _named(self, wanted: str) -> str:
        name, i = wanted, 2
        while name in self._taken:
            name, i = f"{wanted}_{i}", i + 1
        self._taken.add(name)
        return name

    def _chain(self, site: str, where: str | None) -> tuple[ast.stmt, Scope, str]:
        """Return the chain of the hooks that are present, as source of its own."""
        scope: dict[str, Any] = {}
        lines = []
        hooks = self._placement.active(site, where)
        for hook, slot in hooks:
            places = f"_{slot.where}" if len(slot.effect.where) > 1 else ""
            name = f"{slot.effect.id}{places}_{hook.__name__.strip('_')}"
            scope[name] = hook
            remembers = f"z, {self._placement.own(slot)}" if site in REMEMBERING else ""
            arguments = ["acc", ARGUMENTS[site], remembers, f"p, {slot.base_index}"]
            lines.append(f"{name}({', '.join(a for a in arguments if a)})")
        signature = ", ".join(a for a in ("acc", ARGUMENTS[site], "z, r, p") if a)
        if 1 <= len(lines) <= 2:
            # one expression, which may be short enough to stand where the chain is called
            body = "return " + lines[-1].replace("(acc", f"({lines[0]}", 1) if len(lines) == 2 else f"return {lines[0]}"
        else:
            body = "\n    ".join([*(f"acc = {line}" for line in lines), "return acc"])
        names = "_".join(part for part in (site, where) if part)
        return ast.parse(f"def {site}({signature}):\n    {body}\n").body[0], scope, f"all_{names}"


# what the arguments of an entry point are in a function that holds a state
_IN_STATE = {
    "memory": "state.memory", "z": "state.z", "sample_time": "p.Ts", "substeps": "p.substeps", "t": "state.n * p.Ts",
    "command": "u",
}  # fmt: skip
_AT_START = {"x1": "x(1)", "v1": "x(2)", "x2": "x(3)", "v2": "x(4)"}


def _entry_call(entry: Function) -> str:
    known = _IN_STATE if "command" in entry.given else _IN_STATE | _AT_START
    given = ", ".join(known.get(name, name) for name in entry.parameters)
    outputs = ", ".join([*entry.outputs, *(_IN_STATE[name] for name in entry.writes)])
    return f"[{outputs}] = {entry.name}({given});"


def constants_in(units_one: Callable[[str], float]) -> dict[str, float]:
    """Return the factors by which constants with a unit change, for units of which one holds so many of the lab's."""
    module = BACKLASH.id
    return {f"{module}._LAMBDA": 1.0 / units_one("s/mm")}
