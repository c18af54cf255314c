"""Recordings: drop them, check, identify, overlay, diagnose, download. Nothing leaves the machine."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from pathlib import Path
from shutil import copytree
from time import monotonic
from typing import Any

from nicegui import ui

from baselines.lab.sample import FOLDER as SAMPLE_FOLDER
from baselines.lab_page import texts
from baselines.lab_page.elements import Drop, Plot, card, heading, paragraph, text_of
from baselines.lab_page.jobs import Job, JobError
from baselines.lab_page.overlay import Signal, overlay, signals
from baselines.lab_page.session import Session
from flexdrive_gym import Drive, Recording, load_drive
from identification import RecordingError, read_recordings
from identification.quantities import HANDOUT_RATIOS
from identification.recordings import RecordingSet

_MOST_LISTED = 60


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table as HTML; nothing in it is markup."""
    top = "".join(f"<th scope='col'>{text_of(cell)}</th>" for cell in head)
    body = "".join("<tr>" + "".join(f"<td>{text_of(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<div class='lab-scroll'><table class='lab-table'><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table></div>"


class Workbench:
    """Folder, overlay and computations of one set of recordings; the panel and the exercise each have one.

    Parameters
    ----------
    session
        The visitor's.
    folder
        Name of the folder within the visitor's.
    add_drive
        Takes a drive that was found: key, drive.
    """

    def __init__(self, session: Session, folder: str, add_drive: Callable[[str, Drive], None]) -> None:
        self.session, self._name, self._add_drive = session, folder, add_drive
        self._shown_drives: set[Path] = set()
        self.job, self.found = Job(), RecordingSet((), ())
        self.drive: Drive | None = None
        self._span: tuple[float, float] | None = None
        self._quiet = False

    @property
    def folder(self) -> Path:
        """Where the recordings are."""
        return self.session.folder / self._name

    @property
    def results(self) -> Path:
        """Where computations write."""
        return self.session.folder / f"{self._name}-results"

    @property
    def _brought(self) -> bool:
        """Whether the visitor brought files."""
        return self.folder.is_dir() and any(p.is_file() for p in self.folder.rglob("*"))

    def sources(self) -> list[str]:
        """Return what commands are given: the visitor's files, or the command line's."""
        if self._brought:
            return [str(self.folder)]
        return [str(p) for p in self.session.lab.recordings] if self._name == "recordings" else []

    def _rig(self) -> Path | None:
        """Return the description of the columns, where there is one."""
        own = sorted(self.folder.rglob("rig.toml")) if self.folder.is_dir() else []
        return own[0] if own else (self.session.lab.rig if self._name == "recordings" else None)

    def _choice(self) -> dict[str, Any]:
        """Return which files are read, and whether a bad one stops: what was told of the command line's recordings."""
        lab = self.session.lab
        if self._brought or self._name != "recordings":
            return {}
        return {"strict": lab.strict, "only": lab.only, "skip": lab.skip}

    def options(self) -> list[str]:
        """Return the options with which commands read the sources as the page does."""
        rig, choice = self._rig(), self._choice()
        found = ["--rig", str(rig)] if rig is not None else []
        found += ["--strict"] if choice.get("strict") else []
        return found + [
            word for name in ("only", "skip") for glob in choice.get(name, ()) for word in (f"--{name}", glob)
        ]

    def drives(self) -> list[str]:
        """Offer the drives that were dropped; return one sentence for each that is none."""
        told = []
        for path in sorted(self.folder.rglob("*.toml")) if self.folder.is_dir() else ():
            if path.name == "rig.toml" or path in self._shown_drives:
                continue
            self._shown_drives.add(path)
            try:
                self._add_drive(f"own{len(self._shown_drives)}", load_drive(path))
            except (ValueError, TypeError, OSError) as error:
                told.append(str(error).replace(str(self.folder), "").lstrip("/"))
        return told

    # ---- elements ------------------------------------------------------------------------------------------------------------
    def build_overlay(self) -> None:
        """Build the choice of recording and signal, and the chart."""
        with card(classes="lab-wide") as self._overlay_card:
            heading(texts.OVERLAY)
            with ui.element("div").classes("lab-row"):
                self.recording = ui.select({}, label=texts.RECORDING, on_change=self._chosen).props(
                    "dense options-dense"
                )
                self.signal = ui.select({}, label=texts.CHANNEL, on_change=self._chosen).props("dense options-dense")
            self.plot = Plot(self._brushed)
            self.fit = paragraph("", "lab-soft")
            paragraph(texts.OVERLAY_HINT, "lab-soft")
        self._overlay_card.set_visibility(False)

    def build_results(self) -> None:
        """Build where stages, errors and findings are shown."""
        with card() as self._results_card:
            with ui.element("div").props('role="status" aria-live="polite"'):
                self.status = paragraph("")
                self.stages = ui.html("", sanitize=False)
            self.cancel = ui.button(texts.CANCEL, on_click=self.job.cancel).props("outline dense no-caps")
            self.outcome = ui.element("div").classes("lab-stack")
        self._results_card.set_visibility(False)
        self.cancel.set_visibility(False)

    async def read(self) -> None:
        """Read what is in the folder and offer it."""
        sources = self.sources()
        self._span = None
        if not sources:
            self.found = RecordingSet((), ())
        else:
            try:
                self.found = await asyncio.to_thread(
                    read_recordings, [Path(s) for s in sources], rig=self._rig(), **self._choice()
                )
            except (RecordingError, ValueError, OSError) as error:
                self.found = RecordingSet((), ())
                self.say(str(error))
        self._overlay_card.set_visibility(len(self.found) > 0)
        self._quiet = True
        names = {r.name: f"{r.name} ({r.excitation.text(r.units)})" for r in self.found}
        chosen = self.recording.value if self.recording.value in names else next(iter(names), None)
        self.recording.set_options(names, value=chosen)
        self._quiet = False
        await self._chosen()

    def say(self, words: str) -> None:
        """Show a sentence where results are."""
        self._results_card.set_visibility(True)
        self.status.set_text(words)

    def _current(self) -> Recording | None:
        return next((r for r in self.found if r.name == self.recording.value), None)

    async def _chosen(self, _e: Any = None) -> None:
        recording = self._current()
        if self._quiet or recording is None:
            return
        have = signals(recording)
        self._quiet = True
        self.signal.set_options({s: s for s in have}, value=self.signal.value if self.signal.value in have else have[0])
        self._quiet = False
        self._span = None
        await self.draw()

    async def _brushed(self, low: float | None, high: float | None) -> None:
        self._span = None if low is None or high is None else (low, high)
        await self.draw()

    async def draw(self) -> None:
        """Draw the overlay."""
        recording, signal = self._current(), self.signal.value
        if recording is None or signal is None:
            return
        drive = self.drive
        shown, own = self.session.drive.units, recording.units
        if drive is None and (shown.length, shown.command) == (own.length, own.command) and self._name == "recordings":
            drive = self.session.drive.rescaled(own)
        known: Signal = signal
        chart, rms = await asyncio.to_thread(overlay, drive, recording, known, self._span)
        self.plot.show(chart)
        unit = recording.units.name("mm/s" if known[0] == "v" else "mm")
        words = "" if rms is None else texts.FIT_RMS.format(rms=f"{rms:.3g} {unit}")
        self.fit.set_text(f"{words}, {drive.name}" if words and drive is not None else words)

    # ---- computations --------------------------------------------------------------------------------------------------------
    async def command(self, what: str, *arguments: str) -> dict[str, Any] | None:
        """Run a command on the recordings, show its stages; ``None`` where it failed and said why."""
        sources = self.sources()
        if self.job.running:
            ui.notify(texts.BUSY, type="warning")
            return None
        if not sources:
            self.say(texts.NOTHING_READ)
            return None
        seen: list[str] = []
        begin = monotonic()

        def tell(stage: str) -> None:
            seen.append(stage)
            self.status.set_text(texts.RUNNING.format(what=what, stage=stage))
            shown = "".join(f"<li>{text_of(s)}</li>" for s in reversed(seen[-9:-1]))
            self.stages.set_content(f"<ul class='lab-stages'>{shown}</ul>")

        self._results_card.set_visibility(True)
        self.cancel.set_visibility(True)
        self.outcome.clear()
        tell(texts.READING)
        try:
            answer = await self.job.run([arguments[0], *sources, *self.options(), *arguments[1:]], tell)
        except JobError as error:
            self.say(str(error))
            return None
        finally:
            self.cancel.set_visibility(False)
            self.stages.set_content("")
        self.say(texts.DONE.format(what=what, seconds=monotonic() - begin))
        return answer

    async def identify(self) -> None:
        """Identify with free ratios, show the quantities, take the drive."""
        await self._identify(texts.IDENTIFIED, "identified", ())

    async def identify_tied(self) -> None:
        """Identify with the handout's ratios held, to be shown beside the free fit."""
        ratios = [text for name, value in HANDOUT_RATIOS.items() for text in (f"--{name}", f"{value:g}")]
        await self._identify(texts.IDENTIFIED_TIED, "tied", ratios)

    async def _identify(self, name: str, key: str, options: Sequence[str]) -> None:
        drive = self.results / key / "drive.toml"
        drive.parent.mkdir(parents=True, exist_ok=True)
        answer = await self.command(texts.IDENTIFY, "identify", "--no-compare-tied", *options, "-o", str(drive))
        if answer is None:
            return
        with self.outcome:
            ui.html(
                table((texts.QUANTITY, texts.VALUE, texts.INTERVAL, texts.UNIT), _quantities(answer)), sanitize=False
            )
            self._links(drive.parent, ("drive.toml",))
        await self._take(drive, name, key)

    async def diagnose(self) -> dict[str, Any] | None:
        """Diagnose, show findings, take the drive; return the diagnosis."""
        folder = self.results / "diagnosis"
        answer = await self.command(texts.DIAGNOSE, "diagnose", "--force", "-o", str(folder))
        if answer is None:
            return None
        with self.outcome:
            heading(texts.VERDICTS.get(answer["verdict"], answer["verdict"]), 3)
            for finding in answer["findings"]:
                paragraph(finding["statement"], "lab-finding")
            for located in answer.get("located", [])[:3]:
                where = located["where"].replace("_", " ")
                paragraph(f"{where}: {located['share_of_error']:.0%}. {located.get('evidence', '')}", "lab-soft")
            self._links(folder, ("report.html", "diagnosis.json", "drive.toml"))
            self._frame(folder / "report.html")
        await self._take(folder / "drive.toml", texts.DIAGNOSED, "diagnosed")
        return answer

    async def report(self) -> None:
        """Make the handout's report."""
        target = self.results / "handout" / "report.html"
        answer = await self.command(texts.REPORT, "report", "-o", str(target))
        if answer is not None:
            with self.outcome:
                self._links(target.parent, ("report.html",))
                self._frame(target)

    async def _take(self, path: Path, name: str, key: str) -> None:
        self.drive = load_drive(path).replace(name=name)
        if self._name == "recordings":
            self._add_drive(key, self.drive)
        await self.draw()

    def _frame(self, page: Path) -> None:
        address = f"/file/{self.session.token}/{page.relative_to(self.session.folder).as_posix()}"
        ui.element("iframe").classes("lab-frame").props(
            f'src="{address}" title="{texts.REPORT}" sandbox="allow-scripts"'
        )

    def _links(self, folder: Path, names: Sequence[str]) -> None:
        below = folder.relative_to(self.session.folder)
        with ui.element("div").classes("lab-row"):
            for name in names:
                address = f"/file/{self.session.token}/{below.as_posix()}/{name}"
                if name.endswith(".html"):
                    ui.link(texts.SHOW_REPORT, address, new_tab=True)
                ui.link(texts.DOWNLOAD.format(name=name), f"{address}?download=1")


def _quantities(answer: dict[str, Any]) -> list[list[str]]:
    rows = []
    for name, q in answer["quantities"].items():
        if q.get("value") is None:
            continue
        bounds = q.get("ci95")
        interval = "" if bounds is None else f"{bounds[0]:.4g} … {bounds[1]:.4g}"
        rows.append([name, f"{q['value']:.4g}", interval, q.get("unit", "")])
    return rows


class RecordingsPanel:
    """The panel.

    Parameters
    ----------
    session
        The visitor's.
    add_drive
        Takes a drive that was found.
    """

    def __init__(self, session: Session, add_drive: Callable[[str, Drive], None]) -> None:
        self.session = session
        self.bench = Workbench(session, "recordings", add_drive)
        with card():
            paragraph(texts.RECORDINGS_LEAD)
            Drop(f"/upload/{session.token}", self._sent)
            with ui.element("div").classes("lab-row"):
                ui.button(texts.IDENTIFY, on_click=self.bench.identify).props("dense no-caps unelevated")
                ui.button(texts.TIED, on_click=self.bench.identify_tied).props("dense no-caps outline")
                ui.button(texts.DIAGNOSE, on_click=self.bench.diagnose).props("dense no-caps unelevated")
                ui.button(texts.REPORT, on_click=self.bench.report).props("dense no-caps outline")
                ui.button(texts.SAMPLE, on_click=self._sample).props("flat dense no-caps")
                ui.button(texts.FORGET, on_click=self._forget).props("flat dense no-caps")
            self.refused = ui.html("", sanitize=False)
            self.checked = ui.html("", sanitize=False).props('role="status"')
            with ui.element("div").classes("lab-listed").props('tabindex="0"'):
                self.listed = ui.html(f"<p>{texts.NOTHING_READ}</p>", sanitize=False)
        self.bench.build_results()
        self.bench.build_overlay()

    async def begin(self) -> None:
        """Read what the command line gave."""
        if self.session.lab.recordings:
            await self.refresh()

    async def _sent(self, refused: list[str]) -> None:
        refused = [*refused, *self.bench.drives()]
        self.refused.set_content("".join(f"<p class='lab-note' role='alert'>{text_of(r)}</p>" for r in refused[:20]))
        await self.refresh()

    async def _sample(self) -> None:
        await asyncio.to_thread(copytree, SAMPLE_FOLDER, self.bench.folder, dirs_exist_ok=True)
        await self.refresh()

    async def _forget(self) -> None:
        self.bench.job.cancel()
        self.session.close()
        self.bench.drive = None
        self.refused.set_content("")
        await self.refresh()

    async def refresh(self) -> None:
        """Read again and list what was understood."""
        self.listed.set_content(f"<p>{texts.READING}</p>")
        self.checked.set_content("")
        await self.bench.read()
        found = self.bench.found
        if not len(found) and not found.skipped:
            self.listed.set_content(f"<p>{texts.NOTHING_READ}</p>")
            return
        rows = [
            [r.name, r.excitation.text(r.units), str(r.n), ", ".join(name for name, _v in r.channels())]
            for r in found[:_MOST_LISTED]
        ]
        html = f"<h2>{texts.EXPERIMENTS_READ}: {text_of(found.summary())}</h2>"
        html += "".join(
            f"<p class='lab-note'>{text_of(texts.UNREADABLE.format(file=s.file, reason=s.reason))}</p>"
            for s in found.skipped[:_MOST_LISTED]
        )
        self.listed.set_content(html + (table(texts.COLUMNS_READ, rows) if rows else ""))
        await self._check()

    async def _check(self) -> None:
        """Add the verdict of ``flexdrive check``."""
        self.checked.set_content(f"<p>{texts.CHECKING}</p>")
        try:
            sources = [*self.bench.sources(), *self.bench.options()]
            answer = await Job().run(["check", *sources], lambda _stage: None)
        except JobError as error:
            self.checked.set_content(f"<p class='lab-note'>{text_of(str(error))}</p>")
            return
        words = texts.READY if answer.get("ready") else texts.NOT_READY
        told = [words, *answer.get("trade_offs", []), *answer.get("advice", [])]
        self.checked.set_content("".join(f"<p>{text_of(str(line))}</p>" for line in told[:12]))
