"""Pictures of the drive: right shape, right places, nothing cut off."""

from dataclasses import replace
from math import inf, nan

import numpy as np
import pytest

from flexdrive_gym.rendering import Renderer, canvas, style
from tests.each import each
from tests.rendering.frames import REST, STATES, cart, columns, picture, swing


class TestPicture:
    @each("size", [(960, 480), (640, 320), (1000, 700)])
    def test_has_the_shape_that_gymnasium_demands(self, size):
        array = picture(REST, size=size)
        assert array.shape == (size[1], size[0], 3)
        assert array.dtype == np.uint8
        assert array.flags["C_CONTIGUOUS"]
        assert array.flags["WRITEABLE"]

    @each(
        "change",
        [
            {"x1": 3.0},
            {"x2": 3.0},
            {"xr": 3.0},
            {"u": 0.3},
            {"t": 0.1},
            {"title": "other"},
            {"travel_limit": 300.0},
            {"voltage_limit": 9.0},
        ],
        ids=str,
    )
    def test_every_quantity_shows(self, change):
        assert not np.array_equal(picture(REST), picture(replace(REST, **change)))

    def test_is_deterministic(self):
        frames = swing(50)
        np.testing.assert_array_equal(picture(*frames), picture(*frames))

    def test_is_not_changed_by_the_next_one(self):
        renderer = Renderer("rgb_array")
        renderer.add(REST)
        first = renderer.render()
        kept = first.copy()
        renderer.add(replace(REST, t=1.0, x1=100.0))
        renderer.render()
        np.testing.assert_array_equal(first, kept)

    @each("frame", STATES.values(), ids=STATES)
    @each("size", [(960, 480), (640, 320)])
    def test_nothing_touches_the_border(self, frame, size):
        array = picture(*swing(20), replace(frame, t=1.0), size=size)
        inner = array[4:-4, 4:-4]
        assert (array == 255).sum() - (inner == 255).sum() == array.size - inner.size
        assert (inner != 255).any()

    def test_carts_move_with_their_positions_in_true_scale(self):
        places = np.array([cart(picture(replace(REST, x1=x, x2=x)), 1) for x in (-400.0, -200.0, 0.0, 200.0, 400.0)])
        steps = np.diff(places[:, 0])
        assert np.all(steps > 0)
        assert np.ptp(steps) <= 2
        places_2 = np.array([cart(picture(replace(REST, x1=x, x2=x)), 2) for x in (-400.0, 0.0, 400.0)])
        # both carts have the same scale, so the gap of a spring at rest is the same everywhere
        assert np.ptp(places_2[:, 0] - places[::2, 1]) <= 1

    def test_spring_is_as_long_as_the_carts_are_apart(self):
        def spring(stretch):
            array = picture(replace(REST, x2=stretch))
            length = cart(array, 2)[0] - cart(array, 1)[1]
            drawn = columns(array, style.SPRING, 111)
            between = drawn[(drawn > cart(array, 1)[1]) & (drawn < cart(array, 2)[0])]
            return length, int(np.ptp(between))

        lengths = [spring(s) for s in (-60.0, 0.0, 60.0)]
        assert 0 < lengths[0][0] < lengths[1][0] < lengths[2][0]
        assert 0 < lengths[0][1] < lengths[1][1] < lengths[2][1]

    def test_carts_that_meet_have_no_spring_between(self):
        assert picture(replace(REST, x1=100.0, x2=-100.0)).shape == (480, 960, 3)

    def test_reference_marks_where_cart_2_should_be(self):
        array = picture(replace(REST, x2=100.0, xr=100.0))
        marker = columns(array, style.REFERENCE, 67)
        assert np.mean(marker) == pytest.approx(np.mean(cart(array, 2)), abs=1.5)
        assert not columns(picture(replace(REST, xr=nan)), style.REFERENCE, 67).size

    def test_stops_are_where_carts_at_their_limits_touch_them(self):
        array = picture(replace(REST, x1=-400.0, x2=400.0))
        red = columns(array, style.LIMIT, 97)
        assert red.size
        left, right = cart(array, 1)[0], cart(array, 2)[1]
        assert 0 < left - red[red < 480].max() <= 2
        assert 0 < red[red > 480].min() - right <= 2
        assert not columns(picture(replace(REST, travel_limit=inf)), style.LIMIT, 97).size

    def test_a_limit_that_comes_near_is_in_the_chart(self):
        def red_rows(frame):
            array = picture(frame)[:, :750]  # left of the legend
            return [row for row in range(215, 450) if columns(array, style.LIMIT, row).size > 100]

        assert not red_rows(REST)
        assert len(red_rows(replace(REST, u=7.0))) == 2  # + and - voltage limit
        assert len(red_rows(replace(REST, x2=300.0))) == 1

    def test_one_rigid_cart_has_no_second(self):
        array = picture(replace(REST, x2=nan))
        assert not columns(array, style.CART[2], 97).size
        assert np.mean(cart(array, 1)) == pytest.approx(480.0, abs=2.0)

    def test_colours_are_those_of_the_figures(self):
        from identification.plots import style as figures

        assert figures.CART == style.CART
        assert (figures.COMMAND, figures.REFERENCE) == (style.COMMAND, style.REFERENCE)

    def test_survives_another_user_of_pygame_shutting_it_down(self):
        import pygame

        renderer = Renderer("rgb_array")
        renderer.add(REST)
        before = renderer.render()
        pygame.quit()
        np.testing.assert_array_equal(renderer.render(), before)

    def test_without_any_listed_font_the_text_still_fits(self, monkeypatch):
        monkeypatch.setattr(canvas, "_typeface", lambda: None)
        array = picture(*swing(900), replace(STATES["left limit"], t=9.0))
        assert (array[:, -4:] == 255).all()
