"""Pictures of the drive: right shape, right places, nothing cut off, no display needed."""

import copy
import pickle
import re
import subprocess
import sys
from dataclasses import replace
from math import inf, nan

import numpy as np
import pytest

from flexdrive_gym.rendering import Frame, Renderer, canvas, style
from flexdrive_gym.rendering.chart import command_range, position_range
from flexdrive_gym.rendering.history import MOST_SAMPLES, History
from flexdrive_gym.rendering.scale import Scale, round_out, round_step, text

REST = Frame(0.0, 0.0, 0.0, 0.0, 0.0, 400.0, 8.0, "P-control from x2")
STATES = {
    "rest": REST,
    "stretched": replace(REST, x2=40.0, xr=120.0, u=5.0),
    "compressed": replace(REST, x1=30.0, x2=-10.0, xr=-120.0, u=-8.0),
    "right limit": replace(REST, x1=380.0, x2=400.0, xr=400.0, u=8.0),
    "left limit": replace(REST, x1=-400.0, x2=-380.0, xr=-400.0, u=-8.0),
    "diverged": replace(REST, x1=-4e7, x2=3e12, xr=50.0, u=-1e9),
    "infinite": replace(REST, x1=np.float64(inf), x2=np.float64(inf), u=inf),
    "no limits": replace(REST, x1=30.0, travel_limit=inf, voltage_limit=inf),
    "rigid": replace(REST, x2=nan, xr=20.0),
    "open loop": replace(REST, xr=nan),
    "wordy": replace(REST, title="A title that no picture is wide enough for, " * 8),
}


def picture(*frames, size=(960, 480)):
    renderer = Renderer("rgb_array", size=size)
    for frame in frames:
        renderer.add(frame)
    return renderer.render()


def columns(array, colour, row):
    """Where a row of pixels has exactly a colour."""
    rgb = [int(colour[k : k + 2], 16) for k in (1, 3, 5)]
    return np.flatnonzero((array[row] == rgb).all(axis=1))


def cart(array, number):
    """First and last column of a cart, just below its roof and above its name."""
    found = columns(array, style.CART[number], 97)
    return int(found[0]), int(found[-1])


def swing(n=900, h=0.01):
    t = np.arange(n) * h
    return [Frame(a, 60 * np.sin(a), 60 * np.sin(a - 0.2), 60.0, 8 * np.cos(a), 400.0, 8.0) for a in t]


class TestPicture:
    @pytest.mark.parametrize("size", [(960, 480), (640, 320), (1000, 700)])
    def test_has_the_shape_that_gymnasium_demands(self, size):
        array = picture(REST, size=size)
        assert array.shape == (size[1], size[0], 3)
        assert array.dtype == np.uint8
        assert array.flags["C_CONTIGUOUS"]
        assert array.flags["WRITEABLE"]

    @pytest.mark.parametrize(
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

    @pytest.mark.parametrize("frame", STATES.values(), ids=STATES)
    @pytest.mark.parametrize("size", [(960, 480), (640, 320)])
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


class TestAnsi:
    @staticmethod
    def lines(frame):
        renderer = Renderer("ansi")
        renderer.add(frame)
        return renderer.render().split("\n")

    @pytest.mark.parametrize("frame", STATES.values(), ids=STATES)
    def test_is_two_lines_of_plain_characters(self, frame):
        rail, numbers = self.lines(frame)
        assert rail[0] == rail[-1] == "|"
        assert len(rail) == 79
        assert numbers.isascii()
        assert len(numbers) < 100

    def test_rest(self):
        rail, numbers = self.lines(replace(REST, xr=100.0))
        assert re.fullmatch(r"\|-+\[1]~{5}\[2]-+v-+\|", rail)
        assert numbers == "t = 0.000 s  x1 = 0.00 mm  x2 = 0.00 mm  xr = 100.00 mm  u = 0.00 V"

    def test_places_are_monotone_and_reach_both_ends(self):
        rails = [self.lines(replace(REST, x1=x, x2=x, xr=-x))[0] for x in np.linspace(-400.0, 400.0, 200)]
        for token in ("[1]", "[2]"):
            assert np.all(np.diff([rail.index(token[1]) for rail in rails]) >= 0)
        goals = [rail.index("v") for rail in rails if "v" in rail]
        assert len(goals) > 150
        assert np.all(np.diff(goals) <= 0)
        assert rails[0].startswith("|[1]")
        assert rails[-1].endswith("[2]|")

    def test_spring_stretches(self):
        counts = [self.lines(replace(REST, x2=x))[0].count("~") for x in (-30.0, 0.0, 60.0)]
        assert counts[0] < counts[1] < counts[2]

    def test_reference_at_cart_2_and_missing_channels(self):
        assert "v" not in self.lines(REST)[0]
        rail, numbers = self.lines(STATES["rigid"])
        assert "[2]" not in rail
        assert "~" not in rail
        assert "x2" not in numbers

    def test_needs_no_pygame(self, monkeypatch):
        monkeypatch.setitem(sys.modules, "pygame", None)
        assert self.lines(REST)


class TestWindow:
    @pytest.fixture(autouse=True)
    def dummy(self, monkeypatch):
        monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")

    @pytest.fixture
    def renderer(self):
        renderer = Renderer("human", fps=200.0)
        renderer.add(REST)
        yield renderer
        renderer.close()

    def test_shows_the_same_picture(self, renderer):
        import pygame

        assert renderer.render() is None
        shown = pygame.surfarray.array3d(pygame.display.get_surface()).transpose(1, 0, 2)
        np.testing.assert_array_equal(shown, picture(REST))

    def test_is_paced(self, renderer):
        import time

        renderer.render()
        begin = time.perf_counter()
        for _ in range(10):
            renderer.render()
        # a clock of whole milliseconds may be early by one per picture
        assert time.perf_counter() - begin >= 10 * (1.0 / 200.0 - 1e-3)

    def test_that_the_user_closes_stays_closed(self, renderer):
        import pygame

        renderer.render()
        assert not renderer.window_closed
        pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.K_LEFT))
        renderer.render()
        assert pygame.event.peek(pygame.KEYDOWN), "keys belong to whoever steers"
        pygame.event.post(pygame.event.Event(pygame.QUIT))
        renderer.render()
        assert renderer.window_closed
        assert not pygame.display.get_init()
        renderer.reset()
        renderer.add(REST)
        assert renderer.render() is None
        assert not pygame.display.get_init()

    def test_opens_again_after_close(self, renderer):
        import pygame

        renderer.render()
        renderer.close()
        renderer.close()
        assert not pygame.display.get_init()
        renderer.render()
        assert pygame.display.get_init()

    def test_survives_another_window_being_closed(self, renderer):
        other = Renderer("human", fps=200.0)
        other.add(REST)
        renderer.render()
        other.render()
        other.close()
        renderer.render()

    def test_without_display_says_what_to_do(self, renderer, monkeypatch):
        monkeypatch.setenv("SDL_VIDEODRIVER", "none-such")
        with pytest.raises(RuntimeError, match=r"render_mode: 'human' needs a display; got: .* Use 'rgb_array' or"):
            renderer.render()


