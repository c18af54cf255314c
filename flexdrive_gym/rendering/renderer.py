"""The one thing an environment needs to show itself."""

from __future__ import annotations

from difflib import get_close_matches
from math import isfinite
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from flexdrive_gym.rendering.ansi import draw_ansi
from flexdrive_gym.rendering.canvas import Canvas, load_pygame
from flexdrive_gym.rendering.chart import draw_charts
from flexdrive_gym.rendering.history import Frame, History
from flexdrive_gym.rendering.rail import draw_rail
from flexdrive_gym.rendering.scale import round_out, text
from flexdrive_gym.rendering.style import PAPER, QUIET, TEXT
from flexdrive_gym.units import in_rig_units

if TYPE_CHECKING:
    import pygame

Mode = Literal["human", "rgb_array", "ansi"]
SMALLEST = (640, 320)


class Renderer:
    """Shows frames of a drive.

    Parameters
    ----------
    mode
        ``"rgb_array"`` returns pictures, ``"human"`` shows them in a window at the pace of ``fps``, ``"ansi"`` returns
        two lines of text.
    history_s
        Length of the strip chart [s].
    size
        Width and height of the picture [pixels], at least 640 x 320.
    fps
        Pictures per second in a window.

    Attributes
    ----------
    window_closed
        Whether the user has closed the window. It stays closed: a run goes on without pictures.

    Raises
    ------
    ValueError
        If an argument is outside its range.
    ModuleNotFoundError
        On the first picture, if pygame is not installed; text needs none.
    """

    def __init__(
        self, mode: Mode, history_s: float = 4.0, size: tuple[int, int] = (960, 480), fps: float = 50.0
    ) -> None:
        if mode not in get_args(Mode):
            near = get_close_matches(str(mode), get_args(Mode), n=1, cutoff=0.4)
            hint = f" Did you mean {near[0]!r}?" if near else " 'rgb_array' works everywhere."
            raise ValueError(f"mode: must be one of {', '.join(get_args(Mode))}; got {mode!r}.{hint}")
        for name, value, unit in (("history_s", history_s, "s"), ("fps", fps, "pictures per second")):
            if not (isfinite(value) and value > 0.0):
                raise ValueError(f"{name}: must be positive and finite [{unit}]; got {value:g}. The default serves.")
        if len(size) != 2 or size[0] < SMALLEST[0] or size[1] < SMALLEST[1]:
            raise ValueError(
                f"size: must be at least {SMALLEST[0]} x {SMALLEST[1]} pixels to be legible; got {size}. "
                "Use 960 x 480 and scale the pictures down."
            )
        self.mode, self.size, self.fps = mode, (int(size[0]), int(size[1])), fps
        self.window_closed = False
        self._history = History(history_s)
        self._frame: Frame | None = None
        self._canvas: Canvas | None = None
        self._window: pygame.Surface | None = None
        self._clock: pygame.time.Clock | None = None

    def add(self, frame: Frame) -> None:
        """Take the drive's state at the next instant; every sample may be added, also between pictures."""
        frame = in_rig_units(frame, frame.units)
        self._history.add(frame)
        self._frame = frame

    def render(self) -> npt.NDArray[np.uint8] | str | None:
        """Show the last frame.

        Returns
        -------
        ndarray of uint8, shape (height, width, 3), or str, or None
            For ``"rgb_array"``, ``"ansi"`` and ``"human"``.

        Raises
        ------
        RuntimeError
            If there is no frame yet, or no display for a window.
        """
        if self._frame is None:
            raise RuntimeError("render: there is no frame to show yet. Call reset() of the environment first.")
        if self.mode == "ansi":
            return draw_ansi(self._frame, self._span(self._frame))
        if self.mode == "human":
            self._show(self._frame)
            return None
        return as_array(self._draw(self._frame))

    def reset(self) -> None:
        """Begin a new strip chart."""
        self._history.clear()
        self._frame = None

    def close(self) -> None:
        """Close the window, if there is one; may be called twice."""
        if self._window is not None:
            load_pygame().display.quit()
        self._window = self._clock = self._canvas = None

    def __getstate__(self) -> dict[str, Any]:
        """Leave surfaces behind, so that an environment can be copied and sent to another process."""
        return {**self.__dict__, "_canvas": None, "_window": None, "_clock": None}

    def _span(self, frame: Frame) -> float:
        """Return the largest position on the rail [mm]: the travel limit, or what was seen where there is none."""
        if isfinite(frame.travel_limit):
            return frame.travel_limit
        least = 100.0 / frame.units.one("mm")
        return round_out(0.0, max(1.2 * self._history.highest, -1.2 * self._history.lowest, least))[1]

    def _draw(self, frame: Frame) -> pygame.Surface:
        if self._canvas is None:
            self._canvas = Canvas(self.size)
        canvas = self._canvas
        canvas.clear(PAPER)
        canvas.text((20.0, 18.0), frame.title, TEXT, size=16.0, widest=canvas.width - 180.0)
        canvas.text((canvas.width - 20.0, 18.0), f"t = {text(frame.t, 3)} s", QUIET, "right", 14.0)
        draw_rail(canvas, frame, self._span(frame))
        draw_charts(canvas, frame, self._history)
        return canvas.finish()

    def _show(self, frame: Frame) -> None:
        if self.window_closed:
            return
        pg = load_pygame()
        if self._window is None or pg.display.get_surface() is not self._window:
            self._window = self._open(pg)
            self._clock = pg.time.Clock()
        # other events are left for whoever steers by keyboard
        if pg.event.get(pg.QUIT):
            self.close()
            self.window_closed = True
            return
        assert self._clock is not None
        self._window.blit(self._draw(frame), (0, 0))
        pg.display.flip()
        self._clock.tick(self.fps)

    def _open(self, pg: Any) -> pygame.Surface:
        try:
            pg.display.init()
            window: pygame.Surface = pg.display.set_mode(self.size)
        except pg.error as error:
            raise RuntimeError(
                f"render_mode: 'human' needs a display; got: {error}. Use 'rgb_array' or 'ansi' on a machine without."
            ) from error
        pg.display.set_caption("flexdrive")
        pg.event.set_blocked(pg.MOUSEMOTION)  # nobody reads it, and a full queue would lose the click that closes
        return window


def as_array(surface: pygame.Surface) -> npt.NDArray[np.uint8]:
    """Return a surface's pixels, ndarray of uint8, shape (height, width, 3)."""
    width, height = surface.get_size()
    pixels = np.frombuffer(load_pygame().image.tobytes(surface, "RGB"), dtype=np.uint8)
    return pixels.reshape(height, width, 3).copy()
