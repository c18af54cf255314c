"""One hand-in from beginning to end: unpacked, read, checked, identified, diagnosed; a row of the term, whatever comes of it."""

from __future__ import annotations

import math
import pickle
import resource
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from baselines.lab.lab_scale import on_lab_scale
from baselines.lab.uncertainty import predict
from baselines.loop_analysis.stability_limit import ObservedLimit, observed_limit
from baselines.term.copies import fingerprint
from baselines.term.evidence import run_evidence
from baselines.term.groups import Parcel, rig_file
from flexdrive_gym import Drive, Recording
from flexdrive_gym.drive.parameters import parameter
from flexdrive_gym.drive.toml import dumps
from flexdrive_gym.units import Units
from identification import check, diagnose, identify, read_recordings
from identification.readiness.plausible import implausible
from identification.readiness.sessions import sessions_of
from identification.recordings import RecordingSet
from identification.recordings.faults import gathered
from identification.selection import select

_GAINS = ("critical_gain_x2_linear", "critical_gain_x2_simulated", "critical_gain_x2_trajectory")
_COLLOCATED = ("critical_gain_x1_linear", "critical_gain_x1_simulated")
# faults of a sensor; a command at its limit is none
_NO_FAULT = frozenset({"saturation"})


@dataclass(frozen=True)
class Settings:
    """What is done with every hand-in; with its files they decide the result.

    Attributes
    ----------
    diagnose
        Whether physics that the base model lacks is looked for.
    draws
        Drives drawn for the intervals of critical gains; 0 for none.
    seed
        Of the diagnosis and the draws.
    rig
        Text of a ``rig.toml`` for hand-ins without one.
    strict
        Whether a file that cannot be read makes its group a row with a reason.
    only, skip
        Patterns of the files of a hand-in.
    """

    diagnose: bool = True
    draws: int = 100
    seed: int = 0
    rig: str = ""
    strict: bool = False
    only: tuple[str, ...] = ()
    skip: tuple[str, ...] = ()


@dataclass
class _Row:
    """What is known so far; what fails later leaves it."""

    found: dict[str, Any] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def step(self, name: str, *, needed: bool = False) -> Iterator[None]:
        """Time a step; one that is not needed may fail with a note."""
        begin = time.perf_counter()
        try:
            yield
        except Exception as error:
            if needed:
                raise
            self.notes.append(f"{name}: {_one_line(error)}")
        finally:
            self.seconds[name] = time.perf_counter() - begin


def examine(parcel: Parcel, settings: Settings) -> dict[str, Any]:
    """Return a hand-in's row: ``status`` ``ok``, or ``skipped`` with the ``reason``; never raises for what was handed in.

    Everything runs on one thread, so that as many hand-ins can be examined at a time as there are cores; the answer does not
    depend on where.
    """
    row, begin, busy = _Row(), time.perf_counter(), time.process_time()
    passing, name = False, ""
    try:
        with tempfile.TemporaryDirectory(prefix="flexdrive-") as name:
            _examine(parcel, settings, Path(name), row)
        status, reason = "ok", ""
    # whatever is wrong with one group must not stop the others
    except Exception as error:  # noqa: BLE001
        # where the hand-in was laid out says nothing to whoever reads the row
        status, reason = "skipped", _one_line(error).removeprefix(f"{name}: ")
        # nothing that the hand-in can do about it: it is examined again next time
        passing = isinstance(error, MemoryError | OSError)
    cost = {
        "seconds": time.perf_counter() - begin,
        "cpu_seconds": time.process_time() - busy,
        "steps": row.seconds,
        "peak_mb": _peak_mb(),
        "bytes_in": parcel.size,
    }
    found = {"status": status, "reason": reason, **row.found, "notes": row.notes, "cost": cost, "passing": passing}
    cost["bytes_out"] = len(pickle.dumps(found))
    return found


def _examine(parcel: Parcel, settings: Settings, folder: Path, row: _Row) -> None:
    with row.step("reading", needed=True):
        runs = _read(parcel, settings, folder, row)
        sessions = dict(zip((r.name for r in runs), sessions_of(runs), strict=True))
        row.found |= {
            "recordings": len(runs),
            "sessions": sorted(set(sessions.values())),
            "units": {"length": runs.units.length, "command": runs.units.command},
            "faults": [_fault(r, f) for r in runs for f in gathered(r.faults) if f.id not in _NO_FAULT],
            "fingerprints": {r.name: fingerprint(r) for r in runs},
        }
        runs, signs = mended(runs)
        row.found["signs"] = signs
        row.found["critical_gain"] = {"predicted": {}, "reached": asdict(ObservedLimit(None, None))}
    with row.step("identifying", needed=True):
        fit = identify(runs, threads=1)
        drive = fit.drive
        row.found |= {
            "carts": drive.carts,
            "parameters": _parameters(drive),
            "rms": getattr(fit.result, "rms", math.nan) / drive.units.one("mm/s"),
            "drive": dumps(drive),
        }
        row.found["critical_gain"]["reached"] = _reached(runs, on_lab_scale(drive).units)
    with row.step("weighing runs"):
        names, evidence = run_evidence(drive, select(runs).usable, sessions)
        row.found |= {"evidence_of": list(names), "evidence": [e.as_json() for e in evidence]}
    with row.step("checking"):
        likely = fit.result if fit.method == "ml" else None
        checked = check(runs, fit=likely, threads=1)  # type: ignore[arg-type]
        row.found |= {"ready": checked.ready, "line": checked.line(), "warnings": list(checked.warnings)}
    if settings.diagnose:
        with row.step("diagnosing"):
            found = diagnose(runs, seed=settings.seed, jobs=1)
            told = found.as_json()
            row.found |= {"verdict": told["verdict"], "findings": told["findings"], "unnamed": told["unnamed"]}
            row.found |= {"diagnosis": told, "diagnosed": dumps(found.drive)}
            drive = found.drive
    with row.step("predicting"):
        row.found["critical_gain"]["predicted"] = _gains(drive, settings)


