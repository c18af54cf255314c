"""A drawing surface with smooth lines, on pygame and without any display.

Shapes are drawn at twice the size and averaged down, which smooths every edge alike; text, which pygame smooths by
itself, is put on last. Coordinates are those of a 960 x 480 picture whatever its real size: x to the right, y down.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from flexdrive_gym.recording import FloatArray

if TYPE_CHECKING:
    import pygame

Point: TypeAlias = tuple[float, float]
Points: TypeAlias = Sequence[Point] | FloatArray
Align: TypeAlias = Literal["left", "centre", "right"]

FINE = 2
NOMINAL = (960, 480)
DENSE = 6000.0  # length of a curve above which dashes would merge anyway, and take long
# plain faces of the three platforms; where none is found, pygame's own bold one serves
FONTS = "liberationsans,arial,helveticaneue,helvetica,dejavusans"


def load_pygame() -> Any:
    """Import pygame, silently.

    Returns
    -------
    module

    Raises
    ------
    ModuleNotFoundError
        If it is not installed, with the command that installs it.
    """
    # its greeting would spoil the output of whoever prints results; the user's own setting comes first
    greeting = os.environ.get("PYGAME_HIDE_SUPPORT_PROMPT")
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    try:
        import pygame  # noqa: PLC0415
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            "render_mode: 'human' and 'rgb_array' draw with pygame, which is not installed. "
            "Install it with: pip install pygame-ce. 'ansi' needs nothing.",
            name="pygame",
        ) from error
    finally:
        if greeting is None:
            os.environ.pop("PYGAME_HIDE_SUPPORT_PROMPT", None)
    return pygame


@cache
def _typeface() -> str | None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a machine that cannot list its fonts still has pygame's own
        path: str | None = load_pygame().font.match_font(FONTS)
    return path


class Canvas:
    """One picture, drawn over and over.

    Parameters
    ----------
    size
        Width and height [pixels].

    Attributes
    ----------
    width, height
        In drawing units; at least 960 and 480.
    """

    def __init__(self, size: tuple[int, int]) -> None:
        self._pg = load_pygame()
        self._scale = min(size[0] / NOMINAL[0], size[1] / NOMINAL[1])
        self.width, self.height = size[0] / self._scale, size[1] / self._scale
        self._fine = self._pg.Surface((FINE * size[0], FINE * size[1]), depth=32)
        self._image = self._pg.Surface(size, depth=32)
        self._texts: list[tuple[pygame.Surface, Point]] = []
        self._fonts: dict[int, pygame.font.Font] = {}

    def clear(self, colour: str) -> None:
        """Begin a picture."""
        # other users of pygame may have shut it down since the last picture, and its fonts with it
        self._pg.font.init()
        self._fonts.clear()
        self._texts.clear()
        self._fine.fill(colour)

    def finish(self) -> pygame.Surface:
        """Return the picture; it is valid until the next one."""
        image: pygame.Surface = self._image
        self._pg.transform.smoothscale(self._fine, image.get_size(), image)
        image.blits(self._texts)
        return image

    def _at(self, points: Points) -> npt.NDArray[np.float64]:
        return np.rint(np.asarray(points, dtype=np.float64) * (FINE * self._scale))

    def _thick(self, width: float) -> int:
        return max(round(width * FINE * self._scale), 1)

    def lines(self, points: Points, colour: str, width: float = 1.0) -> None:
        """Draw a polyline, shape (n, 2)."""
        if len(points) > 1:
            self._pg.draw.lines(self._fine, colour, False, self._at(points), self._thick(width))

    def rule(self, x0: float, y0: float, x1: float, y1: float, colour: str, width: float = 1.0) -> None:
        """Draw a horizontal or vertical line on whole pixels, so that it stays crisp."""
        thick = max(round(width * self._scale), 1)
        left, top = (round(v * self._scale - 0.5 * thick) for v in (min(x0, x1), min(y0, y1)))
        long, high = (round(abs(v) * self._scale) + thick for v in (x1 - x0, y1 - y0))
        self._fine.fill(colour, (FINE * left, FINE * top, FINE * long, FINE * high))

    def dashed_rule(
        self, x0: float, y0: float, x1: float, y1: float, colour: str, width: float = 1.0, on: float = 10.0
    ) -> None:
        """Draw a dashed horizontal or vertical line on whole pixels; gaps are half as long as strokes."""
        length = max(abs(x1 - x0), abs(y1 - y0))
        for begin in np.arange(0.0, length, 1.5 * on).tolist():
            a, b = begin / length, min(begin + on, length) / length
            self.rule(x0 + a * (x1 - x0), y0 + a * (y1 - y0), x0 + b * (x1 - x0), y0 + b * (y1 - y0), colour, width)

    def dashes(self, points: Points, colour: str, width: float = 1.0, on: float = 6.0, off: float = 4.0) -> None:
        """Draw a dashed polyline, shape (n, 2), with strokes and gaps of equal length along the curve."""
        xy = np.asarray(points, dtype=np.float64)
        if len(xy) < 2:
            return
        along = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(xy, axis=0).T))))
        if along[-1] > DENSE:
            self.lines(xy, colour, width)
            return
        for begin in np.arange(0.0, along[-1], on + off):
            end = min(begin + on, along[-1])
            inner = along[np.searchsorted(along, begin, "right") : np.searchsorted(along, end, "left")]
            s = np.concatenate(([begin], inner, [end]))
            self.lines(np.stack((np.interp(s, along, xy[:, 0]), np.interp(s, along, xy[:, 1])), axis=1), colour, width)

    def polygon(self, points: Points, colour: str) -> None:
        """Draw a filled polygon, shape (n, 2)."""
        self._pg.draw.polygon(self._fine, colour, self._at(points))

    def disc(self, centre: Point, radius: float, colour: str) -> None:
        """Draw a filled circle."""
        self._pg.draw.circle(self._fine, colour, self._at([centre])[0], radius * FINE * self._scale)

    def box(self, left: float, top: float, right: float, bottom: float, colour: str, radius: float = 0.0) -> None:
        """Draw a filled rectangle with rounded corners."""
        self._pg.draw.rect(self._fine, colour, self._rect(left, top, right, bottom), border_radius=self._thick(radius))

    def _rect(self, left: float, top: float, right: float, bottom: float) -> pygame.Rect:
        (x0, y0), (x1, y1) = self._at([(left, top), (right, bottom)])
        rect: pygame.Rect = self._pg.Rect(x0, y0, x1 - x0, y1 - y0)
        return rect

    @contextmanager
    def clipped(self, left: float, top: float, right: float, bottom: float) -> Iterator[None]:
        """Draw shapes only within a rectangle."""
        self._fine.set_clip(self._rect(left, top, right, bottom))
        try:
            yield
        finally:
            self._fine.set_clip(None)

    def text(
        self,
        at: Point,
        text: str,
        colour: str,
        align: Align = "left",
        size: float = 13.0,
        widest: float | None = None,
    ) -> None:
        """Write a line of text whose middle height is ``at``, cut short where it would be wider than ``widest``."""
        drawn = self._font(size).render(self._cut(text, size, widest), True, colour)
        shift = {"left": 0.0, "centre": 0.5, "right": 1.0}[align] * drawn.get_width()
        x, y = at[0] * self._scale - shift, at[1] * self._scale - 0.5 * drawn.get_height()
        self._texts.append((drawn, (round(x), round(y))))

    def _font(self, size: float) -> pygame.font.Font:
        typeface = _typeface()
        # pygame's own face is a third smaller than others of the same nominal size
        pixels = max(round(size * self._scale * (1.0 if typeface else 1.3)), 6)
        if pixels not in self._fonts:
            self._fonts[pixels] = self._pg.font.Font(typeface, pixels)
        return self._fonts[pixels]

    def _cut(self, text: str, size: float, widest: float | None) -> str:
        line = " ".join(text.split())
        if widest is None or self._font(size).size(line)[0] <= widest * self._scale:
            return line
        while line and self._font(size).size(f"{line}…")[0] > widest * self._scale:
            line = line[:-1]
        return f"{line.rstrip()}…"
