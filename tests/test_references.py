"""References: limits of a motion profile, spectra and bits of an excitation, and what a user may get wrong."""

import inspect
import math
import re
from functools import partial

import numpy as np
import pytest

from flexdrive_gym import references
from flexdrive_gym.references import (
    REFERENCES,
    chirp,
    handout_trajectory,
    is_random,
    prbs,
    random_moves,
    s_curve,
    sample_reference,
    step,
)
from tests.each import each

T = np.arange(4001) * 1e-3

# stroke, speed, acceleration, jerk; named by the limits that the move reaches
MOVES = {
    "all": (50.0, 100.0, 500.0, 5000.0),
    "no speed": (10.0, 100.0, 500.0, 5000.0),
    "no acceleration": (50.0, 20.0, 500.0, 5000.0),
    "jerk alone": (0.5, 100.0, 500.0, 5000.0),
    "backwards": (-50.0, 100.0, 500.0, 5000.0),
    "long": (400.0, 50.0, 500.0, 5000.0),
}


def rng(seed=1):
    return np.random.default_rng(seed)


def derivatives(x, h):
    """Largest |v|, |a| and |j| by differences, which average and so never exceed the true ones."""
    return [float(np.abs(np.diff(x, n)).max() / h**n) for n in (1, 2, 3)]


@each("move", MOVES.values(), ids=MOVES)
def test_s_curve_keeps_within_its_limits(move):
    h = 5e-3  # long enough that round-off in a third difference stays below 1e-9 of the jerk
    x = s_curve(np.arange(-20, 2400) * h, *move)
    for found, limit in zip(derivatives(x, h), move[1:], strict=True):
        assert found <= limit * (1.0 + 1e-9)


@each("move", MOVES.values(), ids=MOVES)
def test_s_curve_starts_at_zero_ends_exactly_and_never_turns_back(move):
    x = s_curve(np.linspace(-1.0, 12.0, 50_001), *move)
    assert x[0] == 0.0
    assert x[-1] == move[0]
    assert np.all(np.diff(x) * np.sign(move[0]) >= -1e-12)


def test_s_curve_is_the_fastest_one():
    # all limits reached: stroke/V + V/A + A/J, the textbook's duration
    total = 50.0 / 100.0 + 100.0 / 500.0 + 500.0 / 5000.0
    assert s_curve([total - 1e-2, total + 1e-12], *MOVES["all"])[0] < 50.0
    assert s_curve([total + 1e-12], *MOVES["all"])[0] == 50.0
    # jerk alone: four segments of cbrt(stroke/2J)
    total = 4.0 * np.cbrt(0.5 / 10_000.0)
    near = s_curve([total - 1e-3, total + 1e-12], *MOVES["jerk alone"])
    assert near[0] < 0.5 == near[1]


def test_s_curve_reaches_each_limit_that_it_can():
    h = 1e-3
    speed, acceleration, jerk = derivatives(s_curve(np.arange(1200) * h), h)
    assert speed == pytest.approx(100.0, rel=1e-9)
    assert acceleration == pytest.approx(500.0, rel=1e-6)
    assert jerk == pytest.approx(5000.0, rel=1e-6)


def test_s_curve_of_endless_jerk_is_the_trapezoid():
    np.testing.assert_allclose(s_curve(T, jerk=1e9), references.point_to_point(T), atol=1e-3)


def test_s_curve_of_no_stroke_rests():
    assert not s_curve(T, stroke=0.0).any()


def test_step_jumps_at_its_instant():
    x = step(T)
    assert x[199] == 0.0
    assert x[200] == 50.0
    # 3·0.1 is a little more than 0.3: the sample meant to be on the edge is
    assert step(np.array([0.3]), 10.0, at=3 * 0.1)[0] == 10.0


