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
import math
import re
import textwrap
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import count
from typing import Any, NoReturn

import numpy as np

from flexdrive_gym.drive import effects, forces, piece
from flexdrive_gym.drive.effects import ARGUMENTS, FLAG, LAYOUT, N_STATES, REMEMBERING, ROWS, Slot, hooks_of
from flexdrive_gym.drive.simd import pack
from flexdrive_gym.drive.effects.motor_gear_backlash import EFFECT as BACKLASH

Scope = Mapping[str, Any]

_ARRAYS = ("z", "memory")
# parameters of functions that a specialised step does without; ``c`` is another name of ``z`` where there is a workspace
_DROPPED = {"table", "c"}
# arguments that decide which variant of a function is called
_DECIDING = {"o", "oz", "r", "step"}
_ZERO = {"ANCHOR_1", "ANCHOR_2", "PUSH_1", "PUSH_2", "LEVEL_1", "LEVEL_2"}
_NOTES = ("BEGIN_1", "BEGIN_2", "BEGIN_T", "RECOIL")
_LIBRARY: dict[Any, str] = {
    np.exp: "exp", np.sin: "sin", np.cos: "cos", np.sqrt: "sqrt", np.floor: "floor", math.exp: "exp",
    abs: "abs", max: "max", min: "min", int: "fix",
}  # fmt: skip
_SAME = (pack.anywhere, pack.leading, np.int64)
_BINARY: dict[type[ast.operator], tuple[str, int]] = {
    ast.Add: ("+", 5), ast.Sub: ("-", 5), ast.Mult: ("*", 6), ast.Div: ("/", 6), ast.Pow: ("^", 8),
    ast.BitAnd: ("&&", 1), ast.BitOr: ("||", 0),
}  # fmt: skip
_COMPARES: dict[type[ast.cmpop], str] = {
    ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "~=",
}  # fmt: skip
_ATOM = 9
_LONGEST_INLINE = 100


class Untranslatable(ValueError):
    """A construct of the step's source that is not written in MATLAB."""


@dataclass
class _Function:
    """One function of the step, for one choice of its deciding arguments."""

    name: str
    mark: str
    given: list[str] = field(default_factory=list)
    parameters: list[str] = field(default_factory=list)
    results: int = 0
    outputs: list[str] = field(default_factory=list)
    writes: list[str] = field(default_factory=list)
    text: str = ""
    inline: tuple[str, int] | None = None


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


