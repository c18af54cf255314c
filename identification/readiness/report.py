"""What was understood of a folder of recordings, before anything is made of it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from flexdrive_gym.recording import Fault, Recording
from flexdrive_gym.units import Units
from identification.experiment import WORDS, Experiment, Reference
from identification.readiness.identifiability import READY, Identifiability, short
from identification.readiness.sessions import HEAD_S, TOO_DEAR, Comparison, in_time
from identification.recordings.faults import gathered
from identification.recordings.recording_set import RecordingSet, listed, notes_of, reasons
from identification.selection import Selection

_SHOWN = 12


@dataclass(frozen=True)
class Understood:
    """One recording, as it was understood.

    Attributes
    ----------
    recording
        As it was read.
    experiment
        Kind of experiment.
    session
        Which one.
    held
        Carts that were held.
    reference
        Why its command is a reference, or ``None``.
    """

    recording: Recording
    experiment: Experiment
    session: str
    held: tuple[int, ...]
    reference: Reference | None

    @property
    def faults(self) -> list[Fault]:
        """Faults of sensors and logs, many of a kind as one."""
        return gathered(self.recording.faults)

    def as_json(self) -> dict[str, Any]:
        """Return the object of the contract, and a little more."""
        r = self.recording
        return {
            "file": r.source,
            "name": r.name,
            "experiment": self.experiment,
            "samples": r.n,
            "rate_hz": _rate(r),
            "recorded": None if r.recorded is None else r.recorded.isoformat(),
            "session": self.session,
            "channels": ["u", *(name for name, _ in r.channels()), *(["reference"] if r.xr is not None else [])],
            "faults": [_fault(f, r.units) for f in self.faults],
            "held": list(self.held),
            "command_is_reference": self.reference is not None,
            "notes": list(r.notes),
        }

    def words(self) -> str:
        """Return what it is, in words."""
        r = self.recording
        text = (
            r.excitation.text(r.units) if self.experiment in ("square", "sine", "p_control") else WORDS[self.experiment]
        )
        if self.experiment in ("step", "ramp"):
            one = r.units.one("V")
            text += f" from {r.u.min() / one + 0.0:.3g} to {r.u.max() / one:.3g} {r.units.command}"
        for cart in self.held:
            plucked = ", cart 2 plucked" if cart == 1 and self.experiment == "free_decay" else ""
            text += f", cart {cart} held{plucked}"
        return text


def _rate(recording: Recording) -> float:
    return float(f"{recording.units.of_rig(1.0 / recording.sample_time, 'Hz')[0]:.6g}")


def _fault(fault: Fault, units: Units) -> dict[str, Any]:
    one = units.one("s")
    return {
        "recording": fault.recording,
        "where": fault.where,
        "id": fault.id,
        "start_s": fault.start_s / one,
        "end_s": fault.end_s / one,
        "note": fault.note,
    }


@dataclass(frozen=True, eq=False)
class Check:
    """What was understood of recordings, and what they can identify.

    Attributes
    ----------
    recordings
        Each as it was understood.
    read
        The recordings, the rig description and the files that were left out.
    selection
        Which of them a fit can use.
    warnings
        What cannot be as it was read, with what to write into rig.toml.
    found
        What can be identified, ``None`` where nothing can be fitted.
    comparison
        Of the sessions; ``None`` where there is one.
    advice
        What is missing, and the experiment that mends it.
    seconds
        It took.
    """

    recordings: tuple[Understood, ...]
    read: RecordingSet
    selection: Selection
    warnings: tuple[str, ...]
    found: Identifiability | None
    comparison: Comparison | None
    advice: tuple[str, ...]
    seconds: float

    @property
    def units(self) -> Units:
        """The rig's units."""
        return self.read.units

    @property
    def sessions(self) -> dict[str, int]:
        """Session to its number of recordings, the earliest first."""
        counts = Counter(item.session for item in self.recordings)
        names = in_time([item.recording for item in self.recordings], [item.session for item in self.recordings])
        return {name: counts[name] for name in names}

    @property
    def blocking(self) -> list[str]:
        """Why the recordings are not ready; nothing where they are."""
        reasons = []
        if not self.selection.usable:
            reasons.append("no recording of two free carts with their command")
        elif self.found is None:
            reasons.append("the base model cannot be fitted")
        reasons += [w.split(":")[0] for w in self.warnings]
        if self.comparison is not None and self.comparison.cost > TOO_DEAR and self.comparison.differing:
            reasons.append(f"{listed(self.comparison.sessions)} are not one drive")
        if self.found is not None and self.found.unknown:
            reasons.append(f"{', '.join(self.found.unknown)} not known to within {READY:.0%}")
        return reasons

    @property
    def ready(self) -> bool:
        """Whether a drive can be identified from these recordings."""
        return not self.blocking

    def line(self) -> str:
        """Return in one line whether the recordings are ready."""
        if not self.ready:
            return f"not ready: {'; '.join(self.blocking)}"
        assert self.found is not None
        open_ = [short(n) for n, ok in self.found.determined.items() if not ok]
        rest = f"; not determined: {', '.join(open_)}" if open_ else "; every parameter is determined"
        closed = len(self.selection.usable) - self.found.available
        kept = f" and {closed} in closed loop {'serves' if closed == 1 else 'serve'} validation" if closed else ""
        of = f"{self.found.available} of {len(self.recordings)} recordings"
        alarms, _ = notes_of(item.recording for item in self.recordings)
        doubt = "; a warning stands above, and figures are wrong if it is right" if alarms else ""
        return f"ready: {of} can be fitted{kept}{rest}{doubt}"

    def remarks(self) -> list[str]:
        """Return what identification and diagnosis should say before they go on."""
        merged = [] if self.comparison is None else [self.comparison.sentence().rstrip(".")]
        return [self.line(), *self.warnings, *merged]

    def as_json(self) -> dict[str, Any]:
        """Return the object of ``flexdrive check --json``."""
        found = self.found
        return {
            "recordings": [item.as_json() for item in self.recordings],
            "skipped": [{"file": item.file, "reason": item.reason} for item in self.read.skipped],
            "idle_rules": list(self.read.idle),
            "sessions": [{"id": name, "recordings": n} for name, n in self.sessions.items()],
            "identifiable": {} if found is None else {short(n): ok for n, ok in found.determined.items()},
            "half_widths": {} if found is None else {short(n): w for n, w in found.half_width.items()},
            "trade_offs": [] if found is None else list(found.trade_offs),
            "left_out": [{"name": r.name, "reason": why} for r, why in self.selection.left_out],
            "warnings": list(self.warnings),
            "comparison": None if self.comparison is None else _compared(self.comparison, self.units),
            "advice": list(self.advice),
            "ready": self.ready,
            "line": self.line(),
            "seconds": self.seconds,
        }

    def __str__(self) -> str:
        """Return the report as text."""
        lines = [f"{self.read.summary()}{f' of {self.read.rig.name}' if self.read.rig.name else ''}"]
        lines += [f"  {line}" for line in reasons(self.read.skipped)]
        for title, header, rows in self.tables():
            lines += ["", title, *_aligned(header, rows)]
        lines += ["", *self.sentences()]
        return "\n".join(lines)

    def tables(self) -> list[tuple[str, Sequence[str], list[list[str]]]]:
        """Return title, header and rows of every table of the report."""
        found: list[tuple[str, Sequence[str], list[list[str]]]] = [
            (
                "what was understood",
                ["recording", "experiment", "samples", "rate [Hz]", "session", "channels", "faults"],
                [
                    [
                        item.recording.name,
                        "reference as command" if item.reference else item.words(),
                        str(item.recording.n),
                        f"{_rate(item.recording):.6g}",
                        item.session,
                        " ".join(item.as_json()["channels"]),
                        ", ".join(f"{f.id} ({f.where})" for f in _kinds(item.faults)) or "–",
                    ]
                    for item in self.recordings
                ],
            )
        ]
        if self.found is not None:
            found.append(
                (
                    self._title(self.found),
                    ["parameter", "value", "95 % half width", "unit", "determined"],
                    self._parameters(self.found),
                )
            )
        if self.comparison is not None:
            found.append(("fitted to each session", *self.comparison.table(self.units)))
        return found

    @staticmethod
    def _title(found: Identifiability) -> str:
        part = "" if found.fitted >= found.available else f"; fitted to the first {HEAD_S:g} s of {found.fitted}"
        of = "recording" if found.available == 1 else f"{found.available} recordings"
        taken = f"{found.used} of the {of}" if found.used < found.available else f"the {of}"
        return f"what {taken} that can be fitted identif{'y' if found.available > 1 else 'ies'}{part}"

    def _parameters(self, found: Identifiability) -> list[list[str]]:
        from flexdrive_gym.drive.parameters import parameter  # noqa: PLC0415

        rows = []
        for name, width in found.half_width.items():
            value, unit = self.units.of_rig(found.fit.drive[name], parameter(name).unit)
            half = self.units.of_rig(width * found.sizes[name], parameter(name).unit)[0]
            shown = f"± {half:.2g}" if width < READY * 4 else "unknown"
            rows.append([short(name), f"{value:.4g}", shown, unit, "yes" if found.determined[name] else "no"])
        return rows

    def sentences(self) -> list[str]:
        """Return all that is said in sentences; whether the recordings are ready comes last."""
        alarms, notes = notes_of(item.recording for item in self.recordings)
        lines = [f"warning: {w}" for w in (*self.warnings, *alarms)]
        lines += [f"note: {note}" for note in self.selection.notes]
        if self.selection.references:
            lines.append(f"note: {_reference_sentence(self.selection.references)}")
        lines += [f"note: {note}" for note in notes]
        if self.found is not None:
            lines += [f"trade-off: {text}" for text in self.found.trade_offs]
        if self.comparison is not None:
            lines.append(f"sessions: {self.comparison.sentence()}")
        lines += [f"advice: {text}" for text in self.advice]
        return [*lines, self.line()]


