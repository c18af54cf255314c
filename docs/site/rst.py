"""Docstrings in numpy's style with reStructuredText roles, and formulas anywhere, as Markdown.

Formulas become MathML, which browsers draw without a script.
"""

import re
from typing import Any

from griffe import Docstring, Extension, Object
from latex2mathml.converter import convert

_ROLE = re.compile(r":(?:class|func|meth|mod|data|attr|exc|obj):`~?([^`]+)`")
_SHORT = re.compile(r":(?:class|func|meth|mod|data|attr|exc|obj):`~([^`]+)`")
_INLINE = re.compile(r":math:`([^`]+)`", re.DOTALL)
# the formula on the directive's own line, or indented below it
_BLOCK = re.compile(r"^( *)\.\. math::(?: +(\S[^\n]*))?\n((?:\s*\n|\1 +[^\n]*\n)*)", re.MULTILINE)
# a formula between dollars, or code, where a dollar is one
_DOLLARS = re.compile(r"```.*?```|`[^`\n]*`|\$\$(.+?)\$\$|\$([^$\n]+)\$", re.DOTALL)
_TABLE = re.compile(r"(?:^ *={3,}(?: +={3,})+ *\n)(?:.*\n)+?(?=\s*\n|\Z)", re.MULTILINE)


def mathml(latex: str, *, display: str = "inline") -> str:
    """Return a formula on one line."""
    return convert(" ".join(latex.split()), display=display).replace("\n", "")


def _block(found: re.Match[str]) -> str:
    lines = [part.strip() for part in re.split(r"\n\s*\n", f"{found[2] or ''}\n{found[3]}") if part.strip()]
    return "\n" + "\n\n".join(f"{found[1]}{mathml(line.rstrip(), display='block')}" for line in lines) + "\n\n"


def formulas(text: str) -> str:
    """Return Markdown with its formulas between dollars as MathML."""

    def written(found: re.Match[str]) -> str:
        if found[1]:
            return mathml(found[1], display="block")
        # a line that begins with a formula does not begin a block
        return f"<span>{mathml(found[2])}</span>" if found[2] else found[0]

    return _DOLLARS.sub(written, text)


def markdown(text: str) -> str:
    """Return a docstring's text as Markdown."""
    text = _BLOCK.sub(_block, text + "\n")
    text = _INLINE.sub(lambda m: mathml(m[1]), text)
    text = _SHORT.sub(lambda m: f"`{m[1].rsplit('.', 1)[-1]}`", text)
    text = _ROLE.sub(lambda m: f"`{m[1]}`", text)
    # simple tables stay as they are typed
    return _TABLE.sub(lambda m: f"```text\n{m[0].rstrip()}\n```\n", text).rstrip()


class Roles(Extension):
    """Applies :func:`markdown` to every docstring of the reference."""

    def on_object(self, *, obj: Object, **_more: Any) -> None:
        """Rewrite an object's docstring."""
        if isinstance(obj.docstring, Docstring):
            obj.docstring.value = markdown(obj.docstring.value)