def test_chirp_has_the_frequency_it_says():
    t = np.linspace(0.0, 12.0, 1_200_001)
    x = chirp(t, 2.0, 1.0, 5.0, 10.0)
    # a rising zero crossing per cycle: the time between two is the period at the middle between them
    rising = np.flatnonzero((x[:-1] < 0.0) & (x[1:] >= 0.0))
    crossing = t[rising] - x[rising] * np.diff(t)[0] / (x[rising + 1] - x[rising])
    # the phase is quadratic, so mean frequency between crossings is the frequency at the middle, exactly
    inside = crossing[1:] <= 10.0
    middle, frequency = 0.5 * (crossing[1:] + crossing[:-1]), 1.0 / np.diff(crossing)
    np.testing.assert_allclose(frequency[inside], 1.0 + 0.4 * middle[inside], rtol=1e-6)
    after = crossing[:-1] >= 10.0
    assert after.sum() >= 5
    np.testing.assert_allclose(frequency[after], 5.0, rtol=1e-6)


def test_chirp_never_jumps():
    h = 1e-4
    x = chirp(np.arange(-1000, 120_000) * h, 2.0, 1.0, 5.0, 10.0)
    assert x[0] == 0.0
    assert derivatives(x, h)[0] <= 2.0 * 2.0 * np.pi * 5.0 * (1.0 + 1e-9)
    assert np.abs(x).max() == pytest.approx(2.0, abs=1e-6)


def test_prbs_has_two_levels_and_holds_each_bit():
    x = prbs(T, 20.0, 0.25, rng())
    assert set(x) == {-20.0, 20.0}
    bits = x[:4000].reshape(-1, 250)
    assert np.all(bits == bits[:, :1])


def test_prbs_is_balanced_and_white():
    bits = prbs(np.arange(20_000) * 0.1, 1.0, 0.1, rng())
    # five standard deviations of the mean of independent signs
    assert abs(bits.mean()) < 5.0 / np.sqrt(20_000)
    assert abs((bits[1:] * bits[:-1]).mean()) < 5.0 / np.sqrt(20_000)


def test_random_moves_keep_within_their_limits_and_dwell():
    h = 5e-3  # shorter, and the round-off of t = 60 s would show in a second difference
    x = random_moves(np.arange(12_000) * h, rng(), stroke=80.0, speed=90.0, acceleration=400.0, dwell_s=0.5)
    speed, acceleration, _jerk = derivatives(x, h)
    assert speed == pytest.approx(90.0, rel=1e-9)
    assert acceleration == pytest.approx(400.0, rel=1e-9)
    assert x[0] == 0.0
    assert np.abs(x).max() <= 80.0
    # rests are constant to round-off and last the dwell, up to the samples at their two ends
    moving = np.flatnonzero(np.abs(np.diff(x)) > 1e-9)
    rests = np.diff(moving)[np.diff(moving) > 1] * h
    assert len(rests) > 20
    np.testing.assert_allclose(rests, 0.5, atol=2 * h)


def test_random_moves_can_go_without_rest():
    x = random_moves(T, rng(), dwell_s=0.0)
    assert np.abs(np.diff(x)).max() <= 100.0 * 1e-3 * (1.0 + 1e-9)


@pytest.mark.parametrize("name", [n for n, kind in REFERENCES.items() if kind.needs_rng])
class TestRandomReference:
    def test_same_seed_same_reference(self, name):
        np.testing.assert_array_equal(sample_reference(name, T, rng(3)), sample_reference(name, T, rng(3)))
        assert not np.array_equal(sample_reference(name, T, rng(3)), sample_reference(name, T, rng(4)))

    def test_sample_time_and_length_do_not_change_it(self, name):
        fine = sample_reference(name, T, rng(3))
        np.testing.assert_allclose(sample_reference(name, T[::10], rng(3)), fine[::10], atol=1e-9)
        np.testing.assert_allclose(sample_reference(name, T[:2000], rng(3)), fine[:2000], atol=1e-9)

    def test_needs_a_generator(self, name):
        assert is_random(name)
        with pytest.raises(TypeError, match=r"rng: the reference .* is random .* got None\. Pass numpy\.random"):
            sample_reference(name, T)
        with pytest.raises(TypeError, match=r"rng: .* got 3\."):
            sample_reference(name, T, 3)


