"""``flexdrive demo``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from baselines.cli._output import Json, print_json, progress, say


def demo(
    output: Annotated[Path, typer.Option("--output", "-o", file_okay=False, help="Folder for the results.")] = Path(
        "demo"
    ),
    json: Json = False,
) -> None:
    """Tell the whole story on the bundled sample (which flexdrive simulated itself): identify, diagnose, report."""
    from baselines.cli.diagnose import print_diagnosis, write_diagnosis  # noqa: PLC0415
    from baselines.cli.identify import Method, identify  # noqa: PLC0415
    from baselines.cli.report import write_report  # noqa: PLC0415
    from baselines.cli.stability import stability  # noqa: PLC0415
    from baselines.lab.sample import FOLDER  # noqa: PLC0415
    from identification import read_recordings  # noqa: PLC0415

    drive, page, folder = output / "drive.toml", output / "report.html", output / "diagnosis"
    if json:
        _quiet_identify(drive)
        runs = read_recordings(FOLDER)
        found, _ = write_diagnosis(runs, folder)
        write_report(runs, page, _TITLE, found)
        print_json(
            {
                "drive": drive,
                "report": page,
                "diagnosis": folder / "diagnosis.json",
                "verdict": found.verdict,
                "findings": [{"id": f.id, "where": f.where} for f in found.findings],
                "sample": "simulated by flexdrive",
            }
        )
        return
    say("The bundled sample is a data set that flexdrive simulated itself, with ratios that are not the handout's")
    say("and with an effect that no model here is told of.")
    identify([FOLDER], drive, Method.ml)
    stability(drive)
    runs = read_recordings(FOLDER)
    with progress() as bar:
        task = bar.add_task("diagnosing", total=None)
        found, _ = write_diagnosis(
            runs, folder, tell=lambda step: bar.update(task, advance=1, description=f"diagnosing: {step}")
        )
    print_diagnosis(found)
    write_report(runs, page, _TITLE, found)
    say(f"wrote {page}; the diagnosis by itself is {folder / 'report.html'}")


_TITLE = "Flexible drive: Lab 3 report on the bundled, simulated sample"


def _quiet_identify(path: Path) -> None:
    from baselines.lab.sample import FOLDER  # noqa: PLC0415
    from flexdrive_gym import save_drive  # noqa: PLC0415
    from identification import identify as run  # noqa: PLC0415

    save_drive(run(FOLDER).drive, path)
