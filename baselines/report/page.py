"""Blocks of an HTML page, rendered by one template into one self-contained file."""

from __future__ import annotations

import base64
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from baselines.report.figure_data import figure_csv, figure_svg, packed
from baselines.report.glossary import explained
from flexdrive_gym.units import LAB, Units
from identification.plots.style import rename_units

if TYPE_CHECKING:
    from matplotlib.figure import Figure


# a cell that lines up with numbers: a number, an interval, a percentage, a dash, or nothing
_NUMBER = re.compile(
    r"^(?:[-+−–<]?[\d.]+(?:e[-+]?\d+)?\s*%?(?:\s*(?:±|…)\s*[-−\d.e+]+|\s*\[[^\[\]]*\])?"
    r"|–|none below 10|assumed|below resolution)?$"
)
# characters: of a narrow screen, between columns, and of a cell whose text runs over several lines
_NARROW, _GAP, _WRAPPED = 52, 2, 24
_INTERVAL = re.compile(r"\[[^\[\]]*\]")


@dataclass(frozen=True)
class Block:
    """A paragraph, heading, list, table, figure, or gallery of moving pictures.

    A table with a ``caption`` is folded under it. ``files`` are what a figure is drawn from, as :func:`packed` makes them;
    ``frames`` the pictures of a moving one.
    """

    kind: str
    text: str = ""
    lines: tuple[str, ...] = ()
    columns: tuple[str, ...] = ()
    rows: tuple[tuple[str, ...], ...] = ()
    numeric: tuple[bool, ...] = ()
    png: str = ""
    caption: str = ""
    files: tuple[tuple[str, str], ...] = ()
    frames: tuple[str, ...] = ()
    parts: tuple[Block, ...] = ()

    @property
    def wide(self) -> bool:
        """Whether a table is wider than a narrow screen, where its rows then become cards [characters]."""
        longest = (
            max(*map(len, head.split()), 0, *(min(len(row[i]), _WRAPPED) for row in self.rows))
            for i, head in enumerate(self.columns)
        )
        return sum(n + _GAP for n in longest) > _NARROW


@dataclass
class Section:
    """A titled run of blocks, filled in reading order.

    Headings, heads of tables and labels of figures name the lab's units in square brackets, and are shown with the rig's; figures
    and cells are the rig's numbers already.
    """

    title: str
    anchor: str
    blocks: list[Block] = field(default_factory=list)
    folded: bool = False
    units: Units = LAB

    def text(self, text: str) -> None:
        """Add a paragraph."""
        self.blocks.append(Block("text", text=text))

    def heading(self, text: str) -> None:
        """Add a sub-heading."""
        self.blocks.append(Block("heading", text=self.units.label(text)))

    def items(self, lines: Sequence[str]) -> None:
        """Add a bullet list."""
        self.blocks.append(Block("list", lines=tuple(lines)))

    def table(self, columns: Sequence[str], rows: Sequence[Sequence[str]], *, folded: str = "") -> None:
        """Add a table; with ``folded``, closed under these words."""
        # an interval stays on one line
        cells = tuple(tuple(_INTERVAL.sub(lambda m: m[0].replace(" ", "\u00a0"), cell) for cell in row) for row in rows)
        numeric = tuple(all(_NUMBER.match(row[i]) for row in cells) for i in range(len(columns)))
        head = tuple(map(self.units.label, columns))
        self.blocks.append(Block("table", columns=head, rows=cells, numeric=numeric, caption=folded))

    def figure(self, figure: Figure, caption: str, *, dpi: float = 110.0) -> None:
        """Add a figure with its lines as CSV and itself as SVG; it is rendered at once, so that its memory can be freed."""
        rename_units(figure, self.units)
        stream = io.BytesIO()
        figure.savefig(stream, format="png", dpi=dpi)
        png = base64.b64encode(stream.getvalue()).decode()
        files = (("csv", packed(figure_csv(figure))), ("svg", packed(figure_svg(figure))))
        self.blocks.append(Block("figure", png=png, caption=caption, files=files))

    def gallery(self, gifs: Sequence[tuple[bytes, str]]) -> None:
        """Add moving pictures with their captions, side by side where there is room; a reader may stop and step through them."""
        parts = []
        for data, caption in gifs:
            frames = gif_frames(data)
            # without a script the last frame shows the whole run
            parts.append(Block("figure", png=frames[-1], caption=caption, frames=frames))
        self.blocks.append(Block("gallery", parts=tuple(parts)))


def gif_frames(data: bytes) -> tuple[str, ...]:
    """Return the pictures of a GIF, each whole, as PNG in base64."""
    from PIL import Image, ImageSequence  # noqa: PLC0415  (comes with matplotlib, which the pages need)

    frames = []
    with Image.open(io.BytesIO(data)) as gif:
        for frame in ImageSequence.Iterator(gif):
            stream = io.BytesIO()
            # a GIF has few colours, so this loses none
            frame.convert("RGB").quantize(256, dither=Image.Dither.NONE).save(stream, "PNG", optimize=True)
            frames.append(base64.b64encode(stream.getvalue()).decode())
    return tuple(frames)


def _breakable(words: str) -> str:
    """Return the head of a column as HTML that may break within a controller's name."""
    from markupsafe import Markup, escape  # noqa: PLC0415  (comes with jinja2)

    return Markup(re.sub(r"([_@])", r"\1<wbr>", str(escape(words))))  # noqa: S704  (escaped)


def render(template: str = "report.html.j2", **content: Any) -> str:
    """Return the page as HTML: a template of this package, filled."""
    from jinja2 import Environment, PackageLoader, StrictUndefined  # noqa: PLC0415

    environment = Environment(
        loader=PackageLoader("baselines.report", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
    )
    environment.filters["breakable"] = _breakable
    return explained(environment.get_template(template).render(**content))
