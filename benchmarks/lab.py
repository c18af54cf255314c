"""``python -m benchmarks lab``: from slider to new motion on the screen, and the pictures of docs/lab.md.

A headless Chromium opens the page of a server of its own and moves the slider; the time runs from the key press to the frame in
which the new run is drawn. With ``--pictures`` it writes docs/lab.png instead.
"""

from __future__ import annotations

import asyncio
import io
import os
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path

import numpy as np

from benchmarks.browser import Browser, chromium

PICTURE = Path(__file__).parents[1] / "docs" / "lab.png"
MOVING = PICTURE.with_suffix(".gif")
# two seconds of the rig, a period of the handout's trajectory
_FRAMES, _FRAME_S = 32, 0.0625
_TRIALS = 40
_LATENCY = """new Promise((done) => {
  const rig = document.querySelector('.lab-rig'), slider = document.querySelector('.lab-gain .q-slider__track-container');
  slider.focus();
  const before = rig.dataset.number, begin = performance.now();
  slider.dispatchEvent(new KeyboardEvent('keydown', {key: 'ArrowRight', keyCode: 39, bubbles: true}));
  const look = () => rig.dataset.number !== before ? done(performance.now() - begin) : requestAnimationFrame(look);
  requestAnimationFrame(look);
  setTimeout(() => done(-1), 5000);
})"""


@asynccontextmanager
async def served(*arguments: str, seconds: float = 240.0) -> AsyncIterator[str]:
    """Serve the lab on a free port; yield its address."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    # a server that a test starts is a server like any other
    environment = {k: v for k, v in os.environ.items() if not k.startswith("PYTEST")} | {"OPENBLAS_NUM_THREADS": "1"}
    process = subprocess.Popen(  # noqa: ASYNC220  (starts and returns)
        [sys.executable, "-m", "baselines.cli", "lab", "--no-browser", "--port", str(port), *arguments],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True,
        env=environment,
    )  # fmt: skip
    address = f"http://127.0.0.1:{port}"
    try:
        await asyncio.to_thread(_wait, address, process, seconds)
        yield address
    finally:
        process.send_signal(signal.SIGINT)
        with suppress(subprocess.TimeoutExpired):
            process.wait(10)
        if process.poll() is None:
            process.kill()
            process.wait()


def _wait(address: str, process: subprocess.Popen[bytes], seconds: float) -> None:
    end = time.monotonic() + seconds
    while time.monotonic() < end and process.poll() is None:
        with suppress(OSError):
            if urllib.request.urlopen(f"{address}/healthz", timeout=5).status == 200:  # noqa: S310  (our own address)
                return
        time.sleep(0.2)
    raise TimeoutError(f"{address}/healthz did not answer within {seconds:g} s")


async def latency(trials: int = _TRIALS) -> np.ndarray:
    """Return the times from slider to new motion [ms], ndarray, shape (trials,)."""
    async with served() as address, Browser() as browser:
        await browser.open(address)
        await browser.until("document.querySelector('.lab-rig')?.dataset.number")
        await asyncio.sleep(2.0)
        times = []
        for _ in range(trials + 3):
            times.append(await browser.run(_LATENCY))
            await asyncio.sleep(0.25)
    return np.array(times[3:])


async def pictures(target: Path = PICTURE, moving: Path = MOVING) -> None:
    """Write the pictures of docs/lab.md and README.md: a gain that only friction holds, still and moving."""
    async with served() as address, Browser(1400, 1180) as browser:
        await browser.open(f"{address}/?gain=0.24")
        await browser.until("document.querySelector('.lab-rig')?.dataset.number")
        await asyncio.sleep(4.5)
        await browser.screenshot(target)
        await browser.resize(1100, 880)
        await browser.run("document.querySelector('.lab-play').click()")
        frames = []
        for i in range(_FRAMES):
            await browser.run(
                "(() => { const s = document.querySelector('.lab-scrub');"
                f" s.value = {2.0 + i * _FRAME_S}; s.dispatchEvent(new Event('input')); }})()"
            )
            frames.append(await browser.picture(".lab-left"))
    _animate(frames, moving)
    print(f"wrote {target} and {moving}")


def _animate(frames: list[bytes], target: Path) -> None:
    from PIL import Image

    images = [Image.open(io.BytesIO(frame)).convert("RGB").quantize(48) for frame in frames]
    images[0].save(
        target, save_all=True, append_images=images[1:], duration=round(1000 * _FRAME_S), loop=0, optimize=True
    )


def main() -> None:
    """Measure, or draw."""
    if chromium() is None:
        print("lab: no chromium here; apt-get install chromium")
        return
    if "--pictures" in sys.argv:
        asyncio.run(pictures())
        return
    times = asyncio.run(latency())
    middle, most = (float(np.quantile(times, q)) for q in (0.5, 0.95))
    print(f"slider to new motion: median {middle:.0f} ms, 95 % below {most:.0f} ms, {len(times)} times")


if __name__ == "__main__":
    main()
