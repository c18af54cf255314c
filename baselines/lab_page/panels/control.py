"""Control: controller, gain, rig settings, and the charts of the loop that follow the slider."""

from __future__ import annotations

from collections.abc import Callable
from math import log10
from typing import Any

from nicegui import events, ui

from baselines.controllers import FAMILIES
from baselines.lab_page import texts
from baselines.lab_page.chart import Chart
from baselines.lab_page.elements import Plot, card, paragraph
from baselines.lab_page.session import Session
from baselines.lab_page.settings import (
    LARGEST_COUNT_MM,
    LARGEST_DELAY_S,
    LARGEST_FACTOR,
    LARGEST_GAIN,
    LARGEST_LIMIT_V,
    SAMPLE_TIMES_S,
    SMALLEST_FACTOR,
    SMALLEST_GAIN,
    Settings,
)
from baselines.loop_analysis.stability_limit import with_rig
from baselines.rl.agents import agent_names
from flexdrive_gym.references import STROKE_MM
from flexdrive_gym.units import Units

# of the slider: a factor of 1.0116 a step, finer than a hand turns
_STEP = 0.005


def controllers(carts: int, own: bool) -> dict[str, str]:
    """Return what controls the rig, key to words."""
    found = {"p": texts.P_CONTROL}
    found |= {name: words for name, words in texts.CONTROLLERS.items() if name in FAMILIES}
    if carts == 2:
        found |= {f"agent:{name}": texts.AGENT.format(name=name) for name in agent_names()}
    if own:
        found["own"] = texts.OWN_CONTROLLER
    return found | {"square": texts.SQUARE, "sine": texts.SINE}


