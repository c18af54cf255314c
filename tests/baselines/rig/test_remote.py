"""Rigs at the other end of UDP and of a serial line, played by the reference peer."""

import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

from baselines.rig import Limits, RigBench, RigStopped, SimulatedRig, open_rig, run
from baselines.rig.bench import HOME_MM, Playback
from baselines.rig.wire import Frame, Kind, Scanner
from flexdrive_gym import PControl, save_drive
from flexdrive_gym.references import square
from identification import read_recordings
from tests.baselines.rig.peers import DRIVE, PATIENT, connected, served
from tests.each import each

T = 1e-3 * np.arange(1001)
U = square(T, 1.5, 2.0)
LINKS = ["udp", pytest.param("serial", marks=pytest.mark.skipif(os.name != "posix", reason="needs pseudo-terminals"))]
SLOW = Limits(watchdog=PATIENT)


@pytest.fixture(autouse=True)
def _serial(request):
    if "serial" in request.node.name:
        pytest.importorskip("serial", reason="needs pyserial, of the extra rig")


def until(true, seconds=PATIENT):
    end = time.perf_counter() + seconds
    while not true():
        assert time.perf_counter() < end
        time.sleep(0.01)


def reads(rig, then):
    while True:
        rig.read(PATIENT)
        then()


@pytest.mark.parametrize("kind", LINKS)
def test_a_peer_in_lockstep_is_the_drive_itself(kind):
    with served(kind) as (peer, address), connected(address) as rig:
        assert (rig.description.name, rig.description.carts, rig.description.period) == ("test rig", 2, 1e-3)
        made = run(rig, Playback(U, 1e-3), np.zeros(len(T)), SLOW)
        until(lambda: peer.output == 0.0)
    simulated = SimulatedRig(DRIVE).drive.simulate(T, U)
    assert made.recording.t == pytest.approx(T, abs=1e-12)
    for name in ("u", "x1", "x2", "v1", "v2"):
        assert np.array_equal(getattr(made.recording, name), getattr(simulated, name)), name
    assert made.lost == 0
    assert len(made.timing.latency) > 900


def test_loops_over_a_line_are_as_if_there_were_none():
    with served() as (_peer, address), connected(address) as rig:
        made = run(rig, PControl(0.1, "x2"), np.full(800, 20.0), SLOW).recording
    # commands travel in single precision
    simulated = SimulatedRig(DRIVE).drive.simulate(made.t, made.u)
    assert np.array_equal(made.x2, simulated.x2)
    assert np.max(np.abs(made.u - 0.1 * (20.0 - made.x2))[:-1]) < 1e-6


@pytest.mark.parametrize("kind", LINKS)
def test_a_peer_in_real_time_puts_commands_out_one_sample_later(kind):
    with served(kind, lockstep=False, period=5e-3) as (_peer, address), connected(address) as rig:
        made = run(rig, lambda o: 1.0 + o.t, np.zeros(60), SLOW)
    u = made.recording.u
    assert u[0] == 0.0
    # on a busy machine some come later still, none earlier
    behind = 1.0 + made.recording.t[1:] - u[1:]
    assert behind.min() > 4.9e-3
    assert made.timing.summary()["jitter"]["max"] < 1e3 * PATIENT


def test_the_peer_stops_when_nobody_speaks_any_more():
    with served(watchdog=0.2, lockstep=False) as (peer, address), connected(address) as rig:
        rig.start(PATIENT)
        rig.read(PATIENT)
        rig.write(2.0)
        until(lambda: peer.output == 2.0)
        until(lambda: peer.output == 0.0)  # nobody told it
        with pytest.raises(RigStopped, match="watchdog: udp://.* had no command for its watchdog's time"):
            reads(rig, lambda: None)


def test_a_run_may_ask_for_a_shorter_watchdog():
    with served() as (peer, address), connected(address) as rig:
        rig.start(0.1)
        rig.read(PATIENT)
        rig.write(2.0)
        until(lambda: peer.output == 2.0)
        until(lambda: peer.output == 0.0, 5.0)


@pytest.mark.parametrize("kind", LINKS)
def test_a_lost_peer_is_missed(kind):
    def falls_silent(observation):
        if observation.t > 0.1:
            peer.frames.send = lambda _frame: None
        return 1.0

    with served(kind) as (peer, address), connected(address) as rig:
        with pytest.raises(RigStopped, match="lost peer: .* sent no sample for 0.3 s"):
            run(rig, falls_silent, np.zeros(1000), Limits(watchdog=0.3))
        until(lambda: peer.output == 0.0)


def test_a_peer_that_is_gone_is_missed_at_once():
    with served() as (_peer, address):
        rig = open_rig(address)
    rig.start(1.0)
    with pytest.raises(RigStopped, match="lost peer: "):
        rig.read(PATIENT)
    rig.stop()
    rig.close()


def test_the_rig_keeps_its_own_travel():
    with served(travel=5.0) as (peer, address), connected(address) as rig:
        # a program that ignores what the rig said
        rig.start(PATIENT)
        with pytest.raises(RigStopped, match="travel: .* beyond its own limit of travel"):
            reads(rig, lambda: rig.write(8.0))
        until(lambda: peer.output == 0.0)
        # and from there the carts can be brought home
        RigBench(rig, SLOW).go_home()
        assert abs(peer.plant.read().x1) < HOME_MM


def test_experiments_start_near_the_middle_and_end_at_the_travel():
    with served(travel=60.0) as (_peer, address), connected(address) as rig:
        bench = RigBench(rig, SLOW)
        made = bench.open_loop("square", 3.0, 0.5)
        assert "a cart left the travel of ±60 mm" in made.notes[0]
        again = run(rig, lambda _o: 0.0, np.zeros(10), SLOW)
        assert abs(again.zero[0]) > 60.0  # it coasted on
        bench.go_home()
        assert abs(run(rig, lambda _o: 0.0, np.zeros(10), SLOW).zero[0]) < HOME_MM


