"""Whatever ends a run, the last thing a rig is told is 0 V."""

import numpy as np
import pytest

from baselines.lab.experiments import DriveBench
from baselines.rig import Description, Limits, Reading, RigBench, RigStopped, SimulatedRig, run
from flexdrive_gym import Drive, Observation, PControl
from tests.baselines.rig.peers import DRIVE
from tests.drive.drives import RIG
from tests.each import each

LIMITS = Limits(travel=200.0, voltage=5.0, resting=0.05, late=0.01, watchdog=0.1)


class Scripted:
    """A rig that does what its script says, on a clock of its own, and keeps what it was told."""

    def __init__(self, *, x=lambda k: 0.0, sequence=lambda k: k, wait=lambda k: None):
        self.description = Description("scripted", 1e-3, limits=Limits(travel=300.0, voltage=8.0), quantum=(0.01, 0.01))
        self.x, self.sequence, self.wait = x, sequence, wait
        self.told, self.stops = [], 0

    def start(self, watchdog):
        self.k, self.watchdog, self.now = -1, watchdog, 100.0
        self.told.append("start")

    def clock(self):
        return self.now

    def read(self, timeout):
        self.k += 1
        self.now = max(self.now, 100.0 + self.k * 1e-3) + (self.wait(self.k) or 0.0)
        n = self.sequence(self.k)
        return Reading(n, n * 1e-3, self.x(n), self.x(n), 0.0)

    def write(self, u):
        self.told.append(u)

    def stop(self):
        self.told.append("stop")

    def close(self):
        self.stop()


def ends(rig, controller=lambda _o: 1.0, *, n=200, limits=LIMITS):
    """Run; return what was raised."""
    with pytest.raises((RigStopped, Exception, KeyboardInterrupt, SystemExit)) as caught:
        run(rig, controller, np.zeros(n), limits, clock=rig.clock)
    return caught.value


def raising(error):
    def controller(observation):
        if observation.t > 0.05:
            raise error
        return 1.0

    return controller


def lost(k):
    if k == 60:
        raise RigStopped("lost peer", "nothing came.")


@each(
    ("rig", "controller", "reason"),
    [
        (Scripted(wait=lambda k: 0.05 * (k == 60)), lambda _o: 1.0, "late sample"),
        (Scripted(sequence=lambda k: k + 20 * (k > 60)), lambda _o: 1.0, "late sample"),
        (Scripted(wait=lost), lambda _o: 1.0, "lost peer"),
        (Scripted(), lambda _o: 9.0, "command limit"),
        (Scripted(), raising(KeyboardInterrupt()), KeyboardInterrupt),
        (Scripted(), raising(SystemExit(1)), SystemExit),
        (Scripted(), raising(ZeroDivisionError()), ZeroDivisionError),
        (Scripted(), lambda o: float("nan") if o.t > 0.05 else 1.0, ValueError),
        (Scripted(), lambda o: "much" if o.t > 0.05 else 1.0, TypeError),
    ],
)
def test_every_way_out_leaves_0_V(rig, controller, reason):
    error = ends(rig, controller)
    if isinstance(reason, str):
        assert (type(error), error.reason) == (RigStopped, reason)
    else:
        assert isinstance(error, reason)
    assert rig.told[0] == "start"
    assert rig.told[-1] == "stop"
    assert 1.0 in rig.told or 5.0 in rig.told


def test_a_rig_that_does_not_begin_is_stopped_too():
    rig = Scripted(wait=lambda k: 1 / 0)
    assert isinstance(ends(rig), ZeroDivisionError)
    assert rig.told == ["start", "stop"]


def test_the_travel_ends_a_run_with_what_was_recorded():
    rig = Scripted(x=lambda k: 5.0 * k)
    made = run(rig, lambda _o: 1.0, np.zeros(100), LIMITS, clock=rig.clock)
    # 200 mm are reached at sample 40, left at 41, where 0 V are put out at once
    assert made.recording.n == 42
    assert made.recording.notes == ("ended at 0.041 s: a cart left the travel of ±200 mm",)
    assert rig.told[-2:] == [0.0, "stop"]


