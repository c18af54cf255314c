"""Serving the page: routes, what is refused at the door, and the run of the server."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, MutableMapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from nicegui import app, ui
from starlette.requests import ClientDisconnect, Request
from starlette.responses import FileResponse, PlainTextResponse, Response

from baselines.lab_page import texts
from baselines.lab_page.page import build_page
from baselines.lab_page.session import SESSIONS, Lab, close_all
from baselines.lab_page.uploads import RefusedError, take

LOOPBACK = "127.0.0.1"
LOOPBACK_NAMES = (LOOPBACK, "localhost")
LARGEST_REQUEST_BYTES = 68_000_000
_STYLE = (Path(__file__).parent / "static" / "lab.css").read_text(encoding="utf-8")
# a browser may load and call nothing but this server
_POLICY = (
    "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data: blob:; font-src 'self' data:; connect-src 'self' ws: wss:; frame-ancestors 'self'; base-uri 'self'"
)

_Scope = MutableMapping[str, Any]
_Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
_Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
_App = Callable[[_Scope, _Receive, _Send], Awaitable[None]]


class Door:
    """Refuses what no browser of this machine asks for: other hosts' names, other sites' pages, endless bodies.

    Parameters
    ----------
    app
        What stands behind it.
    names
        Host names that the server answers to; empty: any.
    largest
        Of a request's body [bytes].
    """

    def __init__(self, app: _App, names: Sequence[str] = (), largest: int = LARGEST_REQUEST_BYTES) -> None:
        self._app, self._names, self._largest = app, set(names), largest

    async def __call__(self, scope: _Scope, receive: _Receive, send: _Send) -> None:
        """Pass a request on, or refuse it with a sentence."""
        if scope["type"] not in {"http", "websocket"}:
            await self._app(scope, receive, send)
            return
        headers = {k.decode("latin-1").lower(): v.decode("latin-1") for k, v in scope["headers"]}
        refusal = self._refusal(headers)
        if refusal is not None:
            if scope["type"] == "websocket":
                await send({"type": "websocket.close", "code": 1008})
                return
            await PlainTextResponse(refusal[1] + "\n", refusal[0])(scope, receive, send)
            return
        taken = 0

        async def bounded() -> MutableMapping[str, Any]:
            nonlocal taken
            message = await receive()
            taken += len(message.get("body", b"") or b"")
            if taken > self._largest:
                return {"type": "http.disconnect"}
            return message

        async def guarded(message: MutableMapping[str, Any]) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [
                    *message.get("headers", []),
                    (b"content-security-policy", _POLICY.encode()),
                    (b"x-content-type-options", b"nosniff"),
                    (b"referrer-policy", b"no-referrer"),
                ]
            await send(message)

        if scope["type"] == "websocket":
            await self._app(scope, receive, send)
        else:
            await self._app(scope, bounded, guarded)

    def _refusal(self, headers: dict[str, str]) -> tuple[int, str] | None:
        host = headers.get("host", "")
        name = urlsplit(f"//{host}").hostname or ""
        if self._names and name not in self._names:
            return 400, f"host: this server answers to {', '.join(sorted(self._names))}; got {name[:80]!r}."
        origin = headers.get("origin")
        if origin is not None and origin != "null" and urlsplit(origin).netloc != host:
            return 403, "origin: another site's page may not use this server."
        length = headers.get("content-length", "0")
        if not length.isdigit() or int(length) > self._largest:
            return 413, f"body: at most {self._largest // 1_000_000} MB are taken."
        return None


async def _healthz(_request: Request) -> PlainTextResponse:
    return PlainTextResponse("ok\n")


async def _upload(request: Request) -> PlainTextResponse:
    """Take one file of a visitor's; a refusal is a sentence."""
    session = SESSIONS.get(request.path_params["token"])
    if session is None:
        return PlainTextResponse(texts.GONE, 404)
    folder = session.folder / "recordings"
    folder.mkdir(exist_ok=True)
    try:
        await take(folder, request.query_params.get("name", ""), request.stream())
    except RefusedError as refusal:
        return PlainTextResponse(str(refusal), 400)
    except (OSError, ClientDisconnect) as error:
        return PlainTextResponse(f"{error}", 400)
    return PlainTextResponse("ok\n")


async def _file(request: Request) -> Response:
    """Give a visitor one file of the visitor's own results."""
    session = SESSIONS.get(request.path_params["token"])
    if session is None:
        return PlainTextResponse(texts.GONE, 404)
    root = session.folder.resolve()
    path = (root / request.path_params["path"]).resolve()
    if not path.is_relative_to(root) or not path.is_file() or path.suffix not in {".html", ".json", ".toml", ".csv"}:
        return PlainTextResponse(texts.NO_FILE, 404)
    kind = "text/html" if path.suffix == ".html" else "text/plain"
    name = path.name if "download" in request.query_params or kind == "text/plain" else None
    # what is in a report came from files: it may show itself and reach nothing
    return FileResponse(
        path,
        media_type=kind,
        filename=name,
        headers={"content-security-policy": "sandbox allow-scripts allow-downloads"},
    )


def install(lab: Lab, names: Sequence[str] = ()) -> Callable[[], None]:
    """Put routes and the door into NiceGUI's app; return the root that builds a visitor's page.

    Parameters
    ----------
    lab
        What the command line gave.
    names
        Host names that the server answers to; empty: any.
    """
    app.add_route("/healthz", _healthz, methods=["GET"])
    app.add_route("/upload/{token}", _upload, methods=["POST"])
    app.add_route("/file/{token}/{path:path}", _file, methods=["GET"])
    app.add_middleware(Door, names=names)
    app.on_shutdown(close_all)

    def root() -> None:
        ui.add_css(_STYLE)
        build_page(lab)

    return root


def serve(lab: Lab, *, host: str = LOOPBACK, port: int = 8080, browser: bool = True) -> None:
    """Serve the page until interrupted.

    Parameters
    ----------
    lab
        What the command line gave.
    host
        Address to listen on; anything but loopback lets others in, and is the visitor's own decision.
    port
        TCP port.
    browser
        Whether to open the page.
    """
    names = LOOPBACK_NAMES if host in LOOPBACK_NAMES else ()
    root = install(lab, names)
    ui.run(
        root, host=host, port=port, title=texts.TITLE, show=browser, reload=False, dark=None, tailwind=False,
        show_welcome_message=False, language="en-US", favicon=_FAVICON, reconnect_timeout=120.0,
    )  # fmt: skip


_FAVICON = """<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 32 32'>
<rect x='1' y='10' width='11' height='10' rx='2' fill='#1f6fb8'/>
<rect x='20' y='10' width='11' height='10' rx='2' fill='#c2541b'/>
<path d='M12 15l2-3 2 6 2-6 2 3' fill='none' stroke='#555' stroke-width='1.6'/></svg>"""
