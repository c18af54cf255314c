"""Frozen encoders and lost counts against carts that friction, gaps and play bring to rest."""

import numpy as np
import pytest

from flexdrive_gym.recording import Recording
from identification.recordings import find_faults, recognise_excitation
from tests.each import each
from tests.identification.recordings.logs import COUNT, TS, closed_loop, open_loop, recording, speed


def faults(run, *more):
    """Return (where, id, first, last sample) of the faults of the first run."""
    found = find_faults([run, *more])[0].faults
    return [(f.where, f.id, round(f.start_s / TS), round(f.end_s / TS)) for f in found]


def freeze(v, first, last):
    """Return a speed whose encoder counts nothing from the middle of sample first-1 on."""
    frozen = v.copy()
    frozen[first : last + 1] = 0.0
    frozen[first - 1] = np.round(0.4 * v[first - 1] / (COUNT / TS)) * COUNT / TS
    return frozen


def play(x, gap):
    """Return what an encoder behind a dead band of +-gap reads."""
    reading, rest = np.zeros_like(x), 0.0
    for k, position in enumerate(x):
        rest = min(max(rest, position - gap), position + gap)
        reading[k] = rest
    return np.round(reading / COUNT) * COUNT


@each(
    ("kind", "amplitude", "frequency"),
    [("square", 0.5, 0.5), ("square", 2.0, 0.5), ("sine", 2.5, 2.0), ("sine", 2.5, 12.0), ("sine", 0.6, 1.0)],
)
def test_friction_that_holds_a_cart_is_no_fault(kind, amplitude, frequency):
    run = recording(kind=kind, amplitude=amplitude, frequency=frequency)
    assert max(np.sum(run.v1 == 0.0), np.sum(run.v2 == 0.0)) > 30  # there is something to be mistaken
    assert faults(run) == []


@each("cart", ["1", "2"])
@each("length", [12, 40, 300])
def test_a_frozen_encoder_is_found_with_the_samples_its_edges_cut(cart, length):
    run = recording()
    v = getattr(run, f"v{cart}")
    first = 2500  # in the middle of a half-period, at speed
    frozen = recording(**{f"v{cart}": freeze(v, first, first + length - 1)})
    assert faults(frozen) == [(f"encoder_{cart}", "encoder_dropout", first - 1, first + length)]


def test_a_freeze_that_ends_at_a_standstill_is_found_by_its_onset():
    run = recording(kind="sine", frequency=1.0)
    first = int(np.argmax(run.v1[2000:2500])) + 2000
    last = first + int(np.argmax(run.v1[first:] <= 0.0))
    assert faults(recording(kind="sine", frequency=1.0, v1=freeze(run.v1, first, last)))[0][2] == first - 1


def test_a_freeze_up_to_the_end_of_the_run_is_found():
    run = recording()
    assert faults(recording(v1=freeze(run.v1, 3800, run.n - 1))) == [("encoder_1", "encoder_dropout", 3799, run.n - 1)]


def test_a_freeze_through_several_swings_is_found_though_its_edges_are_slow():
    run = recording(kind="sine", frequency=5.0)
    slow = np.flatnonzero((np.abs(run.v1) < 10.0) & (run.v1 != 0.0))
    first, last = slow[slow > 1500][0], slow[slow > 2100][0]
    found = faults(recording(kind="sine", frequency=5.0, v1=freeze(run.v1, first, last)))
    assert [f[:2] for f in found] == [("encoder_1", "encoder_dropout")]


def test_a_drive_that_is_switched_off_is_no_freeze():
    t, u, x1, x2 = open_loop("sine", 2.5, 5.0)
    u, v1, v2 = u.copy(), speed(x1), speed(x2)
    stop = int(np.flatnonzero((v1 == 0.0) & (np.arange(t.size) > 2500))[0])
    u[stop:], v1[stop:], v2[stop:] = 0.0, 0.0, 0.0
    found = Recording("r", t, u, v1=v1, v2=v2, quantum=(COUNT, COUNT), excitation=recognise_excitation(t, u))
    assert [f for f in faults(found) if f[0] == "encoder_1"] == []


@each("gap", [0.3, 0.6])
def test_play_that_holds_the_reading_at_reversals_is_no_fault(gap):
    t, u, x1, x2 = open_loop("sine", 2.5, 2.5)
    kwargs = {"quantum": (COUNT, COUNT), "excitation": recognise_excitation(t, u)}
    run = Recording("r", t, u, v1=speed(play(x1, gap)), v2=speed(play(x2, gap)), **kwargs)
    assert np.sum(run.v1 == 0.0) > 100
    assert faults(run) == []


