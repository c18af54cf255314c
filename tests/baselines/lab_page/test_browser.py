"""The whole page in a real Chromium, headless, every host but loopback unreachable."""

import asyncio

import pytest

pytest.importorskip("nicegui", reason="the lab's page needs NiceGUI: pip install 'flexdrive[lab]'")

from baselines.lab_page import texts
from baselines.loop_analysis.stability_limit import critical_gain
from benchmarks.browser import Browser, chromium
from benchmarks.lab import served
from flexdrive_gym import DEFAULT_DRIVE

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(chromium() is None, reason="no chromium here: apt-get install chromium"),
    # the test drives asynchronous sockets of its own; what they leave to the collector is not the project's
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
]

LEVEL = "document.querySelector('.lab-lamp').dataset.level"
READY = "document.querySelector('.lab-rig')?.dataset.number"


async def rig_and_lamp(browser, address):
    critical = critical_gain(DEFAULT_DRIVE)
    await browser.open(f"{address}/?gain={0.99 * critical:.6g}")
    await browser.until(READY)
    await browser.until(f"{LEVEL} === 'held'")
    calm = float(await browser.run("document.querySelector('.lab-rig').dataset.peak"))
    await browser.run("document.querySelector('.lab-gain .q-slider__track-container').focus()")
    for _ in range(3):  # three steps of 1.16 % each
        for kind in ("keyDown", "keyUp"):
            await browser.call(
                "Input.dispatchKeyEvent", type=kind, key="ArrowRight", code="ArrowRight", windowsVirtualKeyCode=39
            )
    await browser.until(f"{LEVEL} === 'unstable'")
    assert float(await browser.run("document.querySelector('.lab-rig').dataset.peak")) > calm
    assert "gain=0.2" in await browser.run("location.search")


async def upload(browser, folder, bad):
    await browser.click(texts.TAB_RECORDINGS)
    await browser.until("document.querySelector('.lab-drop input[type=file]') !== null")
    await browser.files(".lab-drop input[type=file]", [str(bad)])
    await browser.until("document.body.innerText.includes('broken.csv')")
    await browser.files(".lab-drop input[type=file]", [str(p) for p in folder])
    await browser.until(f"document.body.innerText.includes('{len(folder)} recordings')")
    await browser.click(texts.IDENTIFY)
    await browser.until(f"document.body.innerText.includes({texts.IDENTIFIED!r})", 120.0)
    await browser.until("[...document.querySelectorAll('td')].some((e) => e.innerText === 'k')")


async def exercise(browser):
    await browser.click(texts.TAB_EXERCISE)
    await browser.click(texts.NEW_RIG)
    await browser.click(texts.RUN_EXPERIMENT)
    await browser.until("document.body.innerText.includes('1 recordings of this rig')", 120.0)
    guess = (
        f"[...document.querySelectorAll('input')].find((e) => e.ariaLabel === {texts.YOUR_GUESS!r} && e.offsetParent)"
    )
    await browser.run(f"{guess}.click()")
    await browser.click(texts.GUESS_NOTHING)
    await browser.click(texts.GUESS)
    await browser.click(texts.ASK_DIAGNOSIS)  # offered once the truth is shown
    await browser.until("document.body.innerText.includes('a diagnosis tells physics')", 120.0)


def test_rig_upload_and_exercise_in_a_browser(tmp_path, shared_recordings):
    found = sorted((shared_recordings / "mte360_2022").glob("*.csv*"))
    folder = [p for p in found if "square" in p.name or "sine" in p.name][:6]
    if len(folder) < 4:
        pytest.skip("no recordings of mte360_2022 here")
    bad = tmp_path / "broken.csv"
    bad.write_text("this is,no recording\n1\n")

    async def story():
        async with served() as address, Browser() as browser:
            await rig_and_lamp(browser, address)
            await upload(browser, folder, bad)
            await exercise(browser)
            hosts = {url.split("/")[2] for url in browser.requests if url.startswith("http")}
            assert hosts == {address.removeprefix("http://")}
            assert not browser.errors

    asyncio.run(story())
