"""Expressions of the step in MATLAB: their text and how strongly it binds."""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from baselines.export.translation.function import (
    ATOM,
    DECIDING,
    DROPPED,
    Function,
    parameters_of,
    split,
)
from baselines.export.translation.known import SAME, Known
from flexdrive_gym.drive import effects, forces
from flexdrive_gym.drive.effects import ARGUMENTS
from flexdrive_gym.drive.simd import pack

LIBRARY: dict[Any, str] = {
    np.exp: "exp", np.expm1: "expm1", np.sin: "sin", np.cos: "cos", np.sqrt: "sqrt", np.floor: "floor", math.exp: "exp",
    abs: "abs", max: "max", min: "min", int: "fix",
}  # fmt: skip
_BINARY: dict[type[ast.operator], tuple[str, int]] = {
    ast.Add: ("+", 5), ast.Sub: ("-", 5), ast.Mult: ("*", 6), ast.Div: ("/", 6), ast.Pow: ("^", 8),
    ast.BitAnd: ("&&", 1), ast.BitOr: ("||", 0),
}  # fmt: skip
_COMPARES: dict[type[ast.cmpop], str] = {
    ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "~=",
}  # fmt: skip
_LONGEST_INLINE = 100


class Expressions(Known):
    """Write expressions, and what must be written before them."""

    def _emit(self, line: str) -> None:
        self._lines.append("  " * self._depth + line)

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
            return self._expression(loading(node))[0]
        raise self._error(node)

    def _local(self, name: str) -> str:
        return name.strip("_") or "trial"

    def _array(self, name: str) -> str:
        return "z" if name == "c" and "c" in self._arguments else name

    def _fresh(self) -> str:
        self._temporary += 1
        return f"t{self._temporary}"

    def _is_choice(self, node: ast.expr) -> bool:
        return isinstance(node, ast.IfExp) or (isinstance(node, ast.Call) and self._callable(node) is pack.chosen)

    def _expression(self, node: ast.expr) -> tuple[str, int]:
        known = self._fold(node)
        if known is not NotImplemented:
            return _number(known), ATOM if not isinstance(known, int | float) or known >= 0 else 7
        match node:
            case ast.Name():
                return self._local(self._array(node.id)), ATOM
            case ast.Attribute() if self._constant(node):
                return "pi", ATOM
            case ast.BinOp() if (told := self._fold(node)) is not NotImplemented:
                return _number(told), ATOM
            case ast.Subscript():
                return self._subscript(node), ATOM
            case ast.BinOp():
                return self._binary(node)
            case ast.UnaryOp():
                return self._unary(node)
            case ast.BoolOp():
                return self._logic(node)
            case ast.Compare():
                return self._compare(node)
            case ast.IfExp():
                return self._hoisted(node), ATOM
            case ast.Call():
                return self._call(node)
        raise self._error(node)

    def _constant(self, node: ast.Attribute) -> bool:
        return isinstance(node.value, ast.Name) and getattr(self._scope[node.value.id], node.attr) == math.pi

    def _subscript(self, node: ast.Subscript) -> str:
        if not isinstance(node.value, ast.Name):
            raise self._error(node)
        known = self._fold(node.slice)
        if node.value.id == "p":
            if not isinstance(known, int):
                raise self._error(node)
            return self._placement.parameter(known)
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
            return f"mod({self._expression(node.left)[0]}, {self._expression(node.right)[0]})", ATOM
        if type(node.op) not in _BINARY:
            raise self._error(node)
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
                raise self._error(node)
            (a, a_level), (b, b_level) = self._expression(left), self._expression(right)
            parts.append(f"{a if a_level > 4 else f'({a})'} {_COMPARES[type(op)]} {b if b_level > 4 else f'({b})'}")
        return " && ".join(parts), 4 if len(parts) == 1 else 1

    def _hoisted(self, node: ast.IfExp) -> str:
        known = self._fold(node.test)
        if known is not NotImplemented:
            text, level = self._expression(node.body if known else node.orelse)
            return text if level == ATOM else f"({text})"
        self._plain = False
        name = self._fresh()
        self._either(node, lambda v: self._emit(f"{name} = {self._expression(v)[0]};"))
        return name

    def _resolved(self, node: ast.Call) -> tuple[Function | str | None, list[ast.expr]]:
        """Return the function that a call means, and the arguments it gets; ``None`` for its argument itself."""
        called = self._callable(node)
        if called in (forces.row, *SAME):
            return None, node.args
        if called in LIBRARY:
            return LIBRARY[called], node.args
        if called is None:
            raise self._error(node)
        plain = getattr(called, "py_func", called)
        which = getattr(plain, "chain", None)
        names = parameters_of(plain) if which is None else [*split(f"acc, {ARGUMENTS[which[0]]}"), "z", "r", "p"]
        bound, rest = {}, []
        for name, argument in zip(names, node.args, strict=True):
            known = (
                self._known.get(argument.id)
                if isinstance(argument, ast.Name) and name == "step"
                else self._fold(argument)
            )
            if name == "step" and known is None and isinstance(argument, ast.Name):
                known = self._scope[argument.id]
            decides = name in DECIDING and known is not NotImplemented and not (name == "r" and self._placement.states)
            if decides:
                bound[name] = known
            elif name not in DROPPED:
                rest.append(argument)
        written = (
            node.func.id
            if isinstance(node.func, ast.Name) and which is None and plain.__module__ != self._module
            else ""
        )
        hook = written if self._scope.get(written) is plain and plain.__module__.startswith(effects.__name__) else ""
        return self._translate(called, bound, hook), rest

    def _writes_of(self, node: ast.expr) -> list[str]:
        if not isinstance(node, ast.Call):
            return []
        called = self._callable(node)
        if called is pack.chosen or called in LIBRARY or self._fold(node) is not NotImplemented:
            return []
        found, _arguments = self._resolved(node)
        return found.writes if isinstance(found, Function) else []

    def _call(self, node: ast.Call) -> tuple[str, int]:
        if self._callable(node) is pack.chosen:
            condition, a, b = node.args
            return self._hoisted(ast.IfExp(condition, a, b)), ATOM
        found, arguments = self._resolved(node)
        if found is None:
            return self._expression(arguments[0])
        if isinstance(found, str):
            return f"{found}({', '.join(self._expression(a)[0] for a in arguments)})", ATOM
        if found.writes:
            self._plain = False
            name = self._fresh()
            self._call_statement(node, [ast.Name(name, ast.Store())])
            return name, ATOM
        given = {
            name: self._expression(a)
            for name, a in zip(found.given, arguments, strict=True)
            if name in found.parameters
        }
        inlined = _inlined(found, given)
        if inlined is not None:
            return inlined
        return f"{found.mark}({', '.join(text for text, _level in given.values())})", ATOM

    def _call_statement(self, node: ast.Call, targets: Sequence[ast.expr]) -> None:
        name = getattr(self._callable(node), "__name__", "")
        if name == "prepare" or (name == "begin_piece" and not self._placement.looks_back):
            return  # the workspace comes cleared, and its flags are known
        found, arguments = self._resolved(node)
        if not isinstance(found, Function):
            raise self._error(node)
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


def _inlined(found: Function, given: Mapping[str, tuple[str, int]]) -> tuple[str, int] | None:
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
        return value if own == ATOM else f"({value})"

    if pattern is not None and re.fullmatch(pattern, text):
        return values[text]
    result = pattern.sub(placed, text) if pattern else text
    return None if len(result) > _LONGEST_INLINE else (result, level)


def loading(node: ast.expr) -> ast.expr:
    """Return the same place, to be read."""
    if isinstance(node, ast.Name):
        return ast.Name(node.id, ast.Load())
    if isinstance(node, ast.Subscript):
        return ast.Subscript(node.value, node.slice, ast.Load())
    return node


def _number(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(value)
    if math.isinf(value):
        return "Inf" if value > 0 else "-Inf"
    return f"{value:.17g}" if float(f"{value:.15g}") != value else f"{value:.15g}"
