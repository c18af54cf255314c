"""What of a function of the step is known before it runs: which effects there are, where things are."""

from __future__ import annotations

import ast
import builtins
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from baselines.export.translation.function import DROPPED, NOTES, ZERO, Function, Scope, UntranslatableError
from baselines.export.translation.placement import Placement
from flexdrive_gym.drive import forces, piece
from flexdrive_gym.drive.simd import pack

SAME = (pack.anywhere, pack.leading, np.int64)


class Known:
    """One function, and what is known of it.

    Parameters
    ----------
    placement
        Of the drive's effects.
    translate
        Returns the translation of a function that this one calls, from its deciding arguments and, for a hook, its name.
    tree, scope, module
        Syntax tree, names and module of the function.
    bound
        Deciding arguments.
    to
        What is written of it.
    """

    def __init__(
        self,
        placement: Placement,
        translate: Callable[[Callable[..., Any], Mapping[str, Any], str], Function],
        tree: ast.FunctionDef,
        scope: Scope,
        bound: Mapping[str, Any],
        module: str,
        to: Function,
    ) -> None:
        self._placement, self._translate = placement, translate
        self._tree, self._scope, self._module, self._to = tree, scope, module, to
        self._known: dict[str, Any] = dict(bound)
        self._lines: list[str] = []
        self._depth = 1
        self._temporary = 0
        all_parameters = [a.arg for a in tree.args.args]
        self._to.given = [a for a in all_parameters if a not in DROPPED and a not in bound]
        stored = [n.id for n in ast.walk(tree) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)]
        self._stored = {name: stored.count(name) for name in stored}
        self._loaded = {n.id for n in ast.walk(tree) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Load)}
        self._arguments = set(all_parameters)
        self._writes: list[str] = []
        self._plain = True  # nothing but one returned expression so far
        self._returned: tuple[str, int] | None = None

    def _error(self, node: ast.AST) -> UntranslatableError:
        return UntranslatableError(
            f"step: {type(node).__name__} in {self._module}.{self._tree.name}, line {getattr(node, 'lineno', '?')} "
            f"({ast.unparse(node)}), has no translation. Write it as the other functions of the step are written."
        )

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
        if isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Name) and node.slice.id in ZERO:
            return 0.0
        return NotImplemented

    def _fold_name(self, name: str) -> Any:
        if name in self._known:
            return self._known[name]
        if name in self._arguments or name in self._stored:
            return NotImplemented
        if name in NOTES:
            return self._placement.note(name)
        value = self._scope.get(name, NotImplemented)
        if value == math.pi:
            return NotImplemented
        if isinstance(value, float):
            return self._placement.constant(self._module, name, value)
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
            return self._placement.flagged(self._fold(node.args[1]))
        if called is piece.width:
            return self._placement.states
        if getattr(called, "__name__", "") == "_linear":
            return False
        if called in (forces.row, *SAME):
            return self._fold(node.args[0])
        return NotImplemented

    def _callable(self, node: ast.Call) -> Any:
        if isinstance(node.func, ast.Name):
            name = node.func.id
            return self._known.get(name, self._scope.get(name, getattr(builtins, name, None)))
        if isinstance(node.func, ast.Attribute) and isinstance(node.func.value, ast.Name):
            return getattr(self._scope[node.func.value.id], node.func.attr)
        raise self._error(node)
