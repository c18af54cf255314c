"""Sessions and rigs: told apart by what recordings say, compared by what is fitted to each.

A session is what one rig did on one day. A rig description names it; else the recordings' dates tell, with more than
three hours between two runs beginning another; else the folders that were given, or the folders within the one that was
given.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from pathlib import Path, PurePosixPath

import numpy as np
from scipy.stats import chi2

from flexdrive_gym.drive.parameters import parameter
from flexdrive_gym.recording import Recording
from flexdrive_gym.units import Units
from identification.experiment import experiment_of
from identification.likelihood import MaximumLikelihood, identify_by_likelihood
from identification.readiness.identifiability import half_widths, relative_covariance
from identification.recordings.recording_set import RecordingSet
from identification.topology import Topology, topology_of

GAP = timedelta(hours=3)
# recordings that are fitted in all, and at least of each session; seconds of each
MOST, FEWEST, HEAD_S = 24, 4, 6.0
# level of the test whether sessions differ, over all parameters
ALPHA = 0.05
# squared error by which a joint fit may exceed separate ones for sessions to be called one drive
TOO_DEAR = 0.5
_NORMAL_95 = 1.96
_OTHER_COUNT = 1.02


def given_folders(paths: Sequence[Path], recordings: Sequence[Recording]) -> tuple[str, ...]:
    """Return the folder that each recording came from, as it was given; empty where a single one or files were given.

    Recordings come in the order in which they were read: folder by folder, files in order.
    """
    folders = [path for path in paths if path.is_dir()]
    if len(folders) < 2:
        return ("",) * len(recordings)
    names, current, last = [], 0, PurePosixPath()
    for r in recordings:
        source = PurePosixPath(r.source)
        begun = last != PurePosixPath()
        while current < len(folders) - 1 and (not (folders[current] / source).is_file() or (begun and source <= last)):
            current, last, begun = current + 1, PurePosixPath(), False
        last = source
        names.append(_short(folders, current))
    return tuple(names)


def _short(folders: Sequence[Path], k: int) -> str:
    """Return a folder's name, with its parent's in front where two are called alike."""
    named = [folder.resolve().name for folder in folders]
    return named[k] if named.count(named[k]) == 1 else "/".join(folders[k].resolve().parts[-2:])


def sessions_of(recordings: Sequence[Recording], folders: Sequence[str] = ()) -> tuple[str, ...]:
    """Return the session of each recording.

    Parameters
    ----------
    folders
        Given folder of each recording, where several were given.
    """
    roots = tuple(folders) or ("",) * len(recordings)
    found = [r.session for r in recordings]
    for root in dict.fromkeys(roots):
        own = [k for k, name in enumerate(roots) if name == root and not found[k]]
        ids = _by_date([recordings[k] for k in own]) or _by_folder([recordings[k] for k in own], root)
        for k, name in zip(own, ids, strict=True):
            found[k] = f"{root} {name}".strip() if root not in name else name
    return tuple(found)


def _by_date(recordings: Sequence[Recording]) -> list[str]:
    """Return dates, numbered where a day has several sessions; nothing where no recording has one."""
    dated = sorted((r.recorded, k) for k, r in enumerate(recordings) if r.recorded is not None)
    if not dated:
        return []
    starts = [0, *(i for i in range(1, len(dated)) if dated[i][0] - dated[i - 1][0] > GAP)]
    days = [f"{dated[i][0]:%Y-%m-%d}" for i in starts]
    several = {day for day, n in Counter(days).items() if n > 1}
    ids = ["undated"] * len(recordings)
    for s, day in enumerate(days):
        name = f"{day} ({days[: s + 1].count(day)})" if day in several else day
        for _, k in dated[starts[s] : starts[s + 1] if s + 1 < len(starts) else None]:
            ids[k] = name
    return ids


def _by_folder(recordings: Sequence[Recording], root: str) -> list[str]:
    tops = [PurePosixPath(r.source).parts[0] if "/" in r.source else "" for r in recordings]
    if len(set(tops)) > 1:
        return [top or "." for top in tops]
    return [root or "1"] * len(recordings)


def in_time(recordings: Sequence[Recording], sessions: Sequence[str]) -> list[str]:
    """Return each session once, the earliest first; those without a date as they were read, last."""
    first: dict[str, datetime] = {}
    for r, name in zip(recordings, sessions, strict=True):
        if r.recorded is not None:
            first[name] = min(r.recorded, first.get(name, r.recorded))
    names = list(dict.fromkeys(sessions))
    return [*sorted((n for n in names if n in first), key=lambda n: first[n]), *(n for n in names if n not in first)]


@dataclass(frozen=True, eq=False)
class Comparison:
    """What is fitted to each session alone, and what fitting all as one rig costs.

    Attributes
    ----------
    sessions
        Those with recordings that a fit can use.
    fits
        The drive fitted to each.
    half_widths
        Parameter to its 95 % half width [its unit] for each session.
    p_values
        Parameter to the p-value of no difference between the sessions, times the number of parameters.
    cost
        Squared error of the joint fit over that of the separate ones, less 1.
    counts
        Encoder counts of both carts per session [mm]; 0 where they show none.
    """

    sessions: tuple[str, ...]
    fits: tuple[MaximumLikelihood, ...]
    half_widths: tuple[Mapping[str, float], ...]
    p_values: Mapping[str, float]
    cost: float
    counts: tuple[tuple[float, float], ...]

    @property
    def differing(self) -> tuple[str, ...]:
        """Parameters that differ significantly between the sessions."""
        return tuple(name for name, p in self.p_values.items() if p < ALPHA)

    @property
    def other_encoders(self) -> bool:
        """Whether the encoders count differently, so that these cannot be sessions of one rig as it is."""
        for cart in (0, 1):
            known = [c[cart] for c in self.counts if c[cart] > 0.0]
            if known and max(known) > _OTHER_COUNT * min(known):
                return True
        return False

    def table(self, units: Units) -> tuple[list[str], list[list[str]]]:
        """Return header and rows: every parameter with its 95 % interval for each session, in the rig's units."""
        header = ["parameter", *self.sessions, "unit", "differs"]
        rows = []
        for name, p in self.p_values.items():
            unit = parameter(name).unit
            cells = [self.cell(k, name, units) for k in range(len(self.fits))]
            rows.append([_label(name), *cells, units.name(unit), f"yes (p = {p:.1g})" if p < ALPHA else "no"])
        return header, rows

    def cell(self, session: int, name: str, units: Units) -> str:
        """Return a parameter and its half width in the rig's units."""
        unit = parameter(name).unit
        value, half = self.fits[session].drive[name], self.half_widths[session][name]
        return f"{units.of_rig(value, unit)[0]:.3g} ± {units.of_rig(half, unit)[0]:.1g}"

    def sentence(self) -> str:
        """Say what a merge costs."""
        what = f"{len(self.sessions)} sessions ({', '.join(self.sessions)})"
        encoders = " Their encoders count differently: they are not one rig." if self.other_encoders else ""
        if not self.differing and not encoders:
            return f"{what} are fitted as one drive; no parameter differs significantly between them."
        names = ", ".join(_label(n) for n in self.differing)
        differ = (
            f" {names} {'differs' if len(self.differing) == 1 else 'differ'} significantly between them."
            if names
            else ""
        )
        return (
            f"{what} are merged into one drive, at the cost of {100.0 * self.cost:.0f} % more squared error "
            f"than separate fits."
            f"{differ}{encoders} Fit each alone unless that is meant."
        )