def field_name(key: str) -> str:
    """Return a parameter's name as a field of MATLAB: ``stribeck.cart_1.vs`` becomes ``stribeck_cart_1_vs``."""
    return key.replace(".", "_")


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
        self._present = set(present)
        self._constants = dict(constants or {})
        self._done: dict[Any, _Function] = {}
        self._order: list[_Function] = []
        self._taken: set[str] = set()
        self._count = count()
        self._entries: set[Callable[..., Any]] = set()
        self._place()

    def _place(self) -> None:
        """Give the states and memory cells of the effects that are present their places, without gaps."""
        own: dict[tuple[str, str], Slot] = {}
        for slot in LAYOUT.values():
            own.setdefault((slot.effect.id, slot.where), slot)
        mine = [slot for which, slot in own.items() if which in self._present]
        self.states, self._state_at = 0, {}
        names = []
        for slot in mine:
            self._state_at[slot.effect.id, slot.where] = self.states
            self.states += len(slot.effect.states)
            names += [f"{slot.effect.id}, {slot.where}: {state}" for state in slot.effect.states]
        rows = ("state", "stage", "slope 1", "slope 2", "slope 3", "slope 4", "trial")
        self.cells = {i + 1: f"{names[i % self.states]} ({rows[i // self.states]})" for i in range(ROWS * self.states)}
        at = ROWS * self.states
        self._note_at = {name: at + i for i, name in enumerate(_NOTES)}
        words = ("x1 where the piece began", "x2 where the piece began", "time when it began", "acceleration of the track")
        self.cells |= {at + i + 1: text for i, text in enumerate(words)}
        at += len(_NOTES)
        self._memory_at = {}
        for slot in mine:
            self._memory_at[slot.effect.id, slot.where] = at
            for i in range(slot.effect.memory):
                self.cells[at + i + 1] = f"{slot.effect.id}, {slot.where}: memory {i + 1}"
            at += slot.effect.memory
        sites = {site.partition(":")[0] for slot in mine for site in slot.effect.hooks}
        # only such hooks ask how far a piece has come
        self.looks_back = bool(sites & {"actuator", "cart", "finish"})

    def translate(self, *entries: Callable[..., Any], **bound: Any) -> Translation:
        """Translate entry points and everything they call.

        Raises
        ------
        Untranslatable
            For a construct that is not known here, naming it.
        """
        self._entries = set(entries)
        begun = [self.function(e, {k: v for k, v in bound.items() if k in _parameters(e)}) for e in entries]
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
        return Translation(text, [_entry_call(f) for f in begun], keys, self.cells)

    def active(self, site: str, where: str | None) -> list[tuple[Callable[..., Any], Slot]]:
        """Return the hooks of a chain that this drive has."""
        return [
            (hook, slot)
            for hook, slot in hooks_of(site, where)
            if slot.effect.base or (slot.effect.id, slot.where) in self._present
        ]

    def written(self) -> list[_Function]:
        """Return what is written so far."""
        return self._order

    def flagged(self, flag: int) -> bool:
        """Whether a flag of the workspace is set for this drive."""
        for which, index in FLAG.items():
            if index == flag:
                return any(not slot.effect.base for _hook, slot in self.active(*which)) or which == ("command", None)
        return False  # linear between events, or all effects on carts only: shortcuts that are not taken

    def parameter(self, index: int) -> str:
        """Return a parameter of the vector as an expression."""
        if index in (forces.W1, forces.W2):
            return f"(1 / p.{'m1' if index == forces.W1 else 'm2'})"
        return f"p.{field_name(next(key for key, slot in LAYOUT.items() if slot.index == index))}"

    def constant(self, module: str, name: str, value: float) -> float:
        """Return a constant of a module, in the units that the step runs in."""
        return value * self._constants.get(f"{module.rpartition('.')[2]}.{name}", 1.0)

    def note(self, name: str) -> int:
        """Return where in the workspace a note of the step is."""
        return self._note_at[name]

    def function(self, called: Callable[..., Any], bound: Mapping[str, Any], name: str = "") -> _Function:
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
                raise Untranslatable(f"function: must be a function; got {plain!r}.")
            done = _Function(self._named(name or given), f"@{next(self._count)}@")
            same = _Writer(self, tree, scope, bound, plain.__module__, done).write(keep=plain in self._entries)
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
        hooks = self.active(site, where)
        for hook, slot in hooks:
            which = (slot.effect.id, slot.where)
            places = f"_{slot.where}" if len(slot.effect.where) > 1 else ""
            name = f"{slot.effect.id}{places}_{hook.__name__.strip('_')}"
            scope[name] = hook
            # base effects remember nothing
            own = f"r + {self._state_at[which]}" if slot.effect.states else f"{self._memory_at.get(which, 0)}"
            remembers = f"z, {own}" if site in REMEMBERING else ""
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