def test_play_leaves_a_note():
    t, u, x1, x2 = open_loop("sine", 2.5, 1.0)
    kwargs = {"quantum": (COUNT, COUNT), "excitation": recognise_excitation(t, u)}
    run = Recording("r", t, u, v1=speed(x1), v2=speed(play(x2, 1.0)), **kwargs)
    assert any("as behind play" in note for note in find_faults([run])[0].notes)


def test_an_encoder_that_freezes_often_does_not_hide_it_by_its_jumps():
    run = recording()
    v, firsts = run.v1.copy(), [300, 620, 1350, 1800, 2480, 2700, 3310, 3650]
    for first in firsts:
        v = freeze(v, first, first + 59)
    assert [f[2] for f in faults(recording(v1=v))] == [first - 1 for first in firsts]


def test_impacts_that_keep_time_with_the_drive_are_no_fault():
    run = recording(kind="sine", frequency=2.0)
    struck = run.v1.copy()
    for k in range(400, 3900, 250):  # every half-period
        struck[k : k + 3] = 0.0
    changed = find_faults([recording(kind="sine", frequency=2.0, v1=struck)])[0]
    assert changed.faults == ()
    assert any("recur with the drive" in note for note in changed.notes)


@each("cart", ["1", "2"])
@each("length", [1, 2, 5])
def test_counts_lost_for_a_moment(cart, length):
    v = getattr(recording(), f"v{cart}").copy()
    before = v.copy()
    v[2600 : 2600 + length] = 0.0
    run = find_faults([recording(**{f"v{cart}": v})])[0]
    (fault,) = run.faults
    assert (fault.where, fault.id) == (f"encoder_{cart}", "encoder_dropout")
    assert round(fault.start_s / TS) == 2600
    assert round(fault.end_s / TS) == 2599 + length
    assert fault.note.startswith("lost counts, about ")
    assert float(fault.note.split()[3]) == pytest.approx(abs(np.sum(before - v)) * TS, rel=0.05)


def test_a_burst_of_counts():
    v = recording().v1.copy()
    v[2600] += np.sign(v[2600]) * 20 * COUNT / TS
    (fault,) = find_faults([recording(v1=v)])[0].faults
    assert fault.note.startswith("gained counts, about 0.09")


def test_five_counts_are_within_the_ripple():
    v = recording().v1.copy()
    v[2600] -= np.sign(v[2600]) * 5 * COUNT / TS
    assert faults(recording(v1=v)) == []


def test_a_jump_to_another_speed_is_no_lost_count():
    # a gear that closes its gap leaves the cart faster than before
    v = recording().v1.copy()
    v[2600:2900] *= 0.5
    assert faults(recording(v1=v)) == []


def test_counts_lost_in_quick_succession_are_one_fault():
    v = recording().v1.copy()
    v[2600], v[2604] = 0.0, 0.0
    assert faults(recording(v1=v)) == [("encoder_1", "encoder_dropout", 2600, 2604)]


def test_a_frozen_position_keeps_the_offset_of_the_lost_counts():
    t, u, xr, x1, x2 = closed_loop()
    frozen = x1.copy()
    first, last = 2520, 2600
    frozen[first : last + 1] = x1[first - 1]
    frozen[last + 1 :] -= x1[last] - x1[first - 1]
    run = Recording(
        "r", t, u, x1=frozen, x2=x2, xr=xr, quantum=(COUNT, COUNT), excitation=recognise_excitation(t, u, xr=xr)
    )
    dropout, lost = find_faults([run])[0].faults
    assert (dropout.id, round(dropout.start_s / TS), round(dropout.end_s / TS)) == (
        "encoder_dropout",
        first - 1,
        last + 1,
    )
    assert (lost.where, lost.id) == ("encoder_1", "lost_counts")
    assert (round(lost.start_s / TS), lost.end_s) == (last + 1, t[-1])
    estimate = float(lost.note.split()[1])
    assert estimate == pytest.approx(x1[last] - x1[first - 1], rel=0.15)
    assert "by the other cart" in lost.note


def catch_up(x, first, last):
    """Return a position whose reading hangs from sample first to last and is right again at the next."""
    hung = x.copy()
    hung[first : last + 1] = x[first - 1]
    return hung