class TestRenderer:
    def test_arrays_need_no_display_and_nothing_is_printed_or_imported_early(self):
        script = (
            "import os, sys; os.environ.pop('SDL_VIDEODRIVER', None); before = dict(os.environ)\n"
            "from flexdrive_gym.rendering import Frame, Renderer\n"
            "assert not {'pygame', 'PIL', 'matplotlib'} & set(sys.modules)\n"
            "r = Renderer('rgb_array'); r.add(Frame(0.0, 0.0, 0.0, 0.0, 0.0)); r.render()\n"
            "import pygame\n"
            "assert not pygame.display.get_init()\n"
            "assert before == dict(os.environ)\n"
        )
        done = subprocess.run(
            [sys.executable, "-W", "error", "-c", script], capture_output=True, text=True, check=False
        )
        assert (done.returncode, done.stdout, done.stderr) == (0, "", "")

    @pytest.mark.parametrize("mode", ["human", "rgb_array"])
    def test_missing_pygame_names_the_remedy(self, mode, monkeypatch):
        monkeypatch.setitem(sys.modules, "pygame", None)
        renderer = Renderer(mode)
        renderer.add(REST)
        with pytest.raises(
            ModuleNotFoundError, match=r"render_mode: .* not installed\. Install it with: pip install py"
        ):
            renderer.render()

    @pytest.mark.parametrize("mode", ["human", "rgb_array", "ansi"])
    def test_nothing_to_show(self, mode):
        renderer = Renderer(mode)
        renderer.add(REST)
        renderer.reset()
        with pytest.raises(RuntimeError, match=r"render: there is no frame to show yet\. Call reset\(\) of the env"):
            renderer.render()

    @pytest.mark.parametrize(
        ("arguments", "message"),
        [
            ({"mode": "rgb"}, "mode: must be one of human, rgb_array, ansi; got 'rgb'. Did you mean 'rgb_array'?"),
            ({"mode": "window"}, "mode: must be one of human, rgb_array, ansi; got 'window'."),
            ({"history_s": 0.0}, "history_s: must be positive and finite [s]; got 0."),
            ({"fps": -1.0}, "fps: must be positive and finite [pictures per second]; got -1."),
            ({"size": (200, 100)}, "size: must be at least 640 x 320 pixels to be legible; got (200, 100). Use 960 x"),
            ({"size": (960,)}, "size: must be at least 640 x 320 pixels to be legible; got (960,)."),
        ],
        ids=str,
    )
    def test_wrong_arguments(self, arguments, message):
        with pytest.raises(ValueError, match=re.escape(message)):
            Renderer(**{"mode": "ansi", **arguments})

    def test_reset_begins_a_new_chart(self):
        renderer = Renderer("rgb_array")
        for frame in swing(300):
            renderer.add(frame)
        renderer.render()
        renderer.reset()
        renderer.add(REST)
        np.testing.assert_array_equal(renderer.render(), picture(REST))

    @pytest.mark.parametrize("copied", [copy.deepcopy, lambda r: pickle.loads(pickle.dumps(r))])
    def test_can_be_copied_after_drawing(self, copied):
        renderer = Renderer("rgb_array")
        for frame in swing(30):
            renderer.add(frame)
        before = renderer.render()
        other = copied(renderer)
        np.testing.assert_array_equal(other.render(), before)
        other.add(replace(REST, t=1.0))
        other.render()
        np.testing.assert_array_equal(renderer.render(), before)


