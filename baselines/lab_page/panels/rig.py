"""The rig: animation, strip charts, blows, and the stability lamp."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from nicegui import ui

from baselines.lab_page import texts
from baselines.lab_page.elements import RigView, card, paragraph
from baselines.lab_page.motion import Motion
from baselines.lab_page.session import Session
from baselines.lab_page.settings import DURATION_S, LARGEST_PUSH_MM_S, MOST_PUSHES, Push, Settings
from baselines.lab_page.stability_lamp import Lamp

# mm/s of the engine per pixel that the mouse was pulled, and of a blow from the keyboard
_PER_PIXEL = 3.0
_KEYBOARD_MM_S = 250.0


class RigPanel:
    """The left half of the page.

    Parameters
    ----------
    session
        The visitor's.
    change
        Takes new settings.
    """

    def __init__(self, session: Session, change: Callable[[Settings], None]) -> None:
        self._session, self._change = session, change
        self.level = "unknown"
        self._lamp = ui.element("div").classes("lab-lamp").props('role="status" aria-live="polite"')
        with card() as around:
            self._lamp.move(around)
        with self._lamp:
            ui.element("span").classes("lab-bulb").props('aria-hidden="true"')
            with ui.element("div"):
                with ui.element("b"):
                    self._word = ui.label("")
                self.sentence = paragraph("")
        with card() as self._card:
            self.view = RigView(self._pushed)
            with ui.element("div").classes("lab-row"):
                for cart in (1, 2):
                    ui.button(texts.PUSH_CART.format(number=cart), on_click=lambda _e, c=cart: self._strike(c)).props(
                        "flat dense no-caps"
                    )
                self._taken_back = ui.button(texts.CLEAR_PUSHES, on_click=self._clear).props("flat dense no-caps")
                self._count = paragraph(texts.PUSH_HINT, "lab-soft")

    def show(self, motions: Sequence[Motion]) -> None:
        """Show runs."""
        self.view.show(motions)
        self._card.classes(add="lab-two" if len(motions) > 1 else "", remove="" if len(motions) > 1 else "lab-two")
        count = len(self._session.settings.pushes)
        self._taken_back.set_visibility(count > 0)
        words = texts.PUSHED_ONE if count == 1 else texts.PUSHED.format(count=count)
        self._count.set_text(words if count else texts.PUSH_HINT)

    def light(self, lamp: Lamp) -> None:
        """Set the lamp."""
        self.level = lamp.level
        self._lamp.props(f'data-level="{lamp.level}"')
        self._word.set_text(texts.LAMP_WORDS[lamp.level])
        self.sentence.set_text(lamp.sentence)

    def _pushed(self, cart: int, time: float, way: float) -> None:
        self._strike(cart, time * self._session.drive.units.one("s"), _PER_PIXEL * way)

    def _strike(self, cart: int, time: float = 1.0, speed: float = _KEYBOARD_MM_S) -> None:
        settings = self._session.settings
        if cart not in {1, 2} or cart > self._session.drive.carts:
            return
        if len(settings.pushes) >= MOST_PUSHES:
            ui.notify(texts.MOST_PUSHED.format(most=MOST_PUSHES), type="warning")
            return
        bound = LARGEST_PUSH_MM_S
        push = Push(cart, min(max(time, 0.0), DURATION_S), min(max(speed, -bound), bound))
        self._change(settings.replace(pushes=(*settings.pushes, push)))

    def _clear(self) -> None:
        self._change(self._session.settings.replace(pushes=()))
