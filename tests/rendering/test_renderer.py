"""The renderer: no display needed, clear errors, a chart per episode, copies."""

import copy
import pickle
import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from flexdrive_gym.rendering import Renderer
from tests.each import each
from tests.rendering.frames import REST, picture, swing


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

    @each("mode", ["human", "rgb_array", "ansi"])
    def test_nothing_to_show(self, mode):
        renderer = Renderer(mode)
        renderer.add(REST)
        renderer.reset()
        with pytest.raises(RuntimeError, match=r"render: there is no frame to show yet\. Call reset\(\) of the env"):
            renderer.render()

    @each(
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
