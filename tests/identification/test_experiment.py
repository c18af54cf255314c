"""What a recording is, told from its data: kinds of experiment, held carts, commands that are references."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from flexdrive_gym import Drive, PControl, Recording
from flexdrive_gym.units import Units
from identification.experiment import as_reference, experiment_of, held_carts
from identification.readiness.sessions import sessions_of
from identification.recordings import read_recordings, recognise_excitation
from identification.recordings.rig import parse_rig
from identification.selection import select
from identification.topology import GROUND_MASS
from tests.drive.drives import RIG
from tests.each import each
from tests.identification.lab import COUNTS, QUANTUM, T, data_set

DRIVE = Drive({**RIG, **COUNTS})


def record(drive, u, name="run"):
    made = drive.simulate(T, u, name=name)
    return replace(made, excitation=recognise_excitation(T, u), v1=None, v2=None, quantum=(QUANTUM, QUANTUM))


def steps(*levels):
    return np.repeat(np.array(levels, dtype=float), len(T) // len(levels) + 1)[: len(T)]


@each(
    ("u", "kind"),
    [
        (2.0 * np.sin(2 * np.pi * 1.5 * T), "sine"),
        (2.0 * np.sign(np.sin(2 * np.pi * 0.5 * T + 1e-9)), "square"),
        (steps(0.0, 1.5, 0.0), "step"),
        (np.clip(T - 0.5, 0.0, 3.0), "ramp"),
        (np.interp(T, [0, 2, 4], [0, 1.5, 0]), "ramp"),
        (np.random.default_rng(0).normal(size=len(T)), "other"),
    ],
)
def test_the_kind_is_told_from_the_command(u, kind):
    assert experiment_of(record(DRIVE, u)) == kind


def test_zero_command_and_motion_is_a_free_decay():
    x = np.exp(-T) * np.cos(9.0 * T)
    assert experiment_of(Recording("plucked", T, 0.0 * T, x1=0.0 * T, x2=x)) == "free_decay"


def test_p_control_and_another_controller():
    loop = DRIVE.simulate_closed_loop(T, steps(0.0, 20.0, 0.0), PControl(0.05, "x2"))
    own = recognise_excitation(T, loop.u, loop.x1, loop.x2, loop.xr)
    assert experiment_of(replace(loop, excitation=own)) == "p_control"
    assert experiment_of(replace(loop, excitation=replace(own, gain=None))) == "closed_loop"


def test_a_held_cart_stays_behind_though_the_spring_pulls():
    free = [record(DRIVE, steps(0.0, 2.0, -2.0, 2.0), f"free {i}") for i in range(2)]
    held = record(DRIVE.replace(m2=GROUND_MASS), steps(0.0, 2.0, -2.0, 2.0), "cart 2 held")
    fast = record(DRIVE, 2.0 * np.sin(2 * np.pi * 15.0 * T), "fast sine")
    plucked = Recording("plucked", T, 0 * T, x1=0 * T, x2=20 * np.exp(-T) * np.cos(9 * T), quantum=(QUANTUM, QUANTUM))
    assert held_carts([*free, held, fast, plucked]) == ((), (), (2,), (), (1,))
    # what a rig description says has the last word
    assert held_carts([replace(free[0], held=(1,))]) == ((1,),)
    chosen = select([*free, held, fast, plucked])
    assert [r.name for r in chosen.usable] == ["free 0", "free 1", "fast sine"]
    assert "2 recordings with a held cart left out" in chosen.notes[0]


def test_a_speed_without_sign_adds_up_to_no_way_and_holds_no_cart():
    t = np.arange(8001) * 1e-3
    runs = [DRIVE.simulate(t, 2.5 * np.sin(2 * np.pi * f * t), name=f"{f} Hz") for f in (2.0, 3.0, 5.0)]
    for turned in (1.0, -1.0):
        rectified = [replace(r, x1=None, x2=None, v2=turned * np.abs(r.v2)) for r in runs]
        assert held_carts(rectified) == ((), (), ())


def test_friction_that_holds_cart_2_is_no_clamp():
    stiff = Drive({**RIG, **COUNTS, "d2": 0.4})
    runs = [record(stiff, a * np.sign(np.sin(2 * np.pi * 0.5 * T + 1e-9)), str(a)) for a in (0.6, 1.5, 2.0)]
    assert np.ptp(runs[0].x2) < 0.1 * np.ptp(runs[0].x1)
    assert held_carts(runs) == ((), (), ())


def test_a_target_called_command_is_a_reference():
    t = np.arange(8001) * 1e-3
    target = np.where((t > 1.0) & (t < 4.5), 20.0, 0.0)
    loop = DRIVE.replace(d1=0.02, d2=0.0, b1=0.015).simulate_closed_loop(t, target, PControl(0.05, "x1"))
    # the counts of the target were read as converter units, as a description of the open-loop runs says
    u = target / 0.0044 * 0.0012
    log = replace(loop, u=u, xr=None, v1=None, v2=None, excitation=recognise_excitation(t, u))
    found = as_reference(log, {"u": 0.0012, "x1": 0.0044, "x2": 0.0044})
    assert found is not None
    assert found.gain == pytest.approx(1.0, abs=0.1)
    assert as_reference(log, {}) is None


def test_a_target_in_radians_is_a_reference_too():
    target = 20.0 * np.sin(2 * np.pi * 0.25 * T)
    units = Units("rad", "N m", 100.0, 100.0)
    assert as_reference(Recording("servo", T, target, x1=np.roll(target, 5) * 0.99, units=units)) is not None


def test_commands_are_commands():
    sines = [record(DRIVE, a * np.sin(2 * np.pi * f * T)) for a in (1.0, 2.5) for f in (0.5, 1, 2, 3, 4, 5, 8, 20)]
    for r in [*sines, *data_set(), record(DRIVE, steps(0.0, 2.0, -2.0, 0.0))]:
        assert as_reference(r) is None, r.name


def test_no_usable_recording_names_the_reasons():
    with pytest.raises(ValueError, match="1 recording without command left out"):
        select([Recording("rest", T, 0.0 * T, x1=0.0 * T)]).require()


ECP = """
[units]
u = { unit = "V", factor = 0.001221 }
x1 = { unit = "mm", factor = 0.004413 }
x2 = { unit = "mm", factor = 0.004413 }
"""


def test_another_makers_rig_is_understood(shared_recordings):
    runs = read_recordings(shared_recordings / "ecp210_2025", rig=parse_rig(ECP), only=["*.txt"])
    chosen = select(runs)
    # as its owners describe their data sets
    assert len(chosen.usable) == 7
    assert all(name.startswith("07-Feb") for name in (r.source for r in chosen.usable))
    assert sum(carts == (2,) for carts in chosen.held.values()) == 11
    assert sum(carts == (1,) for carts in chosen.held.values()) == 10
    assert sorted(r.source[:12] for r, why in chosen.left_out if why == "reference") == ["21-Feb-2025 "] * 5


def test_two_sessions_ten_days_apart(shared_recordings):
    runs = read_recordings(shared_recordings / "mte360_2025_raw")
    assert Counter(sessions_of(runs)) == {"2025-11-10": 15, "2025-11-20": 18}
    kinds = Counter(map(experiment_of, runs))
    assert kinds == {"square": 18, "sine": 14, "p_control": 1}
    assert len(select(runs).usable) == 33
