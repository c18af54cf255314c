"""Which candidate is named: by gains that no single experiment decides, ties by paired scores, names before free functions."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from identification.mismatch.candidates.catalogue import Candidate
from identification.mismatch.candidates.free import Shape
from identification.mismatch.candidates.narrow_band import made
from identification.mismatch.candidates.phases import Phase
from identification.mismatch.fitting.bench import Bench
from identification.mismatch.fitting.fit import Coordinates, Fit
from identification.mismatch.selection.evaluate import Table
from identification.mismatch.selection.linear import Entry
from identification.mismatch.selection.ranking import Scored, dispensable, joined, ranked, scores, tied

RNG = np.random.default_rng(0)


def named(effect, gain, size=1):
    keys = tuple((f"{effect}.{i}", 1.0) for i in range(size))
    return Scored(Candidate(effect, "guide", keys), None, np.asarray(gain, dtype=float), size, 0.002)


def at_cart(effect, gain, where):
    return Scored(
        Candidate(effect, where, ((f"{effect}.{where}", 1.0),)), None, np.asarray(gain, dtype=float), 1, 0.002
    )


def free(gain):
    return Scored(Shape("cart_1", "command", np.zeros(1), (), 0.1), None, np.asarray(gain, dtype=float), 6, 0.002)


def test_two_names_of_one_force_tie_and_the_simpler_one_is_named():
    gain = RNG.uniform(5.0, 10.0, 12)
    one, two = named("input_offset", gain), named("stribeck", gain + 1e-9, size=2)
    assert tied(two, one)
    assert ranked([one, two], [one, two])[0] is one


def test_what_predicts_better_in_every_experiment_is_no_tie():
    gain = RNG.uniform(5.0, 10.0, 12)
    better = named("stribeck", 1.3 * gain, size=2)
    assert not tied(better, named("input_offset", gain))
    assert ranked([named("input_offset", gain), better], [better])[0] is better


def test_a_name_that_gains_most_of_it_stands_for_a_free_function():
    gain = RNG.uniform(50.0, 60.0, 12)
    whole, most, less = free(gain), named("saturation", 0.7 * gain), named("dead_zone", 0.4 * gain)
    assert ranked([whole, most, less], [whole, most, less])[0] is most
    assert ranked([whole, less], [whole, less])[0] is whole


def test_what_stands_for_a_significant_function_need_not_be_significant_itself():
    gain = RNG.uniform(50.0, 60.0, 12)
    whole, most, rare = free(gain), named("saturation", 0.7 * gain), named("dead_zone", 0.1 * gain)
    assert ranked([whole, most, rare], [whole, rare])[0] is most


def test_dry_friction_comes_before_what_refines_it():
    gain = RNG.uniform(50.0, 60.0, 12)
    refined, plain = at_cart("stribeck", gain, "cart_2"), at_cart("coulomb_friction", 0.8 * gain, "cart_2")
    elsewhere = at_cart("coulomb_friction", 0.9 * gain, "cart_1")
    assert ranked([refined, elsewhere, plain], [refined, elsewhere, plain])[0] is plain
    # it need not gain by itself: the refinement does not describe what it would (Nelder)
    alone = replace(at_cart("coulomb_friction", -0.1 * gain, "cart_2"), fit=object())
    assert ranked([refined, alone], [refined])[0] is alone
    # beside it the refinement is named
    assert ranked([refined], [refined])[0] is refined


def test_dry_friction_stays_while_another_effect_refines_it():
    gain = RNG.uniform(50.0, 60.0, 12)
    own, other = (at_cart("coulomb_friction", gain, f"cart_{c}") for c in (1, 2))
    refined = at_cart("position_friction", gain, "cart_1")
    assert dispensable([own, other, refined]) == [other, refined]
    assert dispensable([own, other]) == [own, other]


def test_another_size_of_what_has_a_name_says_less_than_another_name():
    """A rail that bends under both carts is one spring to ground, and no spring and an encoder of another scale."""
    gain = RNG.uniform(5.0, 10.0, 12)
    other = named("encoder_scale", gain + RNG.normal(0.3, 1.0, 12))
    more = replace(
        named("ground_spring", gain), candidate=Candidate("ground_spring", "guide", (("ground_spring.kg_2", 1e-3),))
    )
    assert ranked([other, more], [other, more])[0] is other
    assert ranked([other, more], [other, more], {more.name})[0] is more
    # what predicts better in every experiment is another effect all the same
    better = named("encoder_scale", 1.5 * gain)
    assert ranked([better, more], [better, more], {more.name})[0] is better


def test_another_size_of_what_has_a_name_becomes_part_of_it():
    gain = RNG.uniform(5.0, 10.0, 12)
    spring, delay = named("ground_spring", gain), named("input_delay", gain)
    more = replace(
        spring, candidate=Candidate("ground_spring", "guide", (("ground_spring.kg_2", 1e-3),)), gain=0.5 * gain
    )
    taken = joined(joined(joined([], spring, "first"), delay, "second"), more, "third")
    assert [(s.name[0], step) for s, step in taken] == [("ground_spring", "first"), ("input_delay", "second")]
    whole = taken[0][0]
    assert whole.candidate.keys == ("ground_spring.0", "ground_spring.kg_2")
    assert whole.size == 2
    assert whole.total == pytest.approx(1.5 * spring.total)


def test_a_command_makes_its_own_frequency_and_odd_harmonics_through_friction():
    t = np.arange(8000) * 1e-3
    frequency = np.array([2.0, 6.0, 10.0, 7.3])
    assert made(np.sin(2.0 * np.pi * 2.0 * t), 1e-3, frequency).tolist() == [True, True, True, False]


@pytest.fixture
def score():
    """What a candidate scores whose fit leaves so much in each of twelve experiments of fifty rows; its model leaves 1."""
    bench = object.__new__(Bench)
    bench.units, bench.rows = np.arange(12), [slice(50 * u, 50 * (u + 1)) for u in range(12)]
    whole = SimpleNamespace(white=lambda x: x)
    drag = Candidate("quadratic_drag", "cart_1", (("quadratic_drag.cart_1.c", 1e-5),))

    def of(left, periods=0):
        def model(left, *names):
            residual = np.repeat(left, 50)
            return Fit({}, names, float(residual @ residual), residual, Coordinates((), {}), bench, whole)

        ripples = [Entry(Phase(*drag.name, float(p)), ()) for p in range(periods)]
        linear = SimpleNamespace(entries=ripples, products=np.zeros((12, 1, 1)))
        null = SimpleNamespace(rarity=lambda *_: 0.002, p_value=lambda *_: 0.002)
        return scores(model(np.ones(12)), linear, Table({}, {}, {}), {drag.name: (drag, model(left, *drag.keys))}, null)

    return of


def test_a_fit_that_is_worse_than_the_model_it_contains_gains_nothing(score):
    """A recording that loses much is odd, and is left out of a gain: of a fit in another valley that is no evidence."""
    (better,) = score(np.full(12, 0.3))
    assert better.total > 40.0
    (worse,) = score(np.array([4.0, *np.full(11, 0.3)]))
    assert worse.total == 0.0


def test_of_many_periods_one_that_a_fit_found_costs_their_choice(score):
    (alone,), (chosen,) = score(np.full(12, 0.3)), score(np.full(12, 0.3), periods=45)
    assert alone.gain.sum() - chosen.gain.sum() == pytest.approx(np.log(45.0))
