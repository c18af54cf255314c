"""The one error of this package, and the one form its messages take."""

from __future__ import annotations


class RecordingError(ValueError):
    """A file that cannot be read as a recording of the drive, with the reason and a remedy."""


def broken(source: str, what: str, rule: str, got: str, remedy: str) -> RecordingError:
    """Return the error that says which file and column broke which rule, and what helps.

    Parameters
    ----------
    source
        File or folder the error is about.
    what
        The column or part of the file, for example ``column v1`` or ``time``.
    rule
        What must hold, for example ``must increase``.
    got
        The value that broke the rule.
    remedy
        What the user can do about it, as a sentence.

    Returns
    -------
    RecordingError
        Ready to be raised, reading ``source: what: rule; got value. Remedy``.
    """
    return RecordingError(f"{source}: {what}: {rule}; got {got}. {remedy}")


def damaged(source: str, kind: str, error: Exception, remedy: str) -> RecordingError:
    """Return the error for a file that its reader cannot read: what that raises depends on the byte that is damaged.

    Parameters
    ----------
    kind
        What it should be, for example ``parquet``.
    error
        What the reader raised.
    """
    got = " ".join(f"{type(error).__name__}: {error}".split())[:120]
    return broken(source, "file", f"must be a complete {kind} file", got, remedy)


class NotARecordingError(RecordingError):
    """A readable file that is no recording, such as a reference trajectory or notes: left out without alarm."""


def left_out(source: str, sheet: str, error: RecordingError) -> str:
    """Return the note that a sheet of a file is no recording, with the reason."""
    return f"warning: sheet '{sheet}' is left out: {str(error).removeprefix(f'{source}: ')}"
