"""``flexdrive demo``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from baselines.commands._output import Json, print_json, say


def demo(
    output: Annotated[Path, typer.Option("--output", "-o", file_okay=False, help="Folder for the results.")] = Path(
        "demo"
    ),
    json: Json = False,
) -> None:
    """Tell the whole story on the bundled sample (which flexdrive simulated itself): identify, validate, report."""
    from baselines.commands.identify import Method, identify  # noqa: PLC0415
    from baselines.commands.report import write_report  # noqa: PLC0415
    from baselines.commands.stability import stability  # noqa: PLC0415
    from baselines.sample import FOLDER  # noqa: PLC0415

    if json:
        drive, page = output / "drive.toml", output / "report.html"
        _quiet_identify(drive)
        write_report([FOLDER], page, _TITLE)
        print_json({"drive": drive, "report": page, "sample": "simulated by flexdrive"})
        return
    say("The bundled sample is a lab day that flexdrive simulated itself, with ratios that are not the handout's.")
    identify([FOLDER], output / "drive.toml", Method.ml)
    stability(output / "drive.toml")
    page = write_report([FOLDER], output / "report.html", _TITLE)
    say(f"wrote {page}")


_TITLE = "Flexible drive: Lab 3 report on the bundled, simulated sample"


def _quiet_identify(path: Path) -> None:
    from baselines.sample import FOLDER  # noqa: PLC0415
    from flexdrive_gym import save_drive  # noqa: PLC0415
    from identification import identify as run  # noqa: PLC0415

    save_drive(run(FOLDER).drive, path)
