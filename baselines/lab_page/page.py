"""The page of one visitor: lays the panels out and brings them to the settings after every change."""

from __future__ import annotations

import asyncio
import json
from dataclasses import dataclass, replace
from math import inf, isfinite
from typing import Any

import numpy as np
from nicegui import background_tasks, ui

from baselines.lab.lab_scale import on_lab_scale
from baselines.lab_page import loop_curves, texts
from baselines.lab_page.chart import Chart
from baselines.lab_page.controller_files import read_controller
from baselines.lab_page.elements import heading, paragraph
from baselines.lab_page.motion import Motion, controller_of, is_quick, rig_of, simulate
from baselines.lab_page.panels.control import ControlPanel
from baselines.lab_page.panels.exercise import ExercisePanel
from baselines.lab_page.panels.guide import GuidePanel
from baselines.lab_page.panels.physics import PhysicsPanel
from baselines.lab_page.panels.recordings import RecordingsPanel, Workbench
from baselines.lab_page.panels.rig import RigPanel
from baselines.lab_page.session import PLAIN, Lab, Session
from baselines.lab_page.settings import Settings, from_query
from baselines.lab_page.stability_lamp import SWING_MM, Lamp, lamp
from flexdrive_gym import Controller, Drive, LinearController

# NiceGUI sends what has changed every 10 ms
_SENT_S = 0.025


@dataclass(frozen=True)
class _Law:
    """A linear controller at factor 1, and what its command is multiplied with."""

    controller: LinearController
    factor: float
    unit: str