def test_a_run_that_starts_beyond_the_travel_may_only_lead_back():
    rig = Scripted(x=lambda k: 250.0)
    run(rig, lambda o: 1.0 if o.t < 0.005 else -1.0, np.zeros(10), LIMITS, clock=rig.clock)
    assert rig.told[1:-1] == [0.0] * 5 + [-1.0] * 5


def test_commands_are_clipped_and_the_strictest_limit_holds():
    rig = Scripted()
    run(rig, lambda o: 20.0 * np.sin(300.0 * o.t), np.zeros(100), Limits(voltage=20.0, watchdog=3.0), clock=rig.clock)
    assert max(u for u in rig.told if isinstance(u, float)) == 8.0
    assert rig.watchdog == 0.1


def test_lost_samples_leave_gaps_and_the_reference_goes_on():
    rig = Scripted(sequence=lambda k: k + 3 * (k > 20))
    seen = []
    made = run(rig, lambda o: seen.append(o) or 0.0, np.arange(50.0), LIMITS, clock=rig.clock)
    assert made.lost == 3
    assert np.allclose([o.xr for o in seen], [o.t / 1e-3 for o in seen])
    assert np.allclose(np.diff(made.recording.t), [1e-3] * 20 + [4e-3] + [1e-3] * 25)


def test_a_late_controller_is_found_out():
    rig = Scripted()

    def slow(_observation):
        rig.now += 2e-3
        return 1.0

    # a millisecond behind with every sample: more than the 10 ms that are allowed with the eleventh
    error = ends(rig, slow)
    assert "late sample: the sample of t = 0.011 s came 11.0 ms late; 10 ms are allowed" in str(error)
    assert rig.told == ["start", *[1.0] * 11, "stop"]


@each("gain", [0.05, 0.3])
def test_the_simulated_rig_is_the_compiled_loop_bit_by_bit(gain):
    drive = DRIVE.replace({"input_delay.tau": 0.0015, "velocity_processing.encoder_1.cutoff": 40.0})
    one, other = RigBench(SimulatedRig(drive)), DriveBench(drive)
    for a, b in (
        (one.p_control(gain, "x2"), other.p_control(gain, "x2")),
        (one.open_loop("sine", 2.5, 3.0), other.open_loop("sine", 2.5, 3.0)),
    ):
        assert a.name == b.name
        assert a.excitation == b.excitation
        assert a.notes == b.notes
        for name in ("t", "u", "xr", "x1", "x2", "v1", "v2"):
            assert np.array_equal(getattr(a, name), getattr(b, name)) or getattr(a, name) is getattr(b, name) is None


def test_one_cart_is_a_rig_too():
    rigid = Drive({"m1": RIG["m1"], "b1": RIG["b1"], "d1": RIG["d1"]})
    made = run(SimulatedRig(rigid), PControl(0.1, "x1"), np.full(500, 10.0)).recording
    assert made.x2 is None
    assert made.x1[-1] > 5.0


def test_velocities_are_raw_differences_where_the_rig_makes_none():
    seen: list[Observation] = []
    rig = Scripted(x=lambda k: 0.01 * k)
    run(rig, lambda o: seen.append(o) or 0.0, np.zeros(5), LIMITS, clock=rig.clock)
    assert [o.v1 for o in seen] == pytest.approx([0.0, 10.0, 10.0, 10.0, 10.0])


def test_an_excitation_beyond_the_limit_is_refused_before_anything_moves():
    rig = Scripted()
    with pytest.raises(ValueError, match=r"sine: the amplitude must be within the command limit of 5 V; got 6 V"):
        RigBench(rig, LIMITS).open_loop("sine", 6.0, 1.0)
    assert rig.told == []


@each("name", ["travel", "voltage", "late", "watchdog", "resting"])
def test_limits_are_positive(name):
    with pytest.raises(ValueError, match=f"{name}: must be a positive number; got 0"):
        Limits(**{name: 0.0})