@each("cart", ["1", "2"])
def test_counts_that_a_frozen_encoder_makes_up_for_at_once_are_masked_with_the_freeze(cart):
    _t, _u, x1, x2 = open_loop()
    v = speed(catch_up(x1 if cart == "1" else x2, 2500, 2599))
    assert abs(v[2600]) > 1e4
    run = find_faults([recording(**{f"v{cart}": v})])[0]
    (fault,) = run.faults
    assert (fault.where, fault.id) == (f"encoder_{cart}", "encoder_dropout")
    assert (round(fault.start_s / TS), round(fault.end_s / TS)) == (2499, 2600)
    assert fault.note.startswith("frozen, then caught up at once")
    assert not run.valid(f"v{cart}")[2600]
    assert run.valid(f"v{cart}")[2602:].all()


def test_a_position_that_caught_up_is_right_again():
    t, u, x1, x2 = open_loop()
    kwargs = {"quantum": (COUNT, COUNT), "excitation": recognise_excitation(t, u)}
    run = find_faults([Recording("r", t, u, x1=catch_up(x1, 2500, 2599), x2=x2, **kwargs)])[0]
    assert [fault.id for fault in run.faults] == ["encoder_dropout"]
    assert run.valid("x1")[2602:].all()


def test_a_reading_that_leaps_there_and_back_is_a_fault():
    v = recording().v1.copy()
    v[2600], v[2601] = v[2600] + 3e4, v[2601] - 3e4
    (fault,) = find_faults([recording(v1=v)])[0].faults
    assert (fault.id, round(fault.start_s / TS), round(fault.end_s / TS)) == ("encoder_dropout", 2600, 2601)


def test_simulated_speeds_without_counts_work_too():
    t = recording().t
    smooth = 80.0 * np.sin(3.0 * t)
    assert faults(recording(v1=smooth, v2=smooth, quantum=(0.0, 0.0))) == []
    frozen = smooth.copy()
    frozen[1400:1500] = 0.0
    assert faults(recording(v1=frozen, v2=smooth, quantum=(0.0, 0.0))) == [("encoder_1", "encoder_dropout", 1399, 1500)]


def test_a_first_encoder_that_never_counts_is_dead():
    run = recording()
    assert faults(recording(v1=np.zeros(run.n))) == [("encoder_1", "encoder_dropout", 0, run.n - 1)]


def test_a_second_cart_that_never_moves_may_be_uncoupled():
    run = find_faults([recording(v2=np.zeros(recording().n))])[0]
    assert run.faults == ()
    assert "encoder_2 never counts while cart 1 travels" in run.notes[0]


def test_a_reading_that_starts_late_needs_the_other_cart_as_witness():
    run = recording(kind="sine", frequency=12.0)
    late = run.v1.copy()
    late[: int(np.argmax(np.abs(late[:100]) > 100.0))] = 0.0
    assert faults(recording(kind="sine", frequency=12.0, v1=late)) == []
    run = recording()
    late = run.v1.copy()
    late[:700] = 0.0
    assert faults(recording(v1=late)) == [("encoder_1", "encoder_dropout", 0, 700)]


def held(v, first, last):
    """Return a speed that falls to nothing, rests from sample first to last, and goes on where it began to fall."""
    fall = np.where(np.arange(v.size) < first, v, 0.0)
    fall[first - 60 : first] *= np.linspace(1.0, 0.0, 60)
    fall[last + 1 :] = v[first - 60 : first - 60 + v.size - last - 1]
    fall[last + 1 : last + 61] *= np.linspace(0.0, 1.0, 60)
    return fall


@each(("first", "last"), [(0, 189), (1500, 2100)])
def test_static_friction_may_hold_both_carts_for_whole_swings(first, last):
    """Breakaway of four times the Coulomb level holds a drive at the start of a sine, or in the middle, as it likes."""
    sine = {"kind": "sine", "frequency": 4.0}
    run = recording(**sine)
    if first == 0:
        v1, v2 = (np.where(np.arange(run.n) <= last, 0.0, np.roll(v, last + 1)) for v in (run.v1, run.v2))
    else:
        v1, v2 = (held(v, first, last) for v in (run.v1, run.v2))
    assert faults(recording(**sine, v1=v1, v2=v2)) == []
    # where the other cart has travelled meanwhile, the reading has stopped and not the cart
    broken = faults(recording(**sine, v1=v1))
    assert [(where, what) for where, what, *_ in broken] == [("encoder_1", "encoder_dropout")]
    assert broken[0][2] == pytest.approx(max(first - 1, 0), abs=2)