class _Writer:
    """Write one function."""

    def __init__(
        self, owner: Translator, tree: ast.FunctionDef, scope: Scope, bound: Mapping[str, Any], module: str, to: _Function
    ) -> None:
        self._owner, self._tree, self._scope, self._module, self._to = owner, tree, scope, module, to
        self._known: dict[str, Any] = dict(bound)
        self._lines: list[str] = []
        self._depth = 1
        self._temporary = 0
        all_parameters = [a.arg for a in tree.args.args]
        self._to.given = [a for a in all_parameters if a not in _DROPPED and a not in bound]
        stored = [n.id for n in ast.walk(tree) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)]
        self._stored = {name: stored.count(name) for name in stored}
        self._loaded = {n.id for n in ast.walk(tree) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Load)}
        self._arguments = set(all_parameters)
        self._writes: list[str] = []
        self._plain = True  # nothing but one returned expression so far
        self._returned: tuple[str, int] | None = None

    def write(self, *, keep: bool = False) -> _Function | None:
        """Write it; return the function of which it is a mere wrapper, if it is one."""
        to, body = self._to, self._tree.body
        about = ast.get_docstring(self._tree)
        if about is not None:
            body = body[1:]
        returns = [n.value for n in ast.walk(self._tree) if isinstance(n, ast.Return) and n.value is not None]
        to.results = max((len(v.elts) if isinstance(v, ast.Tuple) else 1 for v in returns), default=0)
        for value in returns:
            # a function that hands on what another returns has as many results
            if isinstance(value, ast.Call) and to.results == 1:
                to.results = self._results_of(value)
        self._name_outputs(returns, body)
        self._block(body, tail=True)
        lines = _without_idle(self._lines)
        if lines and lines[-1] == "  return;":
            lines.pop()
        to.writes = [a for a in to.given if a in self._writes]
        used = set(re.findall(r"(?<!\.)\b[A-Za-z]\w*", "\n".join(lines) + " " + " ".join(self._named_outputs)))
        to.parameters = [a for a in to.given if a in used or a in to.writes or keep]
        if self._plain and self._returned is not None and not to.writes:
            to.inline = self._returned
        to.outputs = self._named_outputs
        outputs = [*to.outputs, *to.writes]
        left = f"[{', '.join(outputs)}]" if len(outputs) != 1 else outputs[0]
        only = re.fullmatch(r"(.*) = (@\d+@)\((.*)\);", lines[0].strip()) if len(lines) == 1 else None
        if only and not keep and only[1] == left and only[3] == ", ".join(to.parameters):
            return next(f for f in self._owner.written() if f.mark == only[2])
        comment = [] if about is None else [f"  % {line.strip()}" for line in about.splitlines()[:1]]
        to.text = "\n".join([f"function {left} = {to.mark}({', '.join(to.parameters)})", *comment, *lines, "end"])
        return None

    def _name_outputs(self, returns: Sequence[ast.expr], body: Sequence[ast.stmt]) -> None:
        """Name the results: where there is but one return, of variables, they are these."""
        n = self._to.results
        self._named_outputs = ["out"] if n == 1 else [f"out{i + 1}" for i in range(n)]
        if len(returns) == 1 and isinstance(body[-1], ast.Return):
            parts = returns[0].elts if isinstance(returns[0], ast.Tuple) else [returns[0]]
            names = [v.id for v in parts if isinstance(v, ast.Name) and self._fold(v) is NotImplemented]
            if len(names) == len(parts) == len(set(names)) and not set(names) & {"c", *_ARRAYS}:
                self._named_outputs = [self._local(name) for name in names]

    def _results_of(self, call: ast.Call) -> int:
        found, _arguments = self._resolved(call)
        return found.results if isinstance(found, _Function) else 1

    def _fail(self, node: ast.AST) -> NoReturn:
        raise Untranslatable(
            f"step: {type(node).__name__} in {self._module}.{self._tree.name}, line {getattr(node, 'lineno', '?')} "
            f"({ast.unparse(node)}), has no translation. Write it as the other functions of the step are written."
        )

    # --- what is known before the step runs

    def _fold(self, node: ast.AST) -> Any:
        """Return the value of an expression that is known beforehand, else ``NotImplemented``."""
        if isinstance(node, ast.Constant):
            return node.value
        if isinstance(node, ast.Name):
            return self._fold_name(node.id)
        if isinstance(node, ast.BinOp):
            left, right = self._fold(node.left), self._fold(node.right)
            if isinstance(left, int) and isinstance(right, int):
                known = {ast.Add: left + right, ast.Sub: left - right, ast.Mult: left * right}
                return known.get(type(node.op), NotImplemented)
            return NotImplemented
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
            value = self._fold(node.operand)
            return NotImplemented if value is NotImplemented else not value
        if isinstance(node, ast.BoolOp):
            return self._fold_logic(node)
        if isinstance(node, ast.Compare) and isinstance(node.ops[0], ast.Is | ast.IsNot):
            # there is a workspace
            return isinstance(node.ops[0], ast.IsNot)
        if isinstance(node, ast.Call):
            return self._fold_call(node)
        if isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Name) and node.slice.id in _ZERO:
            return 0.0
        return NotImplemented

    def _fold_name(self, name: str) -> Any:
        if name in self._known:
            return self._known[name]
        if name in self._arguments or name in self._stored:
            return NotImplemented
        if name in _NOTES:
            return self._owner.note(name)
        value = self._scope.get(name, NotImplemented)
        if value == math.pi:
            return NotImplemented
        if isinstance(value, float):
            return self._owner.constant(self._module, name, value)
        return value if isinstance(value, int) else NotImplemented

    def _fold_logic(self, node: ast.BoolOp) -> Any:
        decides = isinstance(node.op, ast.Or)
        values = [self._fold(v) for v in node.values]
        if any(isinstance(v, bool) and v == decides for v in values):
            return decides
        return not decides if all(isinstance(v, bool) for v in values) else NotImplemented

    def _fold_call(self, node: ast.Call) -> Any:
        called = self._callable(node)
        if called is pack.raised:
            return self._owner.flagged(self._fold(node.args[1]))
        if called is piece.width:
            return self._owner.states
        if getattr(called, "__name__", "") == "_linear":
            return False
        if called in (forces.row, *_SAME):
            return self._fold(node.args[0])
        return NotImplemented

    def _callable(self, node: ast.Call) -> Any:
        if isinstance(node.func, ast.Name):
            name = node.func.id
            found = self._known.get(name, self._scope.get(name, __builtins__.get(name) if isinstance(__builtins__, dict) else None))
            return found
        if isinstance(node.func, ast.Attribute) and isinstance(node.func.value, ast.Name):
            return getattr(self._scope[node.func.value.id], node.func.attr)
        self._fail(node)

    # --- statements

    def _emit(self, line: str) -> None:
        self._lines.append("  " * self._depth + line)

    def _block(self, body: Sequence[ast.stmt], *, tail: bool = False) -> bool:
        """Write statements; return whether they end in a return."""
        for i, statement in enumerate(body):
            if self._statement(statement, tail=tail and i == len(body) - 1):
                return True
        return False

    def _statement(self, node: ast.stmt, *, tail: bool) -> bool:
        match node:
            case ast.Return():
                self._return(node, tail=tail)
                return True
            case ast.If():
                return self._if(node, tail=tail)
            case ast.For():
                self._for(node)
            case ast.Assign(targets=[target]):
                self._assign(target, node.value)
            case ast.AugAssign():
                self._assign(node.target, ast.BinOp(_loading(node.target), node.op, node.value))
            case ast.Expr(value=ast.Call() as call):
                self._plain = False
                self._call_statement(call, [])
            case ast.Break():
                self._emit("break;")
            case ast.Pass():
                pass
            case _:
                self._fail(node)
        return False

    def _return(self, node: ast.Return, *, tail: bool) -> None:
        value = node.value
        if value is not None:
            outputs: list[ast.expr] = [ast.Name(name, ast.Store()) for name in self._named_outputs]
            if len(outputs) == 1 and not self._is_choice(value) and not self._writes_of(value):
                before = len(self._lines)
                self._returned = self._expression(value)
                self._plain &= len(self._lines) == before == 0
                if self._returned[0] != self._named_outputs[0]:
                    self._emit(f"{self._named_outputs[0]} = {self._returned[0]};")
            else:
                self._plain = False
                self._assign(outputs[0] if len(outputs) == 1 else ast.Tuple(outputs, ast.Store()), value)
        if not tail:
            self._plain = False
            self._emit("return;")

    def _is_choice(self, node: ast.expr) -> bool:
        return isinstance(node, ast.IfExp) or (isinstance(node, ast.Call) and self._callable(node) is pack.chosen)

    def _if(self, node: ast.If, *, tail: bool) -> bool:
        known = self._fold(node.test)
        if known is not NotImplemented:
            return self._block(node.body if known else node.orelse, tail=tail)
        self._plain = False
        test = self._expression(node.test)[0]
        self._emit(f"if {test}")
        self._depth += 1
        first = self._block(node.body)
        self._depth -= 1
        second = False
        if node.orelse:
            self._emit("else")
            self._depth += 1
            second = self._block(node.orelse)
            self._depth -= 1
        self._emit("end")
        return first and second

    def _for(self, node: ast.For) -> None:
        call = node.iter
        if not (isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id == "range"):
            self._fail(node)
        if not isinstance(node.target, ast.Name):
            self._fail(node)
        self._plain = False
        times = self._fold(call.args[0])
        last = str(times - 1) if isinstance(times, int) else f"({self._expression(call.args[0])[0]} - 1)"
        self._emit(f"for {self._local(node.target.id)} = 0:{last}")
        self._depth += 1
        self._block(node.body)
        self._depth -= 1
        self._emit("end")

    def _assign(self, target: ast.expr, value: ast.expr) -> None:
        if isinstance(target, ast.Name) and self._stored.get(target.id) == 1 and isinstance(self._fold(value), int):
            self._known[target.id] = self._fold(value)
            return
        if isinstance(value, ast.Subscript) and isinstance(value.slice, ast.Name) and value.slice.id in _ZERO:
            return  # of a replay; without one it stays what it is
        self._plain = False
        if isinstance(value, ast.Call) and self._callable(value) is pack.chosen:
            value = ast.IfExp(*value.args)
        if isinstance(value, ast.IfExp) and self._fold(value.test) is NotImplemented:
            self._either(value, lambda v: self._assign(target, v))
            return
        if isinstance(value, ast.IfExp):
            self._assign(target, value.body if self._fold(value.test) else value.orelse)
            return
        if isinstance(target, ast.Tuple):
            self._assign_several(target.elts, value)
            return
        if isinstance(value, ast.Call) and self._writes_of(value):
            self._call_statement(value, [target])
            return
        text = self._expression(value)[0]
        left = self._target(target)
        if text != left:
            self._emit(f"{left} = {text};")

    def _assign_several(self, targets: Sequence[ast.expr], value: ast.expr) -> None:
        if isinstance(value, ast.Call):
            if self._callable(value) is pack.sine_and_cosine:
                argument = self._expression(value.args[0])[0]
                for target, name in zip(targets, ("sin", "cos"), strict=True):
                    self._emit(f"{self._target(target)} = {name}({argument});")
                return
            self._call_statement(value, targets)
            return
        if not isinstance(value, ast.Tuple):
            self._fail(value)
        if all(isinstance(v, ast.Name) and self._target(t) == self._local(v.id) for t, v in zip(targets, value.elts, strict=True)):
            return
        # all values are found before the first is written
        later = {n.id for v in value.elts[1:] for n in ast.walk(v) if isinstance(n, ast.Name)}
        written = {n.id for t in targets for n in ast.walk(t) if isinstance(n, ast.Name) and _is_base(t, n)}
        if later & written:
            names = []
            for v in value.elts:
                text, level = self._expression(v)
                if level < _ATOM or not text.replace(".", "").isdigit():
                    name = self._fresh()
                    self._emit(f"{name} = {text};")
                    text = name
                names.append(text)
            for target, text in zip(targets, names, strict=True):
                if self._target(target) != text:
                    self._emit(f"{self._target(target)} = {text};")
            return
        for target, v in zip(targets, value.elts, strict=True):
            self._assign(target, v)

    def _either(self, node: ast.IfExp, then: Callable[[ast.expr], None]) -> None:
        self._emit(f"if {self._expression(node.test)[0]}")
        self._depth += 1
        then(node.body)
        self._depth -= 1
        self._emit("else")
        self._depth += 1
        then(node.orelse)
        self._depth -= 1
        self._emit("end")

    def _target(self, node: ast.expr) -> str:
        if isinstance(node, ast.Name):
            if node.id.startswith("_") and node.id not in self._loaded:
                return "~"
            return self._local(node.id)
        if isinstance(node, ast.Subscript) and isinstance(node.value, ast.Name):
            name = self._array(node.value.id)
            if name not in self._writes:
                self._writes.append(name)
            return self._expression(_loading(node))[0]
        self._fail(node)

    def _local(self, name: str) -> str:
        return name.strip("_") or "trial"

    def _array(self, name: str) -> str:
        return "z" if name == "c" and "c" in self._arguments else name

    def _fresh(self) -> str:
        self._temporary += 1
        return f"t{self._temporary}"

    # --- expressions: text and how strongly it binds

    def _expression(self, node: ast.expr) -> tuple[str, int]:
        known = self._fold(node)
        if known is not NotImplemented:
            return _number(known), _ATOM if not isinstance(known, int | float) or known >= 0 else 7
        match node:
            case ast.Name():
                return self._local(self._array(node.id)), _ATOM
            case ast.Attribute() if self._constant(node):
                return "pi", _ATOM
            case ast.BinOp() if (told := self._fold(node)) is not NotImplemented:
                return _number(told), _ATOM
            case ast.Subscript():
                return self._subscript(node), _ATOM
            case ast.BinOp():
                return self._binary(node)
            case ast.UnaryOp():
                return self._unary(node)
            case ast.BoolOp():
                return self._logic(node)
            case ast.Compare():
                return self._compare(node)
            case ast.IfExp():
                return self._hoisted(node), _ATOM
            case ast.Call():
                return self._call(node)
        self._fail(node)

    def _constant(self, node: ast.Attribute) -> bool:
        return isinstance(node.value, ast.Name) and getattr(self._scope[node.value.id], node.attr) == math.pi

    def _subscript(self, node: ast.Subscript) -> str:
        if not isinstance(node.value, ast.Name):
            self._fail(node)
        known = self._fold(node.slice)
        if node.value.id == "p":
            if not isinstance(known, int):
                self._fail(node)
            return self._owner.parameter(known)
        array = self._array(node.value.id)
        if isinstance(known, int):
            return f"{array}({known + 1})"
        rest, whole = self._index(node.slice)
        return f"{array}({self._expression(rest)[0]} + {whole + 1})"

    def _index(self, node: ast.expr) -> tuple[ast.expr, int]:
        """Return an index as what runs and a whole number that is known."""
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
            for known, rest in ((node.left, node.right), (node.right, node.left)):
                value = self._fold(known)
                if isinstance(value, int):
                    inner, more = self._index(rest)
                    return inner, more + value
        return node, 0

    def _binary(self, node: ast.BinOp) -> tuple[str, int]:
        if isinstance(node.op, ast.Mod):
            return f"mod({self._expression(node.left)[0]}, {self._expression(node.right)[0]})", _ATOM
        if type(node.op) not in _BINARY:
            self._fail(node)
        sign, level = _BINARY[type(node.op)]
        if isinstance(node.op, ast.Add):
            # what a replay would add
            for zero, other in ((node.left, node.right), (node.right, node.left)):
                if self._fold(zero) in (0, 0.0) and self._fold(zero) is not NotImplemented:
                    return self._expression(other)
        left, left_level = self._expression(node.left)
        right, right_level = self._expression(node.right)
        left = left if left_level >= level else f"({left})"
        # x - (y + z), and a chain of sums is evaluated from the left in both languages
        right = right if right_level > level else f"({right})"
        return f"{left} {sign} {right}", level

    def _unary(self, node: ast.UnaryOp) -> tuple[str, int]:
        text, level = self._expression(node.operand)
        sign, own = ("-", 7) if isinstance(node.op, ast.USub) else ("~", 7)
        # a power binds more strongly than a sign, and a sign than a product
        return f"{sign}{text if level > own else f'({text})'}", own

    def _logic(self, node: ast.BoolOp) -> tuple[str, int]:
        sign, level = ("&&", 1) if isinstance(node.op, ast.And) else ("||", 0)
        parts = []
        for value in node.values:
            if isinstance(self._fold(value), bool):
                continue  # decides nothing
            text, own = self._expression(value)
            parts.append(text if own > level else f"({text})")
        return f" {sign} ".join(parts), level

    def _compare(self, node: ast.Compare) -> tuple[str, int]:
        parts = []
        for left, op, right in zip([node.left, *node.comparators[:-1]], node.ops, node.comparators, strict=True):
            if type(op) not in _COMPARES:
                self._fail(node)
            (a, a_level), (b, b_level) = self._expression(left), self._expression(right)
            parts.append(f"{a if a_level > 4 else f'({a})'} {_COMPARES[type(op)]} {b if b_level > 4 else f'({b})'}")
        return " && ".join(parts), 4 if len(parts) == 1 else 1

    def _hoisted(self, node: ast.IfExp) -> str:
        known = self._fold(node.test)
        if known is not NotImplemented:
            text, level = self._expression(node.body if known else node.orelse)
            return text if level == _ATOM else f"({text})"
        self._plain = False
        name = self._fresh()
        self._either(node, lambda v: self._emit(f"{name} = {self._expression(v)[0]};"))
        return name

    def _resolved(self, node: ast.Call) -> tuple[_Function | str | None, list[ast.expr]]:
        """Return the function that a call means, and the arguments it gets; ``None`` for its argument itself."""
        called = self._callable(node)
        if called in (forces.row, *_SAME):
            return None, node.args
        if called in _LIBRARY:
            return _LIBRARY[called], node.args
        if called is None:
            self._fail(node)
        plain = getattr(called, "py_func", called)
        which = getattr(plain, "chain", None)
        names = _parameters(plain) if which is None else [*_split(f"acc, {ARGUMENTS[which[0]]}"), "z", "r", "p"]
        bound, rest = {}, []
        for name, argument in zip(names, node.args, strict=True):
            known = self._known.get(argument.id) if isinstance(argument, ast.Name) and name == "step" else self._fold(argument)
            if name == "step" and known is None and isinstance(argument, ast.Name):
                known = self._scope[argument.id]
            decides = name in _DECIDING and known is not NotImplemented and not (name == "r" and self._owner.states)
            if decides:
                bound[name] = known
            elif name not in _DROPPED:
                rest.append(argument)
        written = node.func.id if isinstance(node.func, ast.Name) and which is None and plain.__module__ != self._module else ""
        hook = written if self._scope.get(written) is plain and plain.__module__.startswith(effects.__name__) else ""
        return self._owner.function(called, bound, hook), rest

    def _writes_of(self, node: ast.expr) -> list[str]:
        if not isinstance(node, ast.Call):
            return []
        called = self._callable(node)
        if called is pack.chosen or called in _LIBRARY or self._fold(node) is not NotImplemented:
            return []
        found, _arguments = self._resolved(node)
        return found.writes if isinstance(found, _Function) else []

    def _call(self, node: ast.Call) -> tuple[str, int]:
        if self._callable(node) is pack.chosen:
            condition, a, b = node.args
            return self._hoisted(ast.IfExp(condition, a, b)), _ATOM
        found, arguments = self._resolved(node)
        if found is None:
            return self._expression(arguments[0])
        if isinstance(found, str):
            return f"{found}({', '.join(self._expression(a)[0] for a in arguments)})", _ATOM
        if found.writes:
            self._plain = False
            name = self._fresh()
            self._call_statement(node, [ast.Name(name, ast.Store())])
            return name, _ATOM
        given = {
            name: self._expression(a)
            for name, a in zip(found.given, arguments, strict=True)
            if name in found.parameters
        }
        inlined = _inlined(found, given)
        if inlined is not None:
            return inlined
        return f"{found.mark}({', '.join(text for text, _level in given.values())})", _ATOM

    def _call_statement(self, node: ast.Call, targets: Sequence[ast.expr]) -> None:
        name = getattr(self._callable(node), "__name__", "")
        if name == "prepare" or (name == "begin_piece" and not self._owner.looks_back):
            return  # the workspace comes cleared, and its flags are known
        found, arguments = self._resolved(node)
        if not isinstance(found, _Function):
            self._fail(node)
        if not targets and not found.writes:
            return
        pairs = zip(found.given, arguments, strict=True)
        given = {name: self._expression(a)[0] for name, a in pairs if name in found.parameters}
        left = [self._target(t) for t in targets] or ["~"] * found.results
        for name in found.writes:
            left.append(given[name])
            if given[name] not in self._writes:
                self._writes.append(given[name])
        outputs = left[0] if len(left) == 1 else f"[{', '.join(left)}]"
        self._emit(f"{outputs} = {found.mark}({', '.join(given.values())});")


