"""The window: the same picture, at the drive's pace, which its user may close."""

import numpy as np
import pytest

from flexdrive_gym.rendering import Renderer
from tests.rendering.frames import REST, picture


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
