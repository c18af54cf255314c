"""When a run was recorded, from a file's header or its name, and dates as a time column.

The file system's date says when a file was copied and is never asked.
"""

from __future__ import annotations

import re
from datetime import datetime, timedelta
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import pandas as pd

    from flexdrive_gym.recording import FloatArray

_MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
_HEADER = re.compile(rb"Created on:\s*\w{3}\s+(\w{3})\s+(\d{1,2})\s+(\d{2}):(\d{2}):(\d{2})\s+(\d{4})")
_CLOCK = r"(?:[ _T,-]+(?P<H>\d{2})[-_.:h]?(?P<M>\d{2})(?:[-_.:m]?(?P<S>\d{2}))?)?"
_NAMES = (
    re.compile(r"(?<!\d)(?P<d>\d{1,2})[-_. ]?(?P<b>[A-Za-z]{3})[a-z]*[-_. ]?(?P<Y>\d{4})" + _CLOCK + r"(?!\d)"),
    re.compile(r"(?<!\d)(?P<Y>(?:19|20)\d{2})[-_.](?P<m>\d{2})[-_.](?P<d>\d{2})" + _CLOCK + r"(?!\d)"),
    re.compile(r"(?<!\d)(?P<Y>(?:19|20)\d{2})(?P<m>\d{2})(?P<d>\d{2})" + _CLOCK + r"(?!\d)"),
)
_EARLIEST, _LATEST = 1980, 2100
_EPOCH = datetime(1970, 1, 1)  # noqa: DTZ001  (a rig's own clock, whose zone nobody wrote down)
_DAY = 86400.0
_MONTHS_A_YEAR = 12
# sampling periods of a drive's log, and its least length [s]: what they are in tells the unit of stamps that say none
_SHORTEST_STEP, _LONGEST_STEP, _LEAST_SPAN = 5e-4, 5e-2, 0.2


def date_of_header(header: bytes) -> datetime | None:
    """Return the date in the first 116 bytes of a MATLAB file, or ``None``; version 4 has none."""
    found = _HEADER.search(header)
    if found is None:
        return None
    month, day, *clock, year = (part.decode("latin-1") for part in found.groups())
    return _date(year, month, day, *clock)


def date_of_name(name: str) -> datetime | None:
    """Return the date in a file's name, such as ``07-Feb-2025 09_20_49`` or ``2025-11-20_11-21``, or ``None``."""
    for pattern in _NAMES:
        for found in pattern.finditer(name):
            parts = found.groupdict()
            date = _date(parts["Y"], parts.get("b") or parts["m"], parts["d"], parts["H"], parts["M"], parts["S"])
            if date is not None:
                return date
    return None


def _date(
    year: str, month: str, day: str, hour: str | None = None, minute: str | None = None, second: str | None = None
) -> datetime | None:
    low = month.lower()[:3]
    number = _MONTHS.index(low) + 1 if low in _MONTHS else int(month) if month.isdigit() else 0
    try:
        date = datetime(int(year), number, int(day), int(hour or 0), int(minute or 0), int(second or 0))  # noqa: DTZ001
    except ValueError:
        return None
    return date if _EARLIEST <= date.year <= _LATEST else None


def seconds_of_text(column: pd.Series) -> FloatArray | None:
    """Return dates and times of day as seconds since 1970, or since midnight, or ``None`` where they are neither."""
    import pandas as pd  # noqa: PLC0415  (costs more to import than anything else here)

    text = column.astype(str).str.strip().str.replace(r"(?<=\d),(?=\d+$)", ".", regex=True)
    first = next((item for item in text if isinstance(item, str) and item), "")
    if re.match(r"^\d{1,2}:\d{2}(:\d{2}(\.\d+)?)?$", first):
        spans = pd.to_timedelta(text.where(text.str.count(":") > 1, "00:" + text), errors="coerce")
        return np.asarray(spans.dt.total_seconds(), dtype=np.float64)
    if not re.search(r"\d[-/. ]\w{1,3}[-/. ]\d", first):
        return None
    # where dots part a date its day stands first; between strokes only a number above 12 tells
    days = text.str.extract(r"^(\d{1,2})/")[0].astype(float)
    day_first = re.match(r"^\d{1,2}\.\d", first) is not None or bool((days > _MONTHS_A_YEAR).any())
    try:
        style = {"format": "ISO8601"} if first[:4].isdigit() else {"format": "mixed", "dayfirst": day_first}
        dates = pd.to_datetime(text, errors="coerce", utc=True, **style)
        whole = (dates - pd.Timestamp(0, tz="UTC")).dt.total_seconds()
    except (ValueError, OverflowError):  # a year that no clock shows
        return None
    if dates.isna().mean() > 0.2:
        return None
    return np.asarray(whole, dtype=np.float64)


def seconds_of_stamps(t: FloatArray, unit: str) -> tuple[FloatArray, datetime | None, tuple[str, ...]]:
    """Return stamps that count from a date, or in milliseconds without saying so, as seconds from the first one.

    Parameters
    ----------
    t
        Stamps as read, in s if their name says so, ndarray, shape (n,); may hold NaN.
    unit
        Unit in the name of the column; empty where it says none.

    Returns
    -------
    t : ndarray, shape (n,)
        Unchanged where the stamps are none of these.
    recorded : datetime or None
        Date of the first stamp.
    notes : tuple of str
        What was done.
    """
    good = t[np.isfinite(t)]
    if good.size < 2:
        return t, None, ()
    first, step = float(good[0]), float(np.median(np.diff(good)))
    if not unit and 7.0e5 < first < 7.8e5 and 0.0 < step < 1e-4:
        return (t - first) * _DAY, _since(first - 719529.0, _DAY), ("time stamps are MATLAB's day numbers",)
    for scale, name in ((1.0, "seconds"), (1e-3, "milliseconds"), (1e-6, "microseconds"), (1e-9, "nanoseconds")):
        # from 2001 to 2096
        if 1e9 < first * scale < 4e9 and (not unit or scale == 1.0):
            return (t - first) * scale, _since(first, scale), (f"time stamps are {name} since 1970",)
    span = float(good[-1]) - first
    for scale, name in ((1e-3, "milliseconds"), (1e-6, "microseconds"), (1e-9, "nanoseconds")):
        if not unit and _SHORTEST_STEP <= step * scale <= _LONGEST_STEP and span * scale >= _LEAST_SPAN:
            notes = [f"warning: the time column has no unit; its stamps are read as {name}"]
            if step == 1.0:
                notes.append("stamps that number the samples need the period in rig.toml: [rig] sample_time = 0.002")
            return t * scale, None, tuple(notes)
    return t, None, ()


def _since(count: float, scale: float) -> datetime | None:
    """Return the date so many units after 1970."""
    try:
        return (_EPOCH + timedelta(seconds=count * scale)).replace(microsecond=0)
    except OverflowError:
        return None
