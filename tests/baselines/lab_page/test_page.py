"""The page without a browser: NiceGUI's simulated user, several of them on one server."""

import asyncio
import os
import warnings
from contextlib import asynccontextmanager

import httpx
import pytest

pytest.importorskip("nicegui", reason="the lab's page needs NiceGUI: pip install 'flexdrive[lab]'")

from nicegui import app, core, ui
from nicegui.testing.general import nicegui_reset_globals, prepare_simulation
from nicegui.testing.user import User

from baselines.lab.sample import FOLDER
from baselines.lab_page import texts
from baselines.lab_page.elements import Drop, Plot, RigView
from baselines.lab_page.exercise import NOTHING
from baselines.lab_page.server import Door, install
from baselines.lab_page.session import SESSIONS, Lab


@asynccontextmanager
async def lab(users=1, given=None):
    """Serve the lab to simulated users."""
    with nicegui_reset_globals():
        os.environ["NICEGUI_USER_SIMULATION"] = "true"
        try:
            prepare_simulation()
            ui.run(install(given or Lab()), storage_secret="of a test")
            async with core.app.router.lifespan_context(core.app):
                clients = [
                    httpx.AsyncClient(transport=httpx.ASGITransport(core.app), base_url="http://127.0.0.1")
                    for _ in range(users)
                ]
                yield [User(client) for client in clients]
                for client in clients:
                    await client.aclose()
        finally:
            os.environ.pop("NICEGUI_USER_SIMULATION", None)


def element(user, kind):
    with user:
        return next(e for e in user.client.elements.values() if isinstance(e, kind))


def labelled(user, kind, words):
    return next(
        e
        for e in user.client.elements.values()
        if isinstance(e, kind) and words in (e.props.get("label"), e.props.get("aria-label"))
    )


async def until(truth, seconds=20.0):
    for _ in range(round(seconds / 0.05)):
        if truth():
            return
        await asyncio.sleep(0.05)
    raise AssertionError("it never came to be")


def peak(user):
    motions = element(user, RigView).motions
    return max(abs(motions[0].x2)) if motions else 0.0


def test_the_page_shows_the_rig_and_the_slider_moves_motion_and_lamp():
    async def story():
        async with lab() as (user,):
            await user.open("/")
            await user.should_see(texts.TITLE)
            await until(lambda: peak(user) > 0.0)
            await user.should_see(texts.LAMP_WORDS["stable"])
            calm = peak(user)
            slider = labelled(user, ui.slider, texts.GAIN)
            slider.value = -0.5  # 10^-0.5 = 0.316 V/mm, above the rig's 0.262
            await until(lambda: peak(user) > calm + 20.0)
            await user.should_see(texts.LAMP_WORDS["unstable"], retries=20)
            plots = [e for e in user.client.elements.values() if isinstance(e, Plot) and e.chart is not None]
            assert {texts.ROOT_LOCUS, texts.NYQUIST, texts.BODE_GAIN} <= {p.chart.title for p in plots}

    asyncio.run(story())


def test_two_visitors_do_not_see_each_other_and_an_address_holds_the_state():
    async def story():
        async with lab(2) as (one, other):
            await one.open("/?gain=0.3&pushes=1")
            await other.open("/?controller=sine&amplitude=2.5&frequency=1&effect=coupling_backlash.g:0.5&beside=plain")
            await until(lambda: peak(one) > 0.0 and peak(other) > 0.0)
            assert element(one, RigView).motions[0].xr is not None
            assert element(other, RigView).motions[0].xr is None
            assert len(element(one, RigView).motions) == 1
            with_effect, without = element(other, RigView).motions
            # the play of ±0.5 mm shows far above an encoder count of 0.005 mm
            assert max(abs(with_effect.x2 - without.x2)) > 0.1
            before = peak(other)
            with one:
                labelled(one, ui.slider, texts.GAIN).value = -2.0
            await until(lambda: peak(one) < 45.0)
            assert peak(other) == before

    asyncio.run(story())


