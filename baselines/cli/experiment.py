"""``flexdrive experiment``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from baselines.cli._output import DriveFile, Json, print_json, progress, say, table
from baselines.cli._results import Force, interrupted_says, require_no_recordings


def experiment(
    drive: DriveFile,
    output: Annotated[Path, typer.Option("--output", "-o", file_okay=False, help="Folder for the recordings.")],
    square: Annotated[
        list[float] | None, typer.Option(min=0.01, max=1000.0, help="Amplitude of a square [V]; repeatable.")
    ] = None,
    sine: Annotated[float, typer.Option(min=0.01, max=1000.0, help="Amplitude of the sines [V].")] = 2.5,
    frequency: Annotated[
        list[float] | None, typer.Option(min=0.01, max=500.0, help="Of a sine [Hz]; repeatable.")
    ] = None,
    compress: Annotated[bool, typer.Option(help="Write .csv.gz.")] = False,
    force: Force = False,
    json: Json = False,
) -> None:
    """Run the in-lab session 2.1-2.6 on the simulated rig; write recordings in the rig's format."""
    from baselines.lab.experiments import FREQUENCIES_HZ, SQUARES_V, lab_day  # noqa: PLC0415
    from flexdrive_gym import load_drive  # noqa: PLC0415
    from flexdrive_gym.files import only_writer  # noqa: PLC0415
    from identification import write_recording  # noqa: PLC0415

    rig = load_drive(drive)
    require_no_recordings(output, force=force)
    squares, frequencies = tuple(square or SQUARES_V), tuple(frequency or FREQUENCIES_HZ)
    written = []
    kept = "the recordings written so far are whole, and stay."
    with interrupted_says(lambda: kept), only_writer(output), progress() as bar:
        task = bar.add_task("experiments", total=4 + len(squares) + len(frequencies))
        for run in lab_day(rig, squares=squares, sine_amplitude=sine, frequencies=frequencies):
            path = output / f"{run.name}{'.csv.gz' if compress else '.csv'}"
            write_recording(run, path)
            written.append({"file": path, "experiment": str(run.excitation), "notes": run.notes})
            bar.advance(task)
    if json:
        print_json({"folder": output, "recordings": written})
        return
    table(
        f"recordings of {rig.name} in {output}",
        ["file", "experiment", "note"],
        [[Path(str(w["file"])).name, str(w["experiment"]), "; ".join(w["notes"])] for w in written],  # type: ignore[arg-type]
    )
    say(f"wrote {len(written)} recordings")