class Page:
    """One visitor's page, built into the present client.

    Parameters
    ----------
    lab
        What the command line gave.
    settings
        What the address asked for.
    """

    def __init__(self, lab: Lab, settings: Settings) -> None:
        self.client = ui.context.client
        self.session = Session(lab, settings)
        self._number = 0
        self._design: list[tuple[Settings, Controller | None]] = []
        ui.colors(primary="#1f6fb8", positive="#15803d", negative="#c81e1e", warning="#a16207")
        ui.html(f'<a class="lab-skip" href="#controls">{texts.SKIP}</a>', sanitize=False)
        self._header()
        with ui.element("main").classes("lab-main"):
            with ui.element("div").classes("lab-left"):
                self.rig = RigPanel(self.session, self.change)
            with ui.element("div").classes("lab-right").props('id="controls"'):
                self._tabs()
        with ui.element("footer").classes("lab-footer"):
            paragraph(texts.LOCAL)
        self.change(self.session.settings)
        if lab.exercise:
            self.tabs.set_value(texts.TAB_EXERCISE)
        if lab.recordings:
            if not lab.exercise:
                self.tabs.set_value(texts.TAB_RECORDINGS)
            background_tasks.create(self._begin(), name="lab recordings")

    async def _begin(self) -> None:
        with self.client:
            await self.recordings.begin()

    def close(self) -> None:
        """End what runs for the visitor and remove the visitor's files."""
        for bench in self.benches:
            bench.job.cancel()
        self.session.close()

    @property
    def benches(self) -> list[Workbench]:
        """Every place of the page that runs computations."""
        return [self.recordings.bench, self.guide.bench, self.exercise.bench]

    def _header(self) -> None:
        with ui.element("header").classes("lab-header"):
            with ui.element("div"):
                heading(texts.TITLE, 1)
                paragraph(texts.LEAD, "lab-soft lab-lead")
            ui.element("span").classes("lab-spacer")
            self._drive = ui.select({}, label=texts.DRIVE, on_change=lambda e: self._choose("drive", e.value)).props(
                "dense options-dense"
            )
            self._beside = ui.select({}, label=texts.BESIDE, on_change=lambda e: self._choose("beside", e.value)).props(
                "dense options-dense"
            )
            link = ui.button(icon="link", on_click=lambda: ui.notify(texts.LINK_COPIED))
            link.props(f'flat round dense aria-label="{texts.COPY_LINK}"')
            # in the browser, which allows the clipboard on a click alone, and knows which theme it shows
            link.on("click", js_handler="() => navigator.clipboard && navigator.clipboard.writeText(location.href)")
            theme = ui.button(icon="contrast").props(f'flat round dense aria-label="{texts.THEME}"')
            theme.on("click", js_handler="() => Quasar.Dark.toggle()")
        self.offer()

    def _tabs(self) -> None:
        names = [texts.TAB_CONTROL, texts.TAB_PHYSICS, texts.TAB_RECORDINGS, texts.TAB_GUIDE, texts.TAB_EXERCISE]
        with ui.tabs().classes("lab-tabs").props("dense no-caps align=left outside-arrows mobile-arrows") as self.tabs:
            for name in names:
                ui.tab(name)
        with ui.tab_panels(self.tabs, value=names[0], animated=False, keep_alive=True).classes("w-full lab-tab-panels"):
            with ui.tab_panel(texts.TAB_CONTROL), ui.element("div").classes("lab-stack"):
                self.control = ControlPanel(self.session, self.change, self._load)
            with ui.tab_panel(texts.TAB_PHYSICS), ui.element("div").classes("lab-stack"):
                self.physics = PhysicsPanel(self.session, self.change, PLAIN)
            with ui.tab_panel(texts.TAB_RECORDINGS), ui.element("div").classes("lab-stack"):
                self.recordings = RecordingsPanel(self.session, self.add_drive)
            with ui.tab_panel(texts.TAB_GUIDE), ui.element("div").classes("lab-stack"):
                self.guide = GuidePanel(self.session, self.change, self.add_drive)
            with ui.tab_panel(texts.TAB_EXERCISE), ui.element("div").classes("lab-stack"):
                self.exercise = ExercisePanel(self.session, self.add_drive)

    # ---- what the visitor does -----------------------------------------------------------------------------------------------
    def offer(self) -> None:
        """Offer the drives that there are."""
        s = self.session.settings
        names = {key: drive.name for key, drive in self.session.drives.items()}
        self._drive.set_options(names, value=s.drive)
        beside = {"": texts.ALONE, PLAIN: texts.WITHOUT_EFFECTS.format(name=self.session.drive.name)}
        self._beside.set_options(beside | {k: v for k, v in names.items() if k != s.drive}, value=s.beside)

    def _choose(self, what: str, key: Any) -> None:
        if key is not None and getattr(self.session.settings, what) != key:
            self.change(self.session.settings.replace(**{what: key}))
            self.offer()

    def _load(self, name: str, content: bytes) -> str:
        try:
            self.session.own = read_controller(name, content, self.session.drive)
        except (ValueError, TypeError, OSError) as error:
            return texts.LOAD_CONTROLLER_REFUSED.format(name=name, reason=error)
        self._design.clear()
        self.change(self.session.settings.replace(controller="own"))
        return texts.LOADED_CONTROLLER.format(name=name)

    def add_drive(self, key: str, drive: Drive) -> None:
        """Offer a drive and show it."""
        self.session.add_drive(key, on_lab_scale(drive))
        self._design.clear()
        self.change(self.session.settings.replace(drive=key, effects={}))
        self.offer()

    # ---- after a change ------------------------------------------------------------------------------------------------------
    def change(self, settings: Settings) -> None:
        """Take new settings and bring everything to them, motion first."""
        if settings.beside == settings.drive:
            settings = settings.replace(beside="")
        self.session.settings = settings
        self._number += 1
        self.control.follow()
        self.physics.follow()
        self.guide.follow()
        background_tasks.create(self._update(self._number), name="lab update")

    async def _update(self, number: int) -> None:
        session, settings = self.session, self.session.settings
        with self.client:
            try:
                controller = await self._controller(settings, session.drive)
                if number != self._number:
                    return  # a newer change is being shown
                if settings.pushes or not (controller is None or isinstance(controller, LinearController)):
                    # the interpreted loop takes a tenth of a second, in which other visitors would wait
                    motions = await asyncio.to_thread(self._motions, settings, controller)
                else:
                    motions = self._motions(settings, controller)
                if number != self._number:
                    return
                self.rig.show(motions)
                query = json.dumps("?" + settings.query())
                self.client.run_javascript(f"history.replaceState(null, '', {query})")
                await asyncio.sleep(_SENT_S)  # the motion is on its way before the charts are computed
                if number != self._number:
                    return
                await self._charts(number, settings, controller)
            except ValueError as error:
                ui.notify(str(error), type="negative", multi_line=True)
            await self.physics.update()

    async def _controller(self, settings: Settings, drive: Drive) -> Controller | None:
        if is_quick(settings):
            return controller_of(settings, drive, self.session.own)
        # what a design depends on
        key = Settings(
            drive=settings.drive, controller=settings.controller, limit=settings.limit, sample_time=settings.sample_time
        )
        for known, designed in self._design:
            if known == key:
                return designed
        name = texts.CONTROLLERS.get(settings.controller, settings.controller)
        note = ui.notification(texts.DESIGNING.format(name=name), spinner=True, timeout=None)
        try:
            made = await asyncio.to_thread(controller_of, settings, drive)
        finally:
            note.dismiss()
        self._design.append((key, made))
        return made

    def _motions(self, settings: Settings, controller: Controller | None) -> list[Motion]:
        motions = [simulate(settings, self.session.drive, controller)]
        if settings.beside:
            plain = settings.replace(effects={})
            other = self.session.drive if settings.beside == PLAIN else self.session.drives[settings.beside]
            second = simulate(plain, other, controller)
            name = texts.WITHOUT_EFFECTS.format(name=other.name) if settings.beside == PLAIN else other.name
            motions.append(replace(second, name=name))
        return motions

    async def _charts(self, number: int, settings: Settings, controller: Controller | None) -> None:
        if controller is None:
            self.control.show({}, texts.OPEN_LOOP)
            self.rig.light(Lamp("unknown", texts.OPEN_LOOP))
            return
        rig = rig_of(settings, self.session.drive)
        if not isinstance(controller, LinearController):
            self.control.show({}, texts.NOT_LINEAR)
            swing = await asyncio.to_thread(_swing_of_any, settings, self.session.drive, controller)
            if number == self._number and swing is not None:
                self.rig.light(Lamp("unstable" if swing > SWING_MM else "stable", texts.WATCH))
            return
        law = _Law(controller, settings.factor, "")
        if settings.controller == "p":
            feedback = settings.feedback if rig.carts == 2 else "x1"
            law = _Law(loop_curves.unit_p(feedback, settings.sample_time), settings.gain, rig.units.name("V/mm"))
        nyquist, gain, phase, found = loop_curves.nyquist_and_bode(rig, law.controller, law.factor)
        charts = {"nyquist": nyquist, "gain": gain, "phase": phase}
        charts["locus"] = loop_curves.root_locus(rig, law.controller, law.factor)
        self.control.show(charts)
        self.rig.light(lamp(rig, law.controller, law.factor, found, None, law.unit))
        factors = await asyncio.to_thread(loop_curves.amplitude_limit, rig, law.controller)
        if number != self._number:
            return
        self.control.show({"amplitude": _amplitude_chart(rig, law, factors)})
        grows = loop_curves.smallest_growing(factors, law.factor)
        if grows is not None and not found.stable:
            self.rig.light(lamp(rig, law.controller, law.factor, found, grows, law.unit))


def _amplitude_chart(rig: Drive, law: _Law, factors: Any) -> Chart:
    per_gain = rig.units.one("V/mm") if law.unit else 1.0
    shown = None if factors is None else factors / per_gain
    return loop_curves.amplitude_chart(
        shown, law.factor / per_gain, law.unit, rig.units.one("mm"), rig.units.length
    )  # fmt: skip


def _swing_of_any(settings: Settings, drive: Drive, controller: Controller) -> float:
    """Return the last cart's swing in the second half of one move, of a controller that is not linear [mm]."""
    motion = simulate(settings.replace(reference="one_move", pushes=()), drive, controller)
    last = motion.x1 if motion.x2 is None else motion.x2
    swing = float(np.ptp(last[len(last) // 2 :]))
    return swing if motion.stopped is None and isfinite(swing) else inf


def build_page(lab: Lab) -> Page:
    """Build the page for whoever asks; the address holds the settings."""
    request = ui.context.client.request
    settings, refused = from_query(request.query_params.multi_items())
    page = Page(lab, settings)
    ui.context.client.on_delete(page.close)
    if refused:
        ui.notify(texts.REFUSED.format(reasons="; ".join(refused)), type="warning", multi_line=True)
    return page