@pytest.mark.parametrize("name", REFERENCES)
class TestRegistry:
    def test_makes_finite_positions(self, name):
        x = sample_reference(name, T, rng())
        assert x.shape == T.shape
        assert x.dtype == np.float64
        assert np.all(np.isfinite(x))
        assert np.ptp(x) > 1.0

    def test_every_keyword_has_a_default_unit_and_meaning(self, name):
        kind = REFERENCES[name]
        signature = inspect.signature(kind.function).parameters
        assert set(kind.defaults) == set(signature) - {"t", "rng"}
        assert kind.needs_rng == ("rng" in signature)
        for parameter in kind.parameters:
            assert parameter.unit
            assert parameter.meaning
            default = signature[parameter.name].default
            assert default in (inspect.Parameter.empty, parameter.default)

    def test_only_random_kinds_draw(self, name):
        generator = rng(5)
        sample_reference(name, T, generator)
        assert (generator.random() != rng(5).random()) == REFERENCES[name].needs_rng
        assert is_random(name) == is_random((name, {})) == REFERENCES[name].needs_rng


def test_registry_names():
    assert set(REFERENCES) == {"handout", "step", "square", "sine", "chirp", "s_curve", "prbs", "random_moves"}


def test_a_name_with_keywords():
    x = sample_reference(("sine", {"amplitude": 10, "frequency": np.float32(2.0)}), T)
    np.testing.assert_allclose(x, 10.0 * np.sin(4.0 * np.pi * T), atol=1e-9)
    np.testing.assert_array_equal(sample_reference("handout", T), handout_trajectory(T))


@each("form", [list, tuple, np.array, partial(np.array, dtype=np.int32)])
def test_an_array_is_used_by_sample_and_its_end_held(form):
    np.testing.assert_array_equal(sample_reference(form([1, 2, 3]), T[:5]), [1, 2, 3, 3, 3])
    np.testing.assert_array_equal(sample_reference(form([1, 2, 3]), T[:2]), [1, 2])


def test_an_array_is_copied():
    given = np.ones(5)
    sample_reference(given, T[:5])[:] = 7.0
    assert given[0] == 1.0


def test_functions_of_time_and_of_time_and_generator():
    np.testing.assert_array_equal(sample_reference(lambda t: 3.0 * t, T), 3.0 * T)
    np.testing.assert_array_equal(sample_reference(np.sin, T), np.sin(T))
    expected = prbs(T, 5.0, 0.5, rng())
    for spec in (
        lambda t, rng: prbs(t, 5.0, 0.5, rng),
        lambda t, generator: prbs(t, 5.0, 0.5, generator),
        lambda t, *, rng: prbs(t, 5.0, 0.5, rng),
        partial(prbs, amplitude=5.0, bit_s=0.5),
    ):
        assert is_random(spec)
        np.testing.assert_array_equal(sample_reference(spec, T, rng()), expected)
    for spec in (np.sin, np.ones(3), [1.0], lambda t, gain=2.0: gain * t):
        assert not is_random(spec)


def test_a_function_cannot_shift_the_clock():
    def careless(t):
        t -= 1.0
        return t

    t = T.copy()
    sample_reference(careless, t)
    np.testing.assert_array_equal(t, T)


