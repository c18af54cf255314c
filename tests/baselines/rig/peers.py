"""Reference peers in a thread, at the other end of UDP on loopback or of a pseudo-terminal."""

import threading
from contextlib import contextmanager

from baselines.rig import SimulatedRig, open_rig
from baselines.rig.links import PtyLink, UdpPeerLink
from baselines.rig.peer import Peer
from flexdrive_gym import Drive
from tests.drive.drives import RIG

DRIVE = Drive({**RIG, "saturation.limit": 8.0}, name="test rig")
# a busy machine that runs tests may let a thread wait for seconds
PATIENT = 20.0


def link(kind):
    return UdpPeerLink("127.0.0.1", 0) if kind == "udp" else PtyLink()


@contextmanager
def served(kind="udp", drive=DRIVE, *, watchdog=PATIENT, travel=250.0, lockstep=True, period=1e-3):
    """A peer that serves, and its address."""
    own = link(kind)
    plant = SimulatedRig(drive, period=period, travel=travel, returns=False)
    peer = Peer(plant, own, watchdog=watchdog, lockstep=lockstep)
    end = threading.Event()
    thread = threading.Thread(target=peer.serve, args=(end.is_set,), daemon=True)
    thread.start()
    try:
        yield peer, own.name if kind == "udp" else f"serial://{own.name}"
    finally:
        end.set()
        thread.join(PATIENT)


@contextmanager
def connected(address):
    rig = open_rig(address)
    try:
        yield rig
    finally:
        rig.close()
