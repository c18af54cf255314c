"""The example in docs/controllers.md runs and shows what the page says."""

from tests.docs.pages import printed, read

PAGE = read("docs/controllers.md")


def test_example_finds_the_same_margin_twice():
    analytic, by_trial = map(float, printed("docs/controllers.md").split())
    assert abs(by_trial / analytic - 1.0) < 0.02


def test_every_family_is_described():
    from baselines.controllers import FAMILIES

    assert all(f"`{name}`" in PAGE for name in FAMILIES)