# what the arguments of an entry point are in a function that holds a state
_IN_STATE = {
    "memory": "state.memory", "z": "state.z", "sample_time": "p.Ts", "substeps": "p.substeps", "t": "state.n * p.Ts",
    "command": "u",
}  # fmt: skip
_AT_START = {"x1": "x(1)", "v1": "x(2)", "x2": "x(3)", "v2": "x(4)"}


def _entry_call(entry: _Function) -> str:
    known = _IN_STATE if "command" in entry.given else _IN_STATE | _AT_START
    given = ", ".join(known.get(name, name) for name in entry.parameters)
    outputs = ", ".join([*entry.outputs, *(_IN_STATE[name] for name in entry.writes)])
    return f"[{outputs}] = {entry.name}({given});"


def _without_idle(lines: Sequence[str]) -> list[str]:
    """Return lines without what does nothing: branches that are empty, a value that is replaced before it is read."""
    kept: list[str] = []
    for line in lines:
        if line.strip() == "end" and kept and re.match(r"\s*if ", kept[-1]):
            kept.pop()
            continue
        now, before = (re.fullmatch(r"(\s*\w+) = (.*);", x) for x in (line, kept[-1] if kept else ""))
        if now and before and now[1] == before[1] and not re.search(rf"\b{now[1].strip()}\b", now[2]):
            kept.pop()
        kept.append(line)
    return kept


