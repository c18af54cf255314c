"""``flexdrive lab``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from baselines.cli._output import Json, print_json, say
from baselines.cli._reading import Only, RigFile, Skip, Strict


def lab(
    shown: Annotated[
        list[Path] | None,
        typer.Argument(
            exists=True, help="Drives (.toml), or recordings: a folder or files.", metavar="[DRIVE|RECORDINGS]..."
        ),
    ] = None,
    rig: RigFile = None,
    strict: Strict = False,
    only: Only = None,
    skip: Skip = None,
    port: Annotated[int, typer.Option(min=1, max=65535, help="TCP port.")] = 8080,
    host: Annotated[
        str, typer.Option(help="Address to listen on; anything but 127.0.0.1 lets other machines in.")
    ] = "127.0.0.1",
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page.")] = True,
    exercise: Annotated[bool, typer.Option("--exercise", help="Begin with a concealed effect to be found.")] = False,
    json: Json = False,
) -> None:
    """Serve the lab as a local page: turn the gain and see the carts; show physics, read recordings, diagnose."""
    try:
        from baselines.lab_page.server import LOOPBACK_NAMES, serve  # noqa: PLC0415
    except ModuleNotFoundError as error:
        if error.name != "nicegui":
            raise
        raise ValueError(
            "lab: the page needs NiceGUI; got no such package. Run: pip install 'flexdrive[lab]'"
        ) from error
    from baselines.lab.lab_scale import on_lab_scale  # noqa: PLC0415
    from baselines.lab_page.session import BUNDLED, Lab  # noqa: PLC0415
    from flexdrive_gym import DEFAULT_DRIVE, load_drive  # noqa: PLC0415

    given = shown or []
    drives = [p for p in given if p.suffix == ".toml"]
    found = {f"drive{i + 1}": on_lab_scale(load_drive(path)) for i, path in enumerate(drives)}
    if host not in LOOPBACK_NAMES:
        print(
            f"flexdrive: --host {host} lets every machine that reaches it use this page, run computations here and see what is "
            "uploaded; there is no password and no encryption. Use it in a network that you trust.",
            file=sys.stderr,
        )
    from baselines.lab_page.warm_up import warm_up  # noqa: PLC0415

    if not json:
        say("preparing (a first run compiles for a minute or two) …")
    warm_up()
    if json:
        print_json({"address": f"http://{host}:{port}/", "host": host, "port": port})
    else:
        say(f"the lab is at http://{host}:{port}/ (Ctrl-C ends it)")
    recordings = tuple(p for p in given if p.suffix != ".toml")
    given_to = Lab(
        found | {BUNDLED: DEFAULT_DRIVE}, recordings, rig, exercise, strict=strict, only=only or (), skip=skip or ()
    )
    serve(given_to, host=host, port=port, browser=browser)
