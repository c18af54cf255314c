"""What is drawn, and where things are in a picture."""

from dataclasses import replace
from math import inf, nan

import numpy as np

from flexdrive_gym.rendering import Frame, Renderer, style

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
