"""``flexdrive experiment``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from baselines.cli._command import positive
from baselines.cli._output import DriveFile, Json, print_json, progress, say, table
from baselines.cli._results import Force, interrupted_says, require_no_recordings


def experiment(
    drive: DriveFile,
    output: Annotated[Path, typer.Option("--output", "-o", file_okay=False, help="Folder for the recordings.")],
    square: Annotated[
        list[float] | None,
        typer.Option(
            min=0.0,
            max=1e9,
            callback=positive,
            help="Amplitude of a square [V, or the rig's]; repeatable; default: 1.5 and 2 V, or 60 % and 80 % of what another "
            "rig's recordings reached.",
        ),
    ] = None,
    sine: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            max=1e9,
            callback=positive,
            help="Amplitude of the sines [V, or the rig's]; default: 2.5 V, or what another rig's recordings reached.",
        ),
    ] = None,
    frequency: Annotated[
        list[float] | None, typer.Option(min=0.01, max=500.0, help="Of a sine [Hz]; repeatable.")
    ] = None,
    compress: Annotated[bool, typer.Option(help="Write .csv.gz.")] = False,
    force: Force = False,
    json: Json = False,
) -> None:
    """Run the in-lab session 2.1-2.6 on the simulated rig; write recordings in the rig's format and units.

    A rig with units of its own gets a rig.toml beside them, by which they are read back: --rig rig.toml.
    """
    from baselines.lab.experiments import FREQUENCIES_HZ, SINE_V, SQUARES_V, lab_day  # noqa: PLC0415
    from baselines.lab.lab_scale import on_lab_scale  # noqa: PLC0415
    from flexdrive_gym import load_drive  # noqa: PLC0415
    from flexdrive_gym.files import only_writer  # noqa: PLC0415
    from identification import write_recording, write_rig  # noqa: PLC0415

    rig = on_lab_scale(load_drive(drive))
    units = rig.units
    require_no_recordings(output, force=force)
    squares = [units.to_engine(value, "V") for value in square] if square else SQUARES_V
    frequencies = [units.to_engine(value, "Hz") for value in frequency] if frequency else FREQUENCIES_HZ
    amplitude = SINE_V if sine is None else units.to_engine(sine, "V")
    written = []
    kept = "the recordings written so far are whole, and stay."
    with interrupted_says(lambda: kept), only_writer(output), progress() as bar:
        task = bar.add_task("experiments", total=4 + len(squares) + len(frequencies))
        for run in lab_day(rig, squares=squares, sine_amplitude=amplitude, frequencies=frequencies):
            path = output / f"{run.name}{'.csv.gz' if compress else '.csv'}"
            write_recording(run, path)
            written.append({"file": path, "experiment": run.excitation.text(units), "notes": run.notes})
            bar.advance(task)
        described = None if units.lab else write_rig(rig.units, rig.carts, output / "rig.toml", rig.name)
    if json:
        print_json({"folder": output, "recordings": written, "rig": described})
        return
    table(
        f"recordings of {rig.name} in {output}",
        ["file", "experiment", "note"],
        [[Path(str(w["file"])).name, str(w["experiment"]), "; ".join(w["notes"])] for w in written],  # type: ignore[arg-type]
    )
    say(f"wrote {len(written)} recordings")
    if described is not None:
        say(f"wrote {described}; read them with --rig {described}")
