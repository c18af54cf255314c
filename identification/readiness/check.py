"""``check``: what a folder holds and what can be made of it, before anything is."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from pathlib import Path

from threadpoolctl import threadpool_limits

from flexdrive_gym.recording import Recording
from identification.experiment import experiment_of
from identification.likelihood import MaximumLikelihood
from identification.readiness.advice import advice
from identification.readiness.identifiability import Identifiability, identifiability
from identification.readiness.plausible import implausible
from identification.readiness.report import Check, Understood
from identification.readiness.sessions import Comparison, compare_sessions, given_folders, reduced, sessions_of
from identification.recordings import RecordingSet, Rig
from identification.recordings.given import Source, given
from identification.selection import Selection, select


def check(
    recordings: Source,
    *,
    rig: Rig | str | Path | None = None,
    folders: Sequence[str | Path] = (),
    fit: MaximumLikelihood | None = None,
    threads: int | None = None,
) -> Check:
    """Say what recordings are and what they can identify.

    Parameters
    ----------
    recordings
        Folder, files, or recordings already read.
    rig
        Rig description, or its file, to read recordings with; those already read bring theirs.
    folders
        Folders that recordings already read came from, where several were given.
    fit
        The base model's fit to these recordings, where there is one already.
    threads
        Of the simulations; default: the processors this process may use. The answer does not depend on it.

    Returns
    -------
    Check
        Prints as a report; ``.ready`` in one word, ``.as_json()`` as an object.

    Raises
    ------
    RecordingError
        If nothing can be read.
    """
    begin = time.perf_counter()
    read = given(recordings, rig)
    roots = given_folders([Path(f) for f in folders or _paths(recordings)], read)
    sessions = sessions_of(read, roots)
    selection = select(read)
    names = dict(zip((r.name for r in read), sessions, strict=True))
    warnings = tuple(w.sentence for w in implausible(read))
    found, comparison = _fitted(selection, names, fit, threads)
    return Check(
        tuple(
            Understood(r, "closed_loop" if r.name in selection.references else experiment_of(r), session,
                       selection.held.get(r.name, ()), selection.references.get(r.name))
            for r, session in zip(read, sessions, strict=True)
        ),
        read,
        selection,
        warnings,
        found,
        comparison,
        advice(selection.usable, found, read.units),
        time.perf_counter() - begin,
    )  # fmt: skip


def _paths(source: Source) -> Sequence[str | Path]:
    if isinstance(source, str | Path):
        return [source]
    return [item for item in source if not isinstance(item, Recording)]


def _fitted(
    selection: Selection, names: dict[str, str], fit: MaximumLikelihood | None, threads: int | None
) -> tuple[Identifiability | None, Comparison | None]:
    """Return what the usable recordings can identify, and how their sessions compare."""
    usable = selection.usable
    if not usable:
        return None, None
    with threadpool_limits(1, user_api="blas"):
        open_loop = [r for r in usable if not r.closed_loop] or list(usable)
        every = RecordingSet(open_loop, rig=usable.rig)
        own = tuple(names[r.name] for r in open_loop)
        if fit is None or len(set(own)) > 1:
            some, own = reduced(every, own)
            fit = None
        else:
            some = every
        count = threads or len(os.sched_getaffinity(0))
        try:
            found = identifiability(some, usable, usable.units, fit=fit, threads=count)
        except ValueError:
            # a fit that cannot start says nothing of the recordings that a reader could use
            return None, None
        try:
            return found, compare_sessions(some, own, found.fit, count)
        except ValueError:
            return found, None
