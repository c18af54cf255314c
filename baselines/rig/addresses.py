"""Where a rig is: ``simulated``, ``udp://host:port``, ``serial://path?baud=rate``."""

from __future__ import annotations

from typing import TYPE_CHECKING
from urllib.parse import parse_qs, urlsplit

from baselines.rig.links import SerialLink, UdpLink
from baselines.rig.protocol import Rig
from baselines.rig.remote import RemoteRig
from baselines.rig.simulated import SimulatedRig

if TYPE_CHECKING:
    from flexdrive_gym import Drive

SIMULATED = "simulated"
DEFAULT_BAUD = 921600
FORMS = "simulated, udp://HOST:PORT, serial:///dev/ttyUSB0?baud=921600 or serial://COM3"


def open_rig(address: str, drive: Drive | None = None) -> Rig:
    """Connect to a rig.

    Parameters
    ----------
    address
        ``simulated``, ``udp://127.0.0.1:5005``, ``serial:///dev/ttyUSB0?baud=921600`` or ``serial://COM3``.
    drive
        What a simulated rig is.

    Raises
    ------
    ValueError
        If the address is none, or a simulated rig has no drive.
    RigStopped
        If no rig answers there.
    """
    if address == SIMULATED:
        if drive is None:
            raise ValueError("drive: a simulated rig needs a drive; got none. Give a drive.toml, or a rig with --rig.")
        return SimulatedRig(drive)
    if address.endswith(".toml"):
        raise ValueError(
            f"rig: must be {FORMS}; got {address}, a rig description by its name. Those say what the columns of recordings mean, "
            "and there are none to read yet."
        )
    parts = urlsplit(address)
    if parts.scheme == "udp":
        try:
            host, port = parts.hostname, parts.port
        except ValueError as error:
            raise _not_an_address(address) from error
        if not host or not port:
            raise _not_an_address(address)
        return RemoteRig(UdpLink(host, port))
    if parts.scheme == "serial":
        given = parse_qs(parts.query, keep_blank_values=True)
        path, baud = parts.netloc + parts.path, given.pop("baud", [str(DEFAULT_BAUD)])
        if not path or given or not baud[-1].isdecimal() or int(baud[-1]) == 0:
            raise _not_an_address(address)
        return RemoteRig(SerialLink(path, int(baud[-1])))
    raise _not_an_address(address)


def _not_an_address(address: str) -> ValueError:
    return ValueError(f"rig: must be {FORMS}; got {address!r}.")