def test_health_and_what_the_door_refuses():
    async def story():
        async with lab() as (user,):
            get = user.http_client.get
            answer = await get("/healthz")
            assert (answer.status_code, answer.text) == (200, "ok\n")
            assert "connect-src 'self'" in answer.headers["content-security-policy"]
            strange = await get("/healthz", headers={"Origin": "http://elsewhere.example"})
            assert (strange.status_code, strange.text) == (
                403,
                "origin: another site's page may not use this server.\n",
            )
            large = await get("/healthz", headers={"Content-Length": "999999999"})
            assert large.status_code == 413
        door = Door(app, names=("127.0.0.1",))
        async with httpx.AsyncClient(transport=httpx.ASGITransport(door), base_url="http://rebound.example") as client:
            assert (await client.get("/healthz")).status_code == 400

    asyncio.run(story())


def test_a_wrong_address_gets_its_sentence():
    async def story():
        async with lab() as (user,):
            await user.open("/?gain=1e9&drive=none")
            await until(lambda: bool(user.notify.messages))
            assert "gain: must lie in" in user.notify.messages[0]
            await until(lambda: peak(user) > 0.0)

    asyncio.run(story())


def test_uploads_are_a_visitors_own_and_a_broken_file_gets_its_sentence():
    async def story():
        async with lab(2) as (one, other):
            await one.open("/")
            await other.open("/")
            address = element(one, Drop).props["url"]
            assert address != element(other, Drop).props["url"]
            post = one.http_client.post
            good = (FOLDER / "square_1.5V_0.5Hz_a.csv.gz").read_bytes()
            assert (await post(f"{address}?name=day/a.csv.gz", content=good)).status_code == 200
            assert (await post(f"{address}?name=broken.csv", content=b"no,recording\n1\n")).status_code == 200
            refused = await post(f"{address}?name=../evil.csv", content=b"1")
            assert refused.status_code == 400
            wrong = await post(f"{address}?name=run.py", content=b"1")
            assert (wrong.status_code, "is no recording" in wrong.text) == (400, True)
            assert (await post("/upload/nobody?name=a.csv", content=b"1")).status_code == 404
            with one:
                element(one, Drop)._handle_event({"listener_id": _listener(one), "args": {"refused": [wrong.text]}})
            listed = "".join
            await until(lambda: "1 recording read; 1 file left out" in listed(htmls(one)))
            assert "broken.csv" in listed(htmls(one))
            assert "square ±1.5 V, 0.5 Hz" in listed(htmls(one))
            assert "broken.csv" not in listed(htmls(other))
            token = address.rsplit("/", 1)[1]
            folder = SESSIONS[token].folder
            get = one.http_client.get
            assert (await get(f"/file/{token}/recordings/day/a.csv.gz")).status_code == 404  # no result
            assert (await get(f"/file/{token}/..%2f..%2f..%2fetc/hostname")).status_code == 404
        assert not folder.exists()  # the server has ended

    asyncio.run(story())


def htmls(user):
    return [e.content for e in user.client.elements.values() if isinstance(e, ui.html)]


def _listener(user):
    return next(iter(element(user, Drop)._event_listeners))


def test_the_exercise_without_a_browser():
    async def story():
        async with lab(given=Lab(exercise=True)) as (user,):
            await user.open("/")
            with user:
                user.find(texts.NEW_RIG).click()
            await user.should_see(texts.RUN_EXPERIMENT, retries=40)
            user.find(texts.RUN_EXPERIMENT).click()
            await user.should_see(texts.RUNS_DONE.format(count=1), retries=200)
            with user:
                labelled(user, ui.select, texts.YOUR_GUESS).value = NOTHING
            user.find(texts.GUESS).click()
            await user.should_see(texts.ASK_DIAGNOSIS, retries=40)

    asyncio.run(story())


def test_importing_raises_no_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        __import__("baselines.lab_page.server")
