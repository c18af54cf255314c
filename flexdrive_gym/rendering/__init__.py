"""Pictures of a running drive: a rail with two carts over a strip chart, as an array, a window or two lines of text."""

from flexdrive_gym.rendering.history import Frame
from flexdrive_gym.rendering.renderer import Mode, Renderer

__all__ = ["Frame", "Mode", "Renderer"]
