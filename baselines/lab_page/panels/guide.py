"""The handout's in-lab session, 2.1 to 2.6, as a guided path that ends in the report."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from nicegui import ui

from baselines.lab.experiments import FREQUENCIES_HZ, SINE_V, SQUARES_V, STABLE_GAIN, open_loop, p_control
from baselines.lab_page import texts
from baselines.lab_page.elements import card, heading, paragraph
from baselines.lab_page.motion import rig_of
from baselines.lab_page.panels.recordings import Workbench
from baselines.lab_page.session import Session
from baselines.lab_page.settings import Settings
from flexdrive_gym import Drive, Recording
from flexdrive_gym.units import Units
from identification import write_recording

# 2.3 is "a little above" 2.2
_ABOVE = 1.03


class GuidePanel:
    """The panel.

    Parameters
    ----------
    session
        The visitor's.
    change
        Takes new settings.
    add_drive
        Takes a drive; the guide gives none.
    """

    def __init__(
        self, session: Session, change: Callable[[Settings], None], add_drive: Callable[[str, Drive], None]
    ) -> None:
        self.session, self._change = session, change
        self.bench = Workbench(session, "guide", add_drive)
        self.done: dict[str, ui.label] = {}
        self._words: dict[str, ui.label] = {}
        with card():
            paragraph(texts.GUIDE_LEAD)
            for step, (title, _) in texts.STEPS.items():
                with ui.element("section").classes("lab-effect"):
                    heading(title, 3)
                    self._words[step] = paragraph("", "lab-soft")
                    with ui.element("div").classes("lab-row"):
                        ui.button(texts.GO, on_click=lambda _e, s=step: self.set_up(s)).props("dense no-caps outline")
                        press = texts.RECORD_ALL_SINES if step == "2.6" else texts.RECORD
                        ui.button(press, on_click=lambda _e, s=step: self.record(s)).props("dense no-caps unelevated")
                        self.done[step] = paragraph("", "lab-soft")
            ui.button(texts.MAKE_REPORT, on_click=self.report).props("no-caps unelevated")
        self.bench.build_results()
        self.bench.build_overlay()
        self.follow()

    def follow(self) -> None:
        """Tell the steps in the units of the drive that is chosen."""
        for step, words in steps_of(self.session.drive.units).items():
            self._words[step].set_text(words)

    def set_up(self, step: str) -> None:
        """Bring the rig to a step of the handout."""
        s = self.session.settings.replace(reference="moves", pushes=(), factor=1.0)
        steps: dict[str, dict[str, Any]] = {
            "2.1": {"controller": "p", "feedback": "x2", "gain": STABLE_GAIN},
            "2.2": {"controller": "p", "feedback": "x2"},
            "2.3": {"controller": "p", "feedback": "x2", "gain": _ABOVE * s.gain},
            "2.4": {"controller": "p", "feedback": "x1"},
            "2.5": {"controller": "square", "amplitude": SQUARES_V[0], "frequency": 0.5},
            "2.6": {"controller": "sine", "amplitude": SINE_V, "frequency": FREQUENCIES_HZ[0]},
        }
        self._change(s.replace(**steps[step]))

    async def record(self, step: str) -> None:
        """Record the present run, or all sines, as the rig would write it."""
        rig, settings = rig_of(self.session.settings, self.session.drive), self.session.settings
        written = await asyncio.to_thread(_write, list(_runs(step, rig, settings)), self.bench.folder)
        names = ", ".join(path.name.removesuffix(".csv.gz") for path in written[:2]) + (
            " …" if len(written) > 2 else ""
        )
        self.done[step].set_text(f"{texts.RECORDED}: {names}")
        await self.bench.read()

    async def report(self) -> None:
        """Make the handout's report of what was recorded."""
        if not all(self.done[step].text for step in ("2.1", "2.5", "2.6")):
            ui.notify(texts.MISSING_STEPS, type="warning", multi_line=True)
            return
        await self.bench.report()


def steps_of(units: Units) -> dict[str, str]:
    """Return what the handout's steps are, by section, in a rig's units."""
    slow, fast = (units.text(f, "Hz", 3) for f in (FREQUENCIES_HZ[0], FREQUENCIES_HZ[-1]))
    low, high, sine = (units.text(size, "V", 3) for size in (*SQUARES_V, SINE_V))
    gain = units.text(STABLE_GAIN, "V/mm", 3)
    return {
        step: words.format(gain=gain, low=low, high=high, sine=sine, slow=slow, fast=fast)
        for step, (_, words) in texts.STEPS.items()
    }


def _runs(step: str, rig: Drive, settings: Settings) -> Iterable[Recording]:
    if step == "2.6":
        return (open_loop(rig, "sine", SINE_V, f) for f in FREQUENCIES_HZ)
    if step == "2.5":
        amplitude = settings.amplitude if settings.controller == "square" else SQUARES_V[0]
        # the report needs both of the handout's; the visitor's own comes first
        return (open_loop(rig, "square", a, 0.5) for a in dict.fromkeys((amplitude, *SQUARES_V)))
    feedback = "x1" if step == "2.4" or rig.carts == 1 else "x2"
    gain = STABLE_GAIN if step == "2.1" else settings.gain
    return (p_control(rig, gain, "x1" if feedback == "x1" else "x2"),)


def _write(runs: Iterable[Recording], folder: Path) -> list[Path]:
    return [write_recording(recording, folder / f"{recording.name}.csv.gz") for recording in runs]
