"""Exercise: a concealed effect, the student's experiments and guess, then the truth beside the diagnosis."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from shutil import rmtree

from nicegui import ui

from baselines.lab_page import texts
from baselines.lab_page.elements import card, heading, paragraph
from baselines.lab_page.exercise import Exercise, Kind, answer, choices, conceal, conduct
from baselines.lab_page.panels.recordings import Workbench
from baselines.lab_page.session import Session
from flexdrive_gym import Drive

_USUAL: dict[str, tuple[float, float]] = {"square": (2.0, 0.5), "sine": (2.5, 2.0), "p_control": (0.05, 0.5)}


class ExercisePanel:
    """The panel.

    Parameters
    ----------
    session
        The visitor's.
    add_drive
        Takes a drive; the exercise gives none, so that its rig is not on the stage.
    """

    def __init__(self, session: Session, add_drive: Callable[[str, Drive], None]) -> None:
        self.session = session
        self.bench = Workbench(session, "exercise", add_drive)
        self.exercise: Exercise | None = None
        with card():
            paragraph(texts.EXERCISE_LEAD)
            ui.button(texts.NEW_RIG, on_click=self._begin_new).props("dense no-caps unelevated")
            with ui.element("div") as self._work:
                self._experiment_row()
                with ui.element("div").classes("lab-row"):
                    self.count = paragraph("", "lab-soft")
                    ui.button(texts.FIT_RIG, on_click=self.bench.identify).props("dense no-caps outline")
                heading(texts.YOUR_GUESS, 3)
                with ui.element("div").classes("lab-row"):
                    self.guess = ui.select(choices(), label=texts.YOUR_GUESS, with_input=True).props(
                        "dense options-dense"
                    )
                    self.answer = ui.button(texts.GUESS, on_click=self._answer).props("dense no-caps unelevated")
                self.verdict = paragraph("", "lab-finding")
                self.ask = ui.button(texts.ASK_DIAGNOSIS, on_click=self.bench.diagnose).props("dense no-caps outline")
        self._work.set_visibility(False)
        self.bench.build_results()
        self.bench.build_overlay()

    def _experiment_row(self) -> None:
        with ui.element("div").classes("lab-row"):
            self.kind = ui.select(
                texts.EXPERIMENTS, value="square", label=texts.EXPERIMENT, on_change=lambda e: self._kind(e.value)
            ).props("dense options-dense")
            self.amplitude = ui.number(f"{texts.AMPLITUDE} [V]", value=2.0, min=0.01, step=0.1).props("dense")
            self.frequency = ui.number(f"{texts.FREQUENCY} [Hz]", value=0.5, min=0.05, step=0.5).props("dense")
            self.go = ui.button(texts.RUN_EXPERIMENT, on_click=self._run).props("dense no-caps unelevated")

    def _kind(self, kind: str) -> None:
        amplitude, frequency = _USUAL[kind]
        self.amplitude.set_value(amplitude)
        self.frequency.set_value(frequency)
        self.amplitude.props(f'label="{f"{texts.GAIN} [V/mm]" if kind == "p_control" else f"{texts.AMPLITUDE} [V]"}"')
        self.frequency.set_visibility(kind != "p_control")

    async def _begin_new(self) -> None:
        await self.begin()

    async def begin(self, seed: int | None = None) -> None:
        """Conceal an effect and forget the last."""
        self.bench.job.cancel()
        rmtree(self.bench.folder, ignore_errors=True)
        rmtree(self.bench.results, ignore_errors=True)
        self.exercise, self.bench.drive = conceal(seed), None
        self.verdict.set_visibility(False)
        self.ask.set_visibility(False)
        self.answer.set_enabled(True)
        self.guess.set_value(None)
        self.bench.outcome.clear()
        self._work.set_visibility(True)
        self.count.set_text(texts.RUNS_DONE.format(count=0))
        await self.bench.read()

    async def _run(self) -> None:
        if self.exercise is None:
            ui.notify(texts.FIRST_A_RIG, type="warning")
            return
        kind: Kind = self.kind.value
        self.go.set_enabled(False)
        try:
            amplitude, frequency = float(self.amplitude.value or 0.0), float(self.frequency.value or 0.0)
            path = await asyncio.to_thread(conduct, self.exercise, self.bench.folder, kind, amplitude, frequency)
        except ValueError as error:
            ui.notify(str(error), type="negative", multi_line=True)
            return
        finally:
            self.go.set_enabled(True)
        self.count.set_text(texts.RUNS_DONE.format(count=self.exercise.runs))
        self.bench.recording.set_options({path.stem: path.stem}, value=path.stem)
        await self.bench.read()

    def _answer(self) -> None:
        if self.exercise is None or self.guess.value is None:
            return
        told = answer(self.exercise, str(self.guess.value))
        self.answer.set_enabled(False)
        self.verdict.set_text(told.sentence)
        self.verdict.set_visibility(True)
        self.ask.set_visibility(True)