def _inlined(found: _Function, given: Mapping[str, tuple[str, int]]) -> tuple[str, int] | None:
    """Return what a short function makes of its arguments, where it can be written in its place."""
    if found.inline is None:
        return None
    text, level = found.inline
    values = given
    pattern = re.compile(r"(?<![.\w])(" + "|".join(map(re.escape, values)) + r")(?!\w)") if values else None
    used = pattern.findall(text) if pattern else []
    simple = all(re.fullmatch(r"[\w.]+", values[name][0]) for name in used if used.count(name) > 1)
    if not simple:
        return None

    def placed(match: re.Match[str]) -> str:
        value, own = values[match[1]]
        return value if own == _ATOM else f"({value})"

    if pattern is not None and re.fullmatch(pattern, text):
        return values[text]
    result = pattern.sub(placed, text) if pattern else text
    return None if len(result) > _LONGEST_INLINE else (result, level)


def _loading(node: ast.expr) -> ast.expr:
    """Return the same place, to be read."""
    if isinstance(node, ast.Name):
        return ast.Name(node.id, ast.Load())
    if isinstance(node, ast.Subscript):
        return ast.Subscript(node.value, node.slice, ast.Load())
    return node


def _is_base(target: ast.expr, name: ast.Name) -> bool:
    return target is name or (isinstance(target, ast.Subscript) and target.value is name)


def _parameters(plain: Callable[..., Any]) -> list[str]:
    return list(inspect.signature(plain).parameters)


def _split(names: str) -> list[str]:
    return [name.strip() for name in names.split(",") if name.strip()]


def _number(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(value)
    if math.isinf(value):
        return "Inf" if value > 0 else "-Inf"
    return f"{value:.17g}" if float(f"{value:.15g}") != value else f"{value:.15g}"


def constants_in(units_one: Callable[[str], float]) -> dict[str, float]:
    """Return the factors by which constants with a unit change, for units of which one holds so many of the lab's."""
    module = BACKLASH.id
    return {f"{module}._LAMBDA": 1.0 / units_one("s/mm")}
