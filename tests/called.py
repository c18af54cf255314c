"""A controller of which nothing is known but that it can be called."""

from dataclasses import dataclass


@dataclass
class Called:
    """Hides what a controller is, so that it is called sample by sample."""

    inner: object

    def reset(self):
        self.inner.reset()

    def __call__(self, observation):
        return self.inner(observation)
