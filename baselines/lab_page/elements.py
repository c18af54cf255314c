"""The page's own elements: each is a file of ``static/`` that draws in the browser, and what Python tells it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from nicegui import ui
from nicegui.element import Element
from nicegui.events import GenericEventArguments

from baselines.lab_page import texts
from baselines.lab_page.chart import Chart
from baselines.lab_page.motion import Motion
from baselines.lab_page.settings import DURATION_S

_RIG_TEXTS = {
    "rig": texts.RIG,
    "summary": texts.RIG_SUMMARY,
    "strips": texts.STRIPS_SUMMARY,
    "play": texts.PLAY,
    "pause": texts.PAUSE,
    "restart": texts.RESTART,
    "speed": texts.SPEED,
    "instant": texts.INSTANT,
    "real": texts.REAL_TIME,
}


class RigView(Element, component="static/rig.js"):
    """The animated rig with transport and strip charts.

    Parameters
    ----------
    on_push
        Called with the number of the cart, the instant [s of the rig] and how far the mouse was pulled [pixels].
    """

    def __init__(self, on_push: Callable[[int, float, float], Any]) -> None:
        super().__init__()
        self.motions: Sequence[Motion] = ()
        self._number = 0
        self._props["texts"] = _RIG_TEXTS
        self._props["payload"] = {}

        def pushed(e: GenericEventArguments) -> Any:
            args = e.args if isinstance(e.args, dict) else {}
            return on_push(int(args.get("cart", 0)), float(args.get("time", 0.0)), float(args.get("way", 0.0)))

        self.on("push", pushed)

    def show(self, motions: Sequence[Motion]) -> None:
        """Show runs, one rig each; the browser goes on at the instant at which it is."""
        self.motions = motions
        self._number += 1
        first = motions[0]
        stopped = next((m for m in motions if m.stopped is not None), None)
        time = first.units.one("s")
        note = ""
        if stopped is not None and stopped.stopped is not None:
            note = texts.STOPPED.format(time=f"{stopped.stopped / time:.2f} s")
        # a scale below which a motion is drawn small instead of filling the track, and volts per arrow, in the rig's units
        length, command = first.units.one("mm"), first.units.one("V")
        runs = [m.payload() | {"scale": 100.0 / length, "arrow": command} for m in motions]
        self._props["payload"] = {"runs": runs, "seconds": DURATION_S / time, "note": note, "number": self._number}
        self.update()


class Plot(Element, component="static/plot.js"):
    """A chart.

    Parameters
    ----------
    on_brush
        Called with the chosen range of x, or two ``None`` for all of it.
    """

    def __init__(self, on_brush: Callable[[float | None, float | None], Any] | None = None) -> None:
        super().__init__()
        self.chart: Chart | None = None
        if on_brush is not None:

            def brushed(e: GenericEventArguments) -> Any:
                args = e.args if isinstance(e.args, dict) else {}
                low, high = args.get("from"), args.get("to")
                return on_brush(None if low is None else float(low), None if high is None else float(high))

            self.on("brush", brushed)

    def show(self, chart: Chart) -> None:
        """Draw a chart."""
        self.chart = chart
        self._props["chart"] = chart.json()
        self.update()


class Drop(Element, component="static/drop.js"):
    """A place to drop files and folders.

    Parameters
    ----------
    url
        Where they are sent, on this server.
    on_sent
        Called with one sentence for each file that was refused.
    folders
        Whether several files and folders are taken.
    """

    def __init__(
        self, url: str, on_sent: Callable[[list[str]], Any], *, accept: str = "", folders: bool = True
    ) -> None:
        super().__init__()
        self._props |= {"url": url, "accept": accept, "folders": folders}
        self._props["texts"] = {"drop": texts.DROP, "files": texts.CHOOSE_FILES, "folder": texts.CHOOSE_FOLDER}

        def sent(e: GenericEventArguments) -> Any:
            args = e.args if isinstance(e.args, dict) else {}
            return on_sent([str(r)[:400] for r in args.get("refused", [])])

        self.on("sent", sent)


def card(*, classes: str = "") -> ui.element:
    """Return a card."""
    return ui.element("section").classes(f"lab-card {classes}")


def heading(text: str, level: int = 2) -> ui.element:
    """Return a heading."""
    with ui.element(f"h{level}") as element:
        ui.html(text_of(text), sanitize=False, tag="span")
    return element


def text_of(text: str) -> str:
    """Return a text as HTML: nothing in it is markup."""
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;").replace('"', "&quot;")


def paragraph(text: str, classes: str = "") -> ui.label:
    """Return a paragraph; it is a label, so that its text can be changed."""
    return ui.label(text).classes(classes)