def _read(parcel: Parcel, settings: Settings, folder: Path, row: _Row) -> RecordingSet:
    refused = parcel.lay_out(folder)
    skipped = [{"file": name, "reason": reason} for name, reason in refused]
    row.found["skipped"] = skipped
    described = rig_file(folder)
    if described is None and settings.rig:
        described = folder / "rig.toml"
        described.write_text(settings.rig, encoding="utf-8")
    if refused and not any(p.is_file() and p != described for p in folder.rglob("*")):
        raise ValueError("; ".join(f"{item['file']}: {item['reason']}" for item in skipped))
    runs = read_recordings(folder, rig=described, strict=settings.strict, only=settings.only, skip=settings.skip)
    skipped += [{"file": s.file, "reason": s.reason} for s in runs.skipped]
    return runs


def mended(runs: RecordingSet) -> tuple[RecordingSet, list[dict[str, Any]]]:
    """Return recordings with the signs that a drive must have, and which were turned.

    A swapped sign is a finding about the rig, not about its parameters: these are told all the same.

    Returns
    -------
    recordings, signs
        Of each channel that was turned, ``where`` and a ``sentence``.
    """
    kinds = {item.kind: item.recordings for item in implausible(runs)}
    command, second = "sign of u" in kinds, "sign of x2" in kinds
    if not command and not second:
        return runs, []
    # cart 1 against both the command and cart 2: it is encoder 1 that counts backwards
    turned = ("x1", "v1") if command and second else ("u",) if command else ("x2", "v2")
    where = {"x1": "encoder_1", "u": "actuator", "x2": "encoder_2"}[turned[0]]
    said = {
        "encoder_1": "encoder 1 counts backwards: cart 1 moves against the command and against cart 2",
        "encoder_2": "encoder 2 counts backwards: cart 2 moves against cart 1 even when driven slowly",
        "actuator": "the command is of the other sign than both encoders: a positive one moves both carts backwards",
    }[where]
    changed = RecordingSet([_turn(r, turned) for r in runs], runs.skipped, runs.rig)
    names = kinds.get("sign of x2") or kinds["sign of u"]
    return changed, [
        {"where": where, "recordings": len(names), "sentence": f"{said}; the figures here are with that sign turned"}
    ]


def _turn(recording: Recording, channels: Sequence[str]) -> Recording:
    changes: dict[str, Any] = {c: -v for c in channels if (v := getattr(recording, c)) is not None}
    return replace(recording, **changes)


def _parameters(drive: Drive) -> dict[str, dict[str, Any]]:
    """Return the identified parameters in the rig's units, with what comparisons need: the error of the logarithm."""
    assert drive.covariance is not None
    found = {}
    for name, variance in zip(drive.covariance.names, np.diag(drive.covariance.matrix), strict=True):
        unit = parameter(name).unit
        one = drive.units.one(unit)
        low, high = drive.intervals[name]
        found[name] = {
            "value": drive[name] / one,
            "ci95": [low / one, high / one],
            "unit": drive.units.name(unit),
            "log_se": math.sqrt(max(variance, 0.0)) / abs(drive[name]) if drive[name] else math.inf,
            "degrees": drive.covariance.degrees,
        }
    return found


def _gains(drive: Drive, settings: Settings) -> dict[str, Any]:
    names = _GAINS if drive.carts == 2 else _COLLOCATED
    drive = on_lab_scale(drive)
    predicted = predict(drive, names, draws=settings.draws, seed=settings.seed, threads=1)
    found = {}
    for name, p in predicted.items():
        of_rig = p.of_rig(drive.units)
        found[name] = {
            "value": of_rig.value,
            "ci95": None if of_rig.ci95 is None else list(of_rig.ci95),
            "unit": of_rig.unit,
            "extrapolated": of_rig.extrapolated,
        }
    return found


def _reached(runs: Sequence[Recording], scale: Units) -> dict[str, float | None]:
    """Return which gains from x2 held and grew, judged on the scale of the laboratory's tasks, in the rig's units."""
    seen = asdict(observed_limit([r.rescaled(scale) for r in runs]))
    return {name: None if gain is None else gain / scale.one("V/mm") for name, gain in seen.items()}


def _fault(recording: Recording, fault: Any) -> dict[str, Any]:
    return {
        "recording": recording.name,
        "where": fault.where,
        "id": fault.id,
        "start_s": fault.start_s / recording.units.one("s"),
        "end_s": fault.end_s / recording.units.one("s"),
    }


def _one_line(error: Exception) -> str:
    text = " ".join(str(error.args[0] if isinstance(error, KeyError) and error.args else error).split())
    known = isinstance(error, ValueError | OSError | KeyError | MemoryError)
    return text if known and text else f"{type(error).__name__}: {text}"


def _peak_mb() -> float:
    """Return the most memory that this process has had so far [MB]."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (1 << 20 if sys.platform == "darwin" else 1 << 10)
