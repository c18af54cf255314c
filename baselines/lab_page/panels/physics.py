"""Physics: every effect of the catalogue as a switch, with size, equation and signature."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

from nicegui import events, ui

from baselines.lab_page import texts
from baselines.lab_page.elements import Plot, card, paragraph
from baselines.lab_page.session import Session
from baselines.lab_page.settings import Settings
from baselines.lab_page.signature import largest, plainly_present, signature, smallest, switches, title
from baselines.report.words import effect_name
from flexdrive_gym.drive.effects import LAYOUT, Effect


class _Row:
    """One effect at one place: a switch, and its sizes while it is on."""

    def __init__(self, panel: PhysicsPanel, effect: Effect, where: str) -> None:
        self.effect, self.where, self._panel = effect, where, panel
        self.keys = tuple(effect.key(where, p.name) for p in effect.parameters)
        self.sliders: dict[str, tuple[ui.slider, ui.label]] = {}
        with ui.element("div").classes("lab-effect") as self.element:
            words = texts.EFFECT_OF.format(name=title(effect), where=where.replace("_", " "))
            self.switch = ui.switch(words, on_change=lambda e: panel.turn(self, bool(e.value)))
            self._more = ui.element("div")

    @property
    def words(self) -> str:
        return f"{self.effect.id} {effect_name(self.effect.id)} {self.where}".lower()

    def follow(self, effects: dict[str, float]) -> None:
        on = any(key in effects for key in self.keys)
        self.switch.set_value(on)
        if on and not self.sliders:
            self._details()
        self._more.set_visibility(on)
        self.element.classes(add="lab-on" if on else "", remove="" if on else "lab-on")
        for key, (slider, text) in self.sliders.items():
            if key in effects:
                if abs((slider.value or 0.0) - effects[key]) > 1e-9:
                    slider.set_value(effects[key])
                text.set_text(self._shown(key, effects[key]))

    def _shown(self, key: str, value: float) -> str:
        parameter = LAYOUT[key].parameter
        return f"{parameter.name} = {self._panel.session.drive.units.text(value, parameter.unit, 3)}"

    def _details(self) -> None:
        e = self.effect
        with self._more:
            ui.label(e.equation).classes("lab-equation").props(f'aria-label="{texts.EQUATION}"')
            for key in self.keys:
                parameter = LAYOUT[key].parameter
                low, high = smallest(key), largest(key)
                with ui.element("div").classes("lab-size"):
                    slider = ui.slider(
                        min=low, max=high, step=(high - low) / 200.0, value=parameter.null,
                        on_change=lambda e, k=key: self._panel.size(k, e),
                    ).props(f'aria-label="{parameter.meaning}"')  # fmt: skip
                    text = ui.label("").tooltip(parameter.meaning)
                self.sliders[key] = (slider, text)
            if e.tells_itself_by:
                paragraph(texts.TELLS.format(words=e.tells_itself_by), "lab-soft")
            if e.looks_like:
                paragraph(texts.LOOKS_LIKE.format(names=", ".join(map(effect_name, e.looks_like))), "lab-soft")
            if e.separating_experiment:
                paragraph(texts.SEPARATES.format(words=e.separating_experiment), "lab-soft")


class PhysicsPanel:
    """The panel.

    Parameters
    ----------
    session
        The visitor's.
    change
        Takes new settings.
    plain
        Key of the same drive without effects, to be shown beside.
    """

    def __init__(self, session: Session, change: Callable[[Settings], None], plain: str) -> None:
        self.session, self._change, self._plain = session, change, plain
        self._quiet = False
        self._shown: tuple[Any, ...] | None = None
        with card():
            paragraph(texts.PHYSICS_LEAD)
            with ui.element("div").classes("lab-row"):
                self.filter = ui.input(texts.FILTER, on_change=self._filtered).props("dense clearable")
                self.beside = ui.switch(texts.SHOWN_BESIDE, on_change=self._besides)
                ui.button(texts.ALL_OFF, on_click=lambda: self._set({})).props("flat dense no-caps")
            with ui.element("div").classes("lab-effects"):
                self.rows = [_Row(self, effect, where) for effect in switches() for where in effect.where]
        with card():
            self.note = paragraph(texts.NO_EFFECTS, "lab-soft")
            with ui.element("div").classes("lab-plots lab-four"):
                self.plots = [Plot() for _ in range(4)]

    def _filtered(self, e: events.ValueChangeEventArguments[Any]) -> None:
        wanted = str(e.value or "").lower().split()
        for row in self.rows:
            row.element.set_visibility(all(word in row.words for word in wanted))

    def _besides(self, e: events.ValueChangeEventArguments[Any]) -> None:
        s = self.session.settings
        if not self._quiet and bool(e.value) != (s.beside == self._plain):
            self._change(s.replace(beside=self._plain if e.value else ""))

    def _set(self, effects: dict[str, float]) -> None:
        if not self._quiet and effects != dict(self.session.settings.effects):
            self._change(self.session.settings.replace(effects=effects))

    def turn(self, row: _Row, on: bool) -> None:
        """Switch an effect on at plainly present size, or off."""
        effects = {k: v for k, v in self.session.settings.effects.items() if k not in row.keys}
        was = len(effects) != len(self.session.settings.effects)
        if on != was:
            self._set(effects | (plainly_present(row.effect, row.where) if on else {}))

    def size(self, key: str, e: events.ValueChangeEventArguments[Any]) -> None:
        """Give one parameter another value."""
        effects = dict(self.session.settings.effects)
        if e.value is not None and key in effects:
            self._set(effects | {key: float(f"{float(e.value):.6g}")})

    def follow(self) -> None:
        """Bring the switches to the settings."""
        self._quiet = True
        try:
            effects = dict(self.session.settings.effects)
            for row in self.rows:
                row.follow(effects)
            self.beside.set_value(self.session.settings.beside == self._plain)
        finally:
            self._quiet = False

    async def update(self) -> None:
        """Draw the signature, if it is another one."""
        s = self.session.settings
        now = (s.drive, tuple(s.effects.items()))
        if now == self._shown:
            return
        self._shown = now
        self.note.set_visibility(not s.effects)
        drive = self.session.drive
        try:
            charts = await asyncio.to_thread(signature, drive, dict(s.effects)) if s.effects else []
        except ValueError as error:
            self.note.set_text(str(error))
            self.note.set_visibility(True)
            return
        for i, plot in enumerate(self.plots):
            plot.set_visibility(bool(charts))
            if charts and now == self._shown:
                plot.show(charts[i])