class ControlPanel:
    """The panel.

    Parameters
    ----------
    session
        The visitor's.
    change
        Takes new settings.
    load
        Takes a controller file: name and content; returns a sentence for the visitor.
    """

    def __init__(self, session: Session, change: Callable[[Settings], None], load: Callable[[str, bytes], str]) -> None:
        self._session, self._change, self._load = session, change, load
        self._quiet = False
        with card():
            self._choices()
            self._gain_row()
            self._rig_settings()
        with card(), ui.element("div").classes("lab-stack"):
            self.note = paragraph("", "lab-soft")
            with ui.element("div").classes("lab-plots lab-loop") as self._plots:
                self.plots = {name: Plot() for name in ("locus", "nyquist", "gain", "phase", "amplitude")}
        self.follow()

    # ---- elements ------------------------------------------------------------------------------------------------------------
    def _choices(self) -> None:
        s = self._session.settings
        with ui.element("div").classes("lab-row"):
            self.controller = ui.select(
                controllers(self._session.drive.carts, self._session.own is not None),
                label=texts.CONTROLLER,
                on_change=lambda e: self._set(controller=e.value),
            ).props("dense options-dense")
            self.feedback = ui.select(
                {"x2": texts.FEEDBACK_X2, "x1": texts.FEEDBACK_X1},
                value=s.feedback,
                label=texts.FEEDBACK,
                on_change=lambda e: self._set(feedback=e.value),
            ).props("dense options-dense")
            self.reference = ui.select(
                _references(self._session.drive.units),
                value=s.reference,
                label=texts.REFERENCE,
                on_change=lambda e: self._set(reference=e.value),
            ).props("dense options-dense")
            units = self._session.drive.units
            self.amplitude = ui.number(
                f"{texts.AMPLITUDE} [{units.command}]",
                min=0.0,
                step=0.1,
                on_change=lambda e: self._number("amplitude", e.value, "V", 0.0, LARGEST_LIMIT_V),
            ).props("dense")
            self.frequency = ui.number(
                f"{texts.FREQUENCY} [Hz]",
                min=0.05,
                step=0.1,
                on_change=lambda e: self._number("frequency", e.value, "Hz", 0.05, 50.0),
            ).props("dense")

    def _gain_row(self) -> None:
        with ui.element("div").classes("lab-gain") as self._gain:
            with ui.element("output").props('aria-live="off"'):
                self.gain_text = ui.label("")
            self.slider = ui.slider(
                min=log10(SMALLEST_GAIN), max=log10(LARGEST_GAIN), step=_STEP, on_change=self._slid
            ).props(f'aria-label="{texts.GAIN}" color="primary"')
            self.exact = ui.number(on_change=self._typed, format="%.4g").props(f'dense aria-label="{texts.GAIN}"')

    def _rig_settings(self) -> None:
        units = self._session.drive.units
        with ui.expansion(texts.RIG_SETTINGS).props("dense").classes("w-full"), ui.element("div").classes("lab-row"):
            self.limit = ui.number(
                f"{texts.LIMIT} [{units.command}]",
                on_change=lambda e: self._number("limit", e.value, "V", 0.1, LARGEST_LIMIT_V),
            ).props("dense step=0.5")
            self.sample_time = ui.select(
                {Ts: f"{1e3 * Ts:g} ms" for Ts in SAMPLE_TIMES_S},
                label=texts.SAMPLE_TIME,
                on_change=lambda e: self._set(sample_time=e.value),
            ).props("dense options-dense")
            self.delay = ui.number(
                f"{texts.DELAY} [ms]",
                on_change=lambda e: self._number(
                    "delay", None if e.value is None else 1e-3 * e.value, "s", 0.0, LARGEST_DELAY_S
                ),
            ).props("dense step=1")
            self.count = ui.number(
                f"{texts.COUNT} [{units.length}]",
                on_change=lambda e: self._number("count", e.value, "mm", 0.0, LARGEST_COUNT_MM),
            ).props("dense step=0.01")
            ui.button(
                texts.OWN_SETTINGS, on_click=lambda: self._set(limit=None, delay=None, count=None, sample_time=1e-3)
            ).props("flat dense no-caps")
            ui.upload(
                label=texts.LOAD_CONTROLLER, auto_upload=True, max_files=50, max_file_size=16_000_000,
                on_upload=self._loaded,
            ).props('accept=".toml,.npz" flat bordered').classes("w-full")  # fmt: skip

    async def _loaded(self, e: events.UploadEventArguments) -> None:
        ui.notify(self._load(e.file.name, await e.file.read()), multi_line=True)

    # ---- from the page to the settings ---------------------------------------------------------------------------------------
    def _set(self, **changes: Any) -> None:
        if not self._quiet and any(getattr(self._session.settings, k) != v for k, v in changes.items()):
            self._change(self._session.settings.replace(**changes))

    def _number(self, name: str, value: float | None, unit: str, low: float, high: float) -> None:
        if value is None or self._quiet:
            return
        given = self._session.drive.units.to_engine(float(value), unit)
        self._set(**{name: min(max(given, low), high)})

    @property
    def _is_p(self) -> bool:
        return self._session.settings.controller == "p"

    def _slid(self, e: events.ValueChangeEventArguments[Any]) -> None:
        if e.value is not None:
            self._gained(float(f"{10.0**e.value:.4g}"))

    def _typed(self, e: events.ValueChangeEventArguments[Any]) -> None:
        if e.value is not None:
            units = self._session.drive.units
            self._gained(units.to_engine(float(e.value), "V/mm") if self._is_p else float(e.value))

    def _gained(self, value: float) -> None:
        if self._is_p:
            self._set(gain=min(max(value, SMALLEST_GAIN), LARGEST_GAIN))
        else:
            self._set(factor=min(max(value, SMALLEST_FACTOR), LARGEST_FACTOR))

    # ---- from the settings to the page ---------------------------------------------------------------------------------------
    def follow(self) -> None:
        """Bring the panel to the settings, wherever they were changed."""
        s, units = self._session.settings, self._session.drive.units
        rig = with_rig(self._session.drive)
        self._quiet = True
        try:
            offered = controllers(rig.carts, self._session.own is not None)
            self.controller.set_options(offered, value=s.controller if s.controller in offered else "p")
            self.feedback.set_value(s.feedback if rig.carts == 2 else "x1")
            self.reference.set_options(_references(units), value=s.reference)
            self.sample_time.set_value(s.sample_time)
            self.amplitude.set_value(units.of_rig(s.amplitude, "V")[0])
            self.frequency.set_value(units.of_rig(s.frequency, "Hz")[0])
            limit = rig.voltage_limit if s.limit is None else s.limit
            self.limit.set_value(units.of_rig(limit, "V")[0])
            self.delay.set_value(1e3 * units.of_rig(rig["input_delay.tau"] if s.delay is None else s.delay, "s")[0])
            own = rig["encoder_quantisation.encoder_1.quantum"]
            self.count.set_value(float(f"{units.of_rig(own if s.count is None else s.count, 'mm')[0]:.4g}"))
            self._gain.set_visibility(not s.open_loop and not s.controller.startswith("agent:"))
            self.feedback.set_visibility(s.controller == "p" and rig.carts == 2)
            self.reference.set_visibility(not s.open_loop)
            self.amplitude.set_visibility(s.open_loop)
            self.frequency.set_visibility(s.open_loop)
            low, high = (SMALLEST_GAIN, LARGEST_GAIN) if self._is_p else (SMALLEST_FACTOR, LARGEST_FACTOR)
            self.slider.props(f"min={log10(low)} max={log10(high)}")
            value = s.gain if self._is_p else s.factor
            # a slider that the hand is on must not be told where it stands
            stands = self.slider.value
            if stands is None or abs(10.0**stands / value - 1.0) > 2.0 * _STEP:
                self.slider.set_value(log10(value))
            self.exact.set_value(float(f"{units.of_rig(value, 'V/mm')[0] if self._is_p else value:.4g}"))
            words = units.text(value, "V/mm", 3) if self._is_p else f"{value:.3g}"
            self.slider.props(f'aria-valuetext="{words}"')
            self.gain_text.set_text(
                f"{texts.GAIN} = {units.text(value, 'V/mm')}" if self._is_p else f"{texts.FACTOR} × {value:.3g}"
            )
        finally:
            self._quiet = False

    def show(self, charts: dict[str, Chart], note: str = "") -> None:
        """Draw charts by name; an empty dictionary hides them all."""
        self.note.set_text(note)
        self.note.set_visibility(bool(note))
        self._plots.set_visibility(bool(charts) or not note)
        for name, chart in charts.items():
            self.plots[name].show(chart)


def _references(units: Units) -> dict[str, str]:
    """Return the references by their names, lengths in the rig's units."""
    return {key: words.format(stroke=units.text(STROKE_MM, "mm")) for key, words in texts.REFERENCES.items()}
