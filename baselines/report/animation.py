"""A run as a moving picture: the environment's own frames, as a GIF small enough to be embedded."""

from __future__ import annotations

import io

import numpy as np

from flexdrive_gym.recording import FloatArray
from flexdrive_gym.rendering import Frame, Renderer
from flexdrive_gym.units import LAB, Units

SIZE = (640, 320)
FPS = 10.0
_COLOURS = 32


def animated(
    t: FloatArray, xr: FloatArray, run: FloatArray, title: str, voltage_limit: float, units: Units = LAB
) -> bytes:
    """Return a run as a GIF that repeats, in the pace of the run.

    Parameters
    ----------
    t, xr : ndarray, shape (n,)
        Instants [s] and reference [mm].
    run : ndarray, shape (5, n)
        x1, v1, x2, v2, u.
    title
        On top of the picture.
    voltage_limit
        Of the command [V].
    units
        The rig's, in which it is drawn; what is given is the engine's.

    Raises
    ------
    ModuleNotFoundError
        If pygame is not installed (extra ``render``).
    """
    from PIL import Image  # noqa: PLC0415  (comes with matplotlib, which the pages need)

    renderer = Renderer("rgb_array", history_s=float(t[-1] - t[0]), size=SIZE)
    every = max(1, round(1.0 / FPS / float(t[1] - t[0])))
    pictures = []
    for i in range(len(t)):
        x1, _v1, x2, _v2, u = (float(v) for v in run[:, i])
        renderer.add(Frame(float(t[i]), x1, x2, float(xr[i]), u, voltage_limit=voltage_limit, title=title, units=units))
        if i % every == 0:
            pictures.append(Image.fromarray(np.asarray(renderer.render())))
    renderer.close()
    # one palette for all pictures, from the fullest: colours then stand still, and only what moves is stored
    palette = pictures[-1].quantize(_COLOURS, dither=Image.Dither.NONE)
    first, *rest = [p.quantize(palette=palette, dither=Image.Dither.NONE) for p in pictures]
    stream = io.BytesIO()
    first.save(
        stream,
        "GIF",
        save_all=True,
        append_images=rest,
        duration=round(1000.0 / FPS),
        loop=0,
        optimize=True,
        disposal=1,
    )
    return stream.getvalue()