WRONG = [
    ("hanout", ValueError, "reference: no reference is called 'hanout'. Did you mean 'handout'?"),
    ("zzz", ValueError, "reference: no reference is called 'zzz'. Choose from handout, step, square, sine, chirp"),
    (("sin", {}), ValueError, "reference: no reference is called 'sin'. Did you mean 'sine'?"),
    (
        ("sine",),
        TypeError,
        (
            "reference: a tuple must be (name, {keyword: value}); got ('sine',). Write ('sine', {'amplitude': 25.0, "
            "'frequency': 0.5}), or 'sine' alone for the defaults."
        ),
    ),
    (("sine", 10.0), TypeError, "reference: a tuple must be (name, {keyword: value}); got ('sine', 10.0)."),
    (
        ("sine", {"amplitud": 1.0}),
        ValueError,
        "reference: 'sine' has no keyword 'amplitud'. Did you mean 'amplitude'?",
    ),
    (("sine", {"q": 1.0}), ValueError, "reference: 'sine' has no keyword 'q'. Choose from amplitude, frequency."),
    (("prbs", {"rng": 1.0}), ValueError, "reference: 'prbs' has no keyword 'rng'."),
    (("sine", {3: 1.0}), ValueError, "reference: 'sine' has no keyword 3."),
    (
        ("handout", {"stroke": 10.0}),
        ValueError,
        "reference: 'handout' has no keyword 'stroke'. Write 'handout' alone: it has no keywords.",
    ),
    (
        ("sine", {"amplitude": "10"}),
        TypeError,
        "reference: amplitude of 'sine' must be a number [mm]; got '10'. The default is 25 mm.",
    ),
    (("sine", {"amplitude": True}), TypeError, "must be a number [mm]; got True."),
    (("sine", {"frequency": math.inf}), ValueError, "frequency of 'sine' must be finite [Hz]; got inf. The default"),
    (
        ("s_curve", {"jerk": -1.0}),
        ValueError,
        "reference: 's_curve' cannot have these values. jerk: must be positive and finite; got -1. Pass a value above",
    ),
    (("chirp", {"duration": 0}), ValueError, "duration: must be positive and finite; got 0."),
    (("prbs", {"bit_s": 0}), ValueError, "bit_s: must be positive and finite; got 0."),
    (("random_moves", {"stroke": -50}), ValueError, "stroke: must be positive and finite; got -50."),
    (("random_moves", {"dwell_s": -1}), ValueError, "dwell_s: must not be negative [s]; got -1. Use 0 for moves"),
    (
        None,
        TypeError,
        "must be a name, a text 'name:keyword=value:…', (name, {keyword: value}), an array of positions [mm] or",
    ),
    ({"sine": 1}, TypeError, "got {'sine': 1} of type dict."),
    (["sine", {}], TypeError, "got ['sine', {}] of type list."),
    ([1.0, 2.0j], TypeError, "reference: must be a name"),
    ([True, False], TypeError, "reference: must be a name"),
    (
        50.0,
        ValueError,
        (
            "reference: an array must be one-dimensional with at least one position [mm]; got shape (). Pass one value "
            "per sample, or a single one as [50.0] to hold it."
        ),
    ),
    (np.ones((2, 3)), ValueError, "got shape (2, 3)."),
    ([], ValueError, "got shape (0,)."),
    ([[1.0], [1.0, 2.0]], ValueError, "reference: an array must be one-dimensional; got rows of unequal length."),
    (
        [1.0, np.nan, np.inf],
        ValueError,
        "reference: an array must hold finite positions [mm]; got nan at sample 1 and 1 more. Fill gaps",
    ),
    (lambda t: t / 0.0, ValueError, "reference: a function must return finite positions [mm]; got nan at sample 0"),
    (
        lambda t: 50.0,
        ValueError,
        (
            "reference: a function must return one position [mm] per instant, shape (4001,); got shape (). It is called "
            "once with all instants; for a constant return numpy.full_like(t, value)."
        ),
    ),
    (lambda t: t[:-1], ValueError, "got shape (4000,)."),
    (lambda t: t * 1j, TypeError, "reference: a function must return real numbers [mm]; got an array of complex128."),
    (lambda t: None, TypeError, "reference: a function must return real numbers [mm]; got an array of object."),
    (
        math.sin,
        TypeError,
        "reference: the function fails on the vector of all instants, shape (4001,): ",
    ),
    (
        lambda t, a, b: t,
        TypeError,
        "reference: a function must be callable as f(t) or f(t, rng); got f(t, a, b). Bind its other arguments",
    ),
    (lambda: 0.0, TypeError, "got f()."),
    (lambda t, *, gain: t, TypeError, "got f(t, *, gain)."),
]


@each(("spec", "kind", "text"), WRONG, ids=[w[2][-40:] for w in WRONG])
def test_wrong_references_are_explained(spec, kind, text):
    with np.errstate(all="ignore"), pytest.raises(kind, match=re.escape(text)):
        sample_reference(spec, T, rng())


@each("spec", ["hanout", ("sin", {}), lambda t, a, b: t])
def test_is_random_explains_them_too(spec):
    with pytest.raises((ValueError, TypeError), match="reference: "):
        is_random(spec)


def test_instants_are_a_vector():
    with pytest.raises(ValueError, match=r"t: must be a vector of instants \[s\]; got shape \(\)\."):
        sample_reference("handout", 0.0)
