"""Functions of the step in MATLAB, statement by statement."""

from __future__ import annotations

import ast
import re
from collections.abc import Sequence

from baselines.export.translation.expressions import Expressions, loading
from baselines.export.translation.function import ARRAYS, ATOM, ZERO, Function
from flexdrive_gym.drive.simd import pack
from flexdrive_gym.drive.simd.functions import sine_and_cosine


class Writer(Expressions):
    """Write one function."""

    def write(self, written: Sequence[Function], *, keep: bool = False) -> Function | None:
        """Write it; return the one of those ``written`` before of which it is a mere wrapper, if it is one."""
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
        lines = without_idle(self._lines)
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
            return next(f for f in written if f.mark == only[2])
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
            if len(names) == len(parts) == len(set(names)) and not set(names) & {"c", *ARRAYS}:
                self._named_outputs = [self._local(name) for name in names]

    def _results_of(self, call: ast.Call) -> int:
        found, _arguments = self._resolved(call)
        return found.results if isinstance(found, Function) else 1

    def _block(self, body: Sequence[ast.stmt], *, tail: bool = False) -> bool:
        """Write statements; return whether they end in a return."""
        return any(self._statement(node, tail=tail and i == len(body) - 1) for i, node in enumerate(body))

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
                self._assign(node.target, ast.BinOp(loading(node.target), node.op, node.value))
            case ast.Expr(value=ast.Call() as call):
                self._plain = False
                self._call_statement(call, [])
            case ast.Break():
                self._emit("break;")
            case ast.Pass():
                pass
            case _:
                raise self._error(node)
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
            raise self._error(node)
        if not isinstance(node.target, ast.Name):
            raise self._error(node)
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
        if isinstance(value, ast.Subscript) and isinstance(value.slice, ast.Name) and value.slice.id in ZERO:
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
            if self._callable(value) is sine_and_cosine:
                argument = self._expression(value.args[0])[0]
                for target, name in zip(targets, ("sin", "cos"), strict=True):
                    self._emit(f"{self._target(target)} = {name}({argument});")
                return
            self._call_statement(value, targets)
            return
        if not isinstance(value, ast.Tuple):
            raise self._error(value)
        if all(
            isinstance(v, ast.Name) and self._target(t) == self._local(v.id)
            for t, v in zip(targets, value.elts, strict=True)
        ):
            return
        # all values are found before the first is written
        later = {n.id for v in value.elts[1:] for n in ast.walk(v) if isinstance(n, ast.Name)}
        written = {n.id for t in targets for n in ast.walk(t) if isinstance(n, ast.Name) and _is_base(t, n)}
        if later & written:
            names = []
            for v in value.elts:
                text, level = self._expression(v)
                if level < ATOM or not text.replace(".", "").isdigit():
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


def _is_base(target: ast.expr, name: ast.Name) -> bool:
    return target is name or (isinstance(target, ast.Subscript) and target.value is name)


def without_idle(lines: Sequence[str]) -> list[str]:
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
