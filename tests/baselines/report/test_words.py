"""A diagnosis in plain words."""

from baselines.report import words
from identification.mismatch.answer.finding import Finding, Unnamed
from tests.each import each
from tests.identification.mismatch.lab import diagnosis


@each(
    ("id_", "where", "text"),
    [
        ("stribeck", "cart_1", "Stribeck effect at cart 1"),
        ("free function of velocity 2", "cart_2", "a force on cart 2 that follows the velocity of cart 2"),
        ("free function of deflection", "spring", "a force in the spring that follows the deflection of the spring"),
        (
            "free function of size of the command, as friction 1",
            "cart_1",
            "a force on cart 1 that follows the size of the command, against the motion",
        ),
    ],
)
def test_what_has_no_name_is_said_by_what_it_follows(id_, where, text):
    assert words.at(id_, where) == text


@each(
    ("where", "text"),
    [
        ("cart_2", "a force on cart 2 most like breakaway"),
        ("spring", "a force in the spring most like breakaway"),
        ("encoder_1", "something at encoder 1 most like breakaway"),
    ],
)
def test_an_effect_without_a_name_is_a_force_only_where_one_can_act(where, text):
    assert words.without_name(Unnamed(where, 0.1, "most like breakaway")) == text


@each(("ended", "text"), [(True, "nothing more is significant"), (False, "so more may be left out")])
def test_nothing_is_said_of_rounds_that_were_not_made(ended, text):
    finding = Finding("tilt", "guide", {}, (), None, 0.5, 0.004, 2.0, 1.0)
    found = diagnosis(verdict="partly_explained", findings=(finding,), ended=ended)
    assert words.verdict_sentences(found)[0].endswith(f"{text}.")
