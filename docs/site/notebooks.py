"""Notebooks as pages: what their cells say, print and draw, run at the time of the build."""

import ast
import contextlib
import io
from pathlib import Path
from typing import Any

from docs.site.rst import formulas


def _cells(file: Path) -> list[tuple[str, bool]]:
    """Return source and "is text" of every cell, in order."""
    text, found = file.read_text(encoding="utf-8"), []
    for node in ast.parse(text).body:
        if isinstance(node, ast.With):
            body = node.body
        elif isinstance(node, ast.FunctionDef) and node.decorator_list:
            body = [statement for statement in node.body if not isinstance(statement, ast.Return)]
        else:
            continue
        lines = text.splitlines()[body[0].lineno - 1 - _comments(text, body[0].lineno) : body[-1].end_lineno]
        source = "\n".join(line[4:] for line in lines)
        found.append((source, source.startswith("mo.md(")))
    return found


def _comments(text: str, line: int) -> int:
    above = text.splitlines()[: line - 1][::-1]
    return next((i for i, row in enumerate(above) if not row.strip().startswith("#")), 0)


def page(file: Path, picture: Any) -> str:
    """Return a notebook as Markdown; ``picture(number, figure)`` keeps a figure and returns its path."""
    space: dict[str, Any] = {"__name__": file.stem}
    parts, pictures = [], 0
    for source, is_text in _cells(file):
        if is_text:
            said = ast.literal_eval(ast.parse(source).body[0].value.args[0])  # type: ignore[attr-defined]
            lines = "\n".join(line.removeprefix("    ") for line in said.strip("\n").splitlines())
            parts.append(formulas(lines.strip()))
            continue
        shown, printed = _run(source, space)
        parts.append(f"```python\n{source}\n```")
        if printed:
            parts.append(f"```text\n{printed.rstrip()}\n```")
        if hasattr(shown, "savefig"):
            pictures += 1
            parts.append(f"![Figure {pictures} of this notebook]({picture(pictures, shown)})")
    where = f"Run it with `marimo edit examples/notebooks/{file.name}`, or as a script: `python examples/notebooks/{file.name}`."
    return "\n\n".join([*parts, where]) + "\n"


def _run(source: str, space: dict[str, Any]) -> tuple[Any, str]:
    """Return the value of a cell's last expression, and what it printed."""
    tree, out, value = ast.parse(source), io.StringIO(), None
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    with contextlib.redirect_stdout(out):
        exec(compile(tree, "cell", "exec"), space)  # noqa: S102  (our own notebook)
        if last is not None:
            value = eval(compile(ast.Expression(last.value), "cell", "eval"), space)  # noqa: S307
    return value, out.getvalue()