def test_while_a_run_is_on_nobody_else_is_heard():
    with served() as (peer, address), connected(address) as rig:
        rig.start(PATIENT)
        rig.read(PATIENT)
        host, port = address.removeprefix("udp://").split(":")
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
            other.sendto(Frame(Kind.COMMAND, 0, values=(8.0,)).pack(), (host, int(port)))
            time.sleep(0.1)
        assert peer.output == 0.0
        rig.write(1.0)
        assert rig.read(PATIENT).u == 1.0


def test_a_rig_of_another_version_is_named():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        other.settimeout(PATIENT)

        def answer():
            for _ in range(7):
                data, sender = other.recvfrom(100)
                if next(Scanner().feed(data)).kind is Kind.HELLO:
                    reply = bytearray(Frame(Kind.STOPPED, values=(0,)).pack())
                    reply[2] = 9
                    other.sendto(reply, sender)

        thread = threading.Thread(target=answer)
        thread.start()
        with pytest.raises(ValueError, match="speaks version 9 of the format; this program speaks 1"):
            open_rig(f"udp://127.0.0.1:{other.getsockname()[1]}")
        thread.join()


@each(
    ("address", "text"),
    [
        ("simulated", "drive: a simulated rig needs a drive"),
        ("rig.toml", "a rig description by its name"),
        ("udp://127.0.0.1", "rig: must be simulated, udp://HOST:PORT"),
        ("udp://127.0.0.1:99999", "rig: must be simulated, udp://HOST:PORT"),
        ("serial:///dev/ttyUSB0?baud=fast", "rig: must be simulated, udp://HOST:PORT"),
        ("serial:///dev/ttyUSB0?parity=N", "rig: must be simulated, udp://HOST:PORT"),
        ("tcp://127.0.0.1:1", "got 'tcp://127.0.0.1:1'"),
    ],
)
def test_addresses_that_are_none(address, text):
    with pytest.raises(ValueError, match=text):
        open_rig(address)


def test_serial_lines_that_are_none_or_too_slow():
    with pytest.raises(RigStopped, match="lost peer: /no/such/line cannot be opened"):
        open_rig("serial:///no/such/line")
    # 32 bytes of 10 bits a millisecond
    with (
        served("serial") as (_peer, address),
        pytest.raises(ValueError, match="needs 320000 baud at least; got 115200"),
    ):
        open_rig(f"{address}?baud=115200")


def flexdrive(*arguments, **more):
    return subprocess.Popen(
        [sys.executable, "-m", "baselines.cli", "experiment", *map(str, arguments)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **more,
    )  # fmt: skip


def test_the_command_writes_recordings_that_can_be_read_back(tmp_path):
    with served() as (peer, address):
        arguments = ("--part", "2.1", "--part", "2.5", "--square", "1.5", "--watchdog", "10000")
        ran = flexdrive("--rig", address, "-o", tmp_path, *arguments, "--json")
        out, err = ran.communicate()
        assert ran.returncode == 0, err
        until(lambda: peer.output == 0.0)
    said = json.loads(out)
    assert said["connection"]["address"] == address
    assert said["connection"]["limits"]["travel"] == 250.0
    assert said["timing_ms"]["latency"]["median"] > 0.0
    kinds = sorted(str(r.excitation) for r in read_recordings(tmp_path))
    assert kinds == ["P-control from x2, Kp = 0.05 V/mm", "square ±1.5 V, 0.5 Hz"]


@pytest.mark.skipif(os.name != "posix", reason="needs signals")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_signals_stop_the_motor(number, tmp_path):
    """Ctrl-C and an end from outside are told to the rig; of a killed program only its watchdog hears."""
    said = []
    with served(lockstep=False, watchdog=2.0, period=5e-3) as (peer, address):
        peer._tell = said.append
        ran = flexdrive("--rig", address, "-o", tmp_path, "--part", "2.5", "--late", "10000", "--watchdog", "10000")
        try:
            until(lambda: abs(peer.output) == 1.5, 20 * PATIENT)
        finally:
            ran.send_signal(number)
            _out, err = ran.communicate()
        until(lambda: peer.output == 0.0)
        until(lambda: said and said[-1] == f"run ended: {'watchdog' if number == signal.SIGKILL else 'asked'}; 0 V")
    if number != signal.SIGKILL:
        assert ran.returncode == 1
        assert "flexdrive: interrupted; 0 V was put out" in err
    assert not list(tmp_path.glob("*.csv"))


def test_the_peer_runs_as_a_program(tmp_path):
    save_drive(DRIVE, tmp_path / "drive.toml")
    command = [sys.executable, "-m", "baselines.rig.peer", str(tmp_path / "drive.toml")]
    where = ["--udp", "127.0.0.1:0", "--lockstep", "--watchdog", "20000"]
    with subprocess.Popen([*command, *where], stdout=subprocess.PIPE, text=True) as peer:
        try:
            address = peer.stdout.readline().removeprefix("rig at ").strip()
            with connected(address) as rig:
                assert run(rig, lambda _o: 1.0, np.zeros(300), SLOW).recording.x1[-1] > 1.0
        finally:
            peer.send_signal(signal.SIGINT)
        assert peer.stdout.read().split("\n")[-2] == "ended"
    wrong = subprocess.run([*command, "--udp", "5005"], capture_output=True, text=True, check=False)
    assert wrong.returncode == 2
    assert "--udp: must be HOST:PORT; got '5005'" in wrong.stderr
