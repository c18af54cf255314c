"""Fill the templates of exports."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from jinja2 import Environment


@cache
def _environment() -> Environment:
    try:
        from jinja2 import Environment, PackageLoader, StrictUndefined  # noqa: PLC0415
    except ModuleNotFoundError as error:
        raise ValueError("export: needs jinja2, which is not installed. Run: pip install 'flexdrive[report]'.") from error
    # what is written is source code, not a page: nothing is to be escaped
    return Environment(
        loader=PackageLoader("baselines.export", "templates"),
        autoescape=False,  # noqa: S701
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )


def fill(template: str, **content: Any) -> str:
    """Return a template of this package, filled."""
    return _environment().get_template(template).render(**content)
