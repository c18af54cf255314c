"""A headless Chromium over its DevTools protocol: what tests and screenshots of the lab need, and no more."""

from __future__ import annotations

import asyncio
import base64
import json
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

import aiohttp

_QUIET = """--headless=new --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking
--disable-component-update --disable-sync --disable-default-apps --mute-audio --hide-scrollbars --disable-dev-shm-usage
--remote-debugging-port=0""".split()  # noqa: SIM905
# no name but loopback's is resolved, so that a page that asks elsewhere fails
_LOOPBACK_ALONE = "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1, EXCLUDE localhost"


def chromium() -> str | None:
    """Return the browser's command, or None where there is none."""
    return next((p for n in ("chromium", "chromium-browser", "google-chrome") if (p := shutil.which(n))), None)


class Browser:
    """One page. Use it as an asynchronous context manager."""

    def __init__(self, width: int = 1200, height: int = 900, dark: bool = False) -> None:
        self.size, self.dark = (width, height), dark
        self.errors: list[str] = []
        self.requests: list[str] = []

    async def __aenter__(self) -> Self:
        command = chromium()
        assert command is not None, "no chromium here"
        self._folder = tempfile.mkdtemp(prefix="lab-browser-")
        self._process = subprocess.Popen(  # noqa: ASYNC220  (starts and returns)
            [command, *_QUIET, _LOOPBACK_ALONE, f"--user-data-dir={self._folder}", "about:blank"],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        port_file = Path(self._folder) / "DevToolsActivePort"
        for _ in range(600):
            if port_file.is_file() and len(port_file.read_text().splitlines()) > 1:
                break
            await asyncio.sleep(0.1)
        port = port_file.read_text().splitlines()[0]
        self._http = aiohttp.ClientSession()
        async with self._http.get(f"http://127.0.0.1:{port}/json") as answer:
            target = next(t for t in await answer.json(content_type=None) if t["type"] == "page")
        self._socket = await self._http.ws_connect(target["webSocketDebuggerUrl"], max_msg_size=0)
        self._next, self._waiting = 0, {}
        self._reader = asyncio.create_task(self._listen())
        for domain in ("Page", "Runtime", "Network", "Log"):
            await self.call(f"{domain}.enable")
        await self.resize(*self.size)
        scheme = "dark" if self.dark else "light"
        await self.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
        return self

    async def __aexit__(self, *_: object) -> None:
        self._reader.cancel()
        await self._socket.close()
        await self._http.close()
        self._process.send_signal(signal.SIGTERM)
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(10)
        if self._process.poll() is None:
            self._process.kill()
            self._process.wait()
        shutil.rmtree(self._folder, ignore_errors=True)

    async def _listen(self) -> None:
        async for message in self._socket:
            told: Mapping[str, Any] = json.loads(message.data)
            if "id" in told:
                waiting = self._waiting.pop(told["id"], None)
                if waiting is not None and not waiting.done():
                    waiting.set_result(told)
            elif told["method"] == "Runtime.exceptionThrown":
                details = told["params"]["exceptionDetails"]
                self.errors.append(details.get("exception", {}).get("description", details["text"]))
            elif told["method"] == "Log.entryAdded" and told["params"]["entry"]["level"] == "error":
                entry = told["params"]["entry"]
                self.errors.append(f"{entry['text']} {entry.get('url', '')}")
            elif told["method"] == "Network.requestWillBeSent":
                self.requests.append(told["params"]["request"]["url"])

    async def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Call one method of the protocol."""
        self._next += 1
        number, answer = self._next, asyncio.get_running_loop().create_future()
        self._waiting[number] = answer
        await self._socket.send_json({"id": number, "method": method, "params": parameters})
        told = await asyncio.wait_for(answer, 60)
        if "error" in told:
            raise RuntimeError(f"{method}: {told['error']}")
        return told["result"]

    async def resize(self, width: int, height: int) -> None:
        await self.call(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False
        )

    async def open(self, address: str) -> None:
        await self.call("Page.navigate", url=address)

    async def run(self, script: str) -> Any:
        """Return what an expression is in the page; a promise is awaited."""
        told = await self.call("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in told:
            raise RuntimeError(str(told["exceptionDetails"])[:500])
        return told["result"].get("value")

    async def until(self, script: str, seconds: float = 30.0) -> Any:
        """Wait until an expression is true; return it."""
        loop = asyncio.get_running_loop()
        end = loop.time() + seconds
        while loop.time() < end:
            with suppress(RuntimeError):
                found = await self.run(script)
                if found:
                    return found
            await asyncio.sleep(0.1)
        raise TimeoutError(f"not true within {seconds:g} s: {script}; errors: {self.errors}")

    async def click(self, words: str) -> None:
        """Click the first visible thing that says so."""
        await self.until(_FIND.format(words=json.dumps(words)) + " !== null")
        await self.run(_FIND.format(words=json.dumps(words)) + ".click()")

    async def files(self, selector: str, paths: list[str]) -> None:
        """Give files to an input."""
        root = await self.call("DOM.getDocument")
        node = await self.call("DOM.querySelector", nodeId=root["root"]["nodeId"], selector=selector)
        await self.call("DOM.setFileInputFiles", files=paths, nodeId=node["nodeId"])

    async def picture(self, selector: str) -> bytes:
        """Return a PNG of one element."""
        box = await self.run(
            f"(() => {{ const b = document.querySelector({selector!r}).getBoundingClientRect();"
            " return {x: b.x, y: b.y, width: b.width, height: b.height, scale: 1}; })()"
        )
        told = await self.call("Page.captureScreenshot", format="png", clip=box)
        return base64.b64decode(told["data"])

    async def screenshot(self, path: Path) -> None:
        told = await self.call("Page.captureScreenshot", format="png")
        path.write_bytes(  # noqa: ASYNC240  (a benchmark)
            base64.b64decode(told["data"])
        )


_FIND = """([...document.querySelectorAll('button, .q-tab, .q-item, [role=switch], .q-toggle, a')]
  .filter((e) => e.offsetParent !== null && (e.innerText || e.ariaLabel || '').trim().startsWith({words}))
  .sort((a, b) => a.innerText.length - b.innerText.length)[0] || null)"""