def _reference_sentence(references: Mapping[str, Reference]) -> str:
    gains = ", ".join(f"{r.channel} follows it with gain {r.gain:.2f}" for r in list(references.values())[:1])
    return (
        f"what is called command in {listed(list(references))} is a reference ({gains}), so these runs cannot "
        f"be used as open "
        'loop: write into rig.toml [[files]] match = "…" and columns = { reference = "that column", u = "the column of the '
        'command" }, or use = false where no column holds the command'
    )


def _kinds(faults: Sequence[Fault]) -> list[Fault]:
    return list({(f.id, f.where): f for f in faults}.values())


def _compared(comparison: Comparison, units: Units) -> dict[str, Any]:
    from flexdrive_gym.drive.parameters import parameter  # noqa: PLC0415

    rows = {}
    for name, p in comparison.p_values.items():
        unit = parameter(name).unit
        values = {}
        for session, fit, halves in zip(comparison.sessions, comparison.fits, comparison.half_widths, strict=True):
            value, own = units.of_rig(fit.drive[name], unit)
            half = units.of_rig(halves[name], unit)[0]
            values[session] = {"value": value, "ci95": [value - half, value + half], "unit": own}
        rows[short(name)] = {"p_value": p, "differs": name in comparison.differing, "values": values}
    return {
        "sessions": list(comparison.sessions),
        "parameters": rows,
        "cost_of_merging": comparison.cost,
        "other_encoders": comparison.other_encoders,
        "statement": comparison.sentence(),
    }


def _aligned(header: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(len(str(row[i])) for row in (header, *rows)) for i in range(len(header))]
    return [
        "  ".join(str(cell).ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in (header, *rows)
    ]