def _label(name: str) -> str:
    return name.rsplit(".", 1)[-1]


def reduced(recordings: RecordingSet, sessions: Sequence[str]) -> tuple[RecordingSet, tuple[str, ...]]:
    """Return fewer and shorter recordings that cover every session's conditions, and their sessions.

    Runs are ordered by experiment, amplitude and frequency, and taken at even distances: replicates go first.
    """
    names = list(dict.fromkeys(sessions))
    each = max(FEWEST, MOST // max(len(names), 1))
    chosen: list[int] = []
    for name in names:
        own = [k for k, s in enumerate(sessions) if s == name]
        own.sort(key=lambda k: _condition(recordings[k]))
        places = np.unique(np.linspace(0, len(own) - 1, min(each, len(own))).round().astype(int))
        chosen += [own[i] for i in places]
    chosen.sort()
    return (
        RecordingSet([head(recordings[k]) for k in chosen], rig=recordings.rig),
        tuple(sessions[k] for k in chosen),
    )


def _condition(r: Recording) -> tuple[str, float, float, str]:
    return experiment_of(r), round(r.excitation.frequency, 3), round(r.excitation.amplitude, 3), r.name


def head(recording: Recording, seconds: float = HEAD_S) -> Recording:
    """Return the beginning of a recording, which a simulation can start."""
    n = round(seconds / recording.sample_time)
    if n >= recording.n:
        return recording
    names = ("t", "u", "x1", "x2", "v1", "v2", "xr")
    return replace(recording, **{k: v[:n] for k in names if (v := getattr(recording, k)) is not None})


def compare_sessions(
    recordings: RecordingSet, sessions: Sequence[str], joint: MaximumLikelihood, threads: int | None = None
) -> Comparison | None:
    """Fit every session alone and compare; ``None`` where fewer than two can be fitted.

    Parameters
    ----------
    recordings, sessions
        As :func:`reduced` returns them.
    joint
        The fit of all of them.
    """
    used = {c.recording for c in joint.channels}
    names = [
        s
        for s in in_time(recordings, sessions)
        if any(r.name in used for r, q in zip(recordings, sessions, strict=True) if q == s)
    ]
    if len(names) < 2:
        return None
    topology = topology_of(recordings)
    groups = [
        RecordingSet([r for r, s in zip(recordings, sessions, strict=True) if s == n and r.name in used]) for n in names
    ]
    start = dict(joint.drive.values)
    fits = [identify_by_likelihood(g, threads=threads, topology=topology, start=start, quick=True) for g in groups]
    free = [n for n in topology.free if n in joint.drive.values]
    halves = [_half_widths(fit, g, topology, threads) for fit, g in zip(fits, groups, strict=True)]
    tested = {n: _homogeneity([f.drive[n] for f in fits], [h[n] for h in halves]) for n in free}
    together, apart = squares(joint), sum(squares(fit) for fit in fits)
    return Comparison(
        tuple(names),
        tuple(fits),
        tuple(halves),
        {n: min(1.0, p * len(free)) for n, p in tested.items()},
        together / apart - 1.0 if apart > 0.0 else 0.0,
        tuple(_counts(g) for g in groups),
    )


def squares(fit: MaximumLikelihood) -> float:
    """Return the sum of squared residuals of a fit [(mm/s)²]."""
    return sum(c.n * c.rms**2 for c in fit.channels if c.n)


def _counts(recordings: Sequence[Recording]) -> tuple[float, float]:
    first, second = ([r.quantum[cart] for r in recordings if r.quantum[cart] > 0.0] for cart in (0, 1))
    return (float(np.median(first)) if first else 0.0, float(np.median(second)) if second else 0.0)


def _half_widths(
    fit: MaximumLikelihood, recordings: RecordingSet, topology: Topology, threads: int | None
) -> dict[str, float]:
    names, sizes, covariance = relative_covariance(fit, recordings, topology, threads)
    return {n: w * float(s) for (n, w), s in zip(half_widths(names, covariance).items(), sizes, strict=True)}


def _homogeneity(values: Sequence[float], halves: Sequence[float]) -> float:
    """Return the p-value of one value for all (W. Cochran, Biometrics 10, 1954)."""
    weights = 1.0 / np.maximum(np.array(halves) / _NORMAL_95, 1e-30) ** 2
    centre = float(np.sum(weights * values) / np.sum(weights))
    return float(chi2.sf(np.sum(weights * (np.array(values) - centre) ** 2), len(values) - 1))