class TestHistory:
    def test_keeps_the_window_and_one_sample_more(self):
        history = History(2.0)
        for frame in swing(900, 0.01):
            history.add(frame)
        t = history.columns()[0]
        assert t[-1] == pytest.approx(8.99)
        assert t[0] <= 6.99 + 1e-9
        assert t[1] >= 6.99 - 1e-9

    def test_of_fast_samples_is_thinned_but_always_current(self):
        history = History(1.0)
        for k in range(30_000):
            history.add(replace(REST, t=k * 1e-4, x1=float(k)))
        t, x1 = history.columns()[:2]
        assert len(t) <= MOST_SAMPLES + 2
        assert np.all(np.diff(t) > 0.0)
        assert x1[-1] == 29_999.0

    def test_of_the_rig_s_own_millisecond_is_complete(self):
        history = History(4.0)
        for k in range(4000):
            history.add(replace(REST, t=k * 1e-3))
        assert history.columns().shape == (5, 4000)

    def test_restarts_when_time_runs_backwards(self):
        history = History(4.0)
        history.add(replace(REST, t=3.0, x1=300.0))
        history.add(replace(REST, t=0.0))
        assert history.columns().shape == (5, 1)
        assert history.highest == 0.0

    def test_extremes_last_and_ignore_what_is_no_number(self):
        history = History(1.0)
        for t, x in ((0.0, -70.0), (1.0, nan), (2.0, inf), (9.0, 30.0)):
            history.add(replace(REST, t=t, x1=x, u=x))
        assert (history.lowest, history.highest, history.largest_command) == (-70.0, 30.0, 70.0)


class TestAxes:
    @staticmethod
    def history(x, u=0.0):
        history = History(4.0)
        history.add(replace(REST, x1=x, u=u))
        return history

    @pytest.mark.parametrize("x", [0.0, 3.0, -47.0, 230.0, -399.0, 800.0])
    def test_position_axis_shows_zero_and_all_that_was_seen(self, x):
        low, high = position_range(self.history(x), 400.0)
        assert low < min(x, 0.0)
        assert high > max(x, 0.0)
        assert (high > 400.0) == (x > 240.0)
        assert (low < -400.0) == (x < -240.0)

    @pytest.mark.parametrize("u", [0.0, 1.0, -7.9, 8.0, 20.0])
    def test_command_axis_is_symmetric_and_shows_all(self, u):
        largest = command_range(self.history(0.0, u), 8.0)
        assert largest > abs(u)
        assert (largest > 8.0) == (abs(u) > 4.8)
        assert command_range(self.history(0.0, u), inf) > abs(u)

    @pytest.mark.parametrize(("least", "step"), [(1.0, 1.0), (1.1, 2.0), (0.3, 0.5), (0.07, 0.1), (600.0, 1000.0)])
    def test_steps_are_round(self, least, step):
        assert round_step(least) == pytest.approx(step)

    def test_ticks_lie_within_and_ranges_widen_outward(self):
        assert Scale(-1.0, 1.0, 0.0, 100.0).ticks(4) == [-1.0, -0.5, 0.0, 0.5, 1.0]
        low, high = round_out(-47.0, 13.0)
        assert (low, high) == (-60.0, 20.0)
        scale = Scale(-10.0, 30.0, 400.0, 200.0)
        assert (scale(-10.0), scale(30.0), scale(10.0)) == (400.0, 200.0, 300.0)

    @pytest.mark.parametrize(
        ("value", "digits", "written"),
        [
            (-1.234, 2, "−1.23"),
            (-0.001, 2, "0.00"),
            (0.5, None, "0.5"),
            (-0.0, None, "0"),
            (nan, 2, "–"),
            (1e300, 2, "1e+300"),
            (-inf, 1, "–"),
        ],
    )
    def test_numbers_as_text(self, value, digits, written):
        assert text(value, digits) == written
