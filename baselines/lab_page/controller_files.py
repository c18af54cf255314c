"""A visitor's own controller: data, never code."""

from __future__ import annotations

import tempfile
from pathlib import Path

from baselines.lab_page.motion import RIG_TIME_S
from flexdrive_gym import Controller, Drive

LARGEST_BYTES = 16_000_000
# a linear controller is asked eight thousand times a run
LARGEST_TEXT, LARGEST_ORDER = 1_000_000, 40
ENDINGS = (".toml", ".npz")


def read_controller(name: str, content: bytes, drive: Drive) -> Controller:
    """Read a controller from a file's name and content; nothing in it is run.

    Parameters
    ----------
    name
        Ends in ``.toml`` for a linear controller (docs/controllers.md), in ``.npz`` for an agent.
    content
        Of the file.
    drive
        On which an agent shall run.

    Raises
    ------
    ValueError, TypeError
        For a file that is too large, or no controller.
    """
    ending = next((e for e in ENDINGS if name.lower().endswith(e)), None)
    most = LARGEST_TEXT if ending == ".toml" else LARGEST_BYTES
    if ending is None or len(content) > most:
        raise ValueError(
            f"controller: must be a {' or '.join(ENDINGS)} of at most {most / 1e6:g} MB; got {name[-60:]!r} of {len(content)} "
            "bytes. Use what 'flexdrive train' wrote, or describe a linear controller as data."
        )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"controller{ending}"
        path.write_bytes(content)
        try:
            if ending == ".npz":
                from baselines.rl.agents import load_agent  # noqa: PLC0415  (reads files)

                return load_agent(path).on_scale_of(drive).controller(drive, RIG_TIME_S)
            return _linear(path, drive)
        except (ValueError, TypeError) as error:
            # the visitor knows the file by another name
            raise ValueError(str(error).replace(str(path), name[-60:])) from error


def _linear(path: Path, drive: Drive) -> Controller:
    from baselines.compare.own import load_linear  # noqa: PLC0415  (brings the whole comparison)

    found = load_linear(path).rescaled(drive.units)
    if found.order > LARGEST_ORDER:
        raise ValueError(f"controller: at most {LARGEST_ORDER} states run live; got {found.order}. Reduce its order.")
    if found.every(RIG_TIME_S) is None:
        raise ValueError(
            f"sample_time: must be a whole number of the rig's {RIG_TIME_S:g} s; got {found.sample_time:g} s. Design it for such."
        )
    return found
