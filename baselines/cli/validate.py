"""``flexdrive validate``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from baselines.cli._output import DriveFile, Json, Recordings, number, print_json, progress, say, table
from baselines.cli._reading import Only, RigFile, Skip, Strict, read, skipped_json, skipped_lines

if TYPE_CHECKING:
    from flexdrive_gym import Drive
    from flexdrive_gym.units import Units
    from identification import Validation
    from identification.frequency_response import FrequencyTable


def validate(
    drive: DriveFile,
    recordings: Recordings,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", file_okay=False, help="Folder for overlays and Bode plots (PNG)."),
    ] = None,
    rig: RigFile = None,
    strict: Strict = False,
    only: Only = None,
    skip: Skip = None,
    json: Json = False,
) -> None:
    """Compare a drive with recordings (3.3, 3.4): fit per recording against the floor, frequency response, overlays."""
    from flexdrive_gym import load_drive  # noqa: PLC0415
    from identification import validate as run  # noqa: PLC0415
    from identification.frequency_response import measure_frequency_response  # noqa: PLC0415

    model = load_drive(drive)
    with progress() as bar:
        task = bar.add_task("reading recordings", total=2)
        runs = read(recordings, rig, strict, only, skip, units=model.units)
        bar.update(task, advance=1, description="simulating")
        result = run(model, runs)
        bar.advance(task)
    sines = [r for r in runs if r.excitation.kind == "sine"]
    response = measure_frequency_response(sines) if sines else None
    files = [] if output is None else _write_figures(output, model, result, response)
    if json:
        print_json({**_as_json(result, response, model.units), "files": files, "skipped": skipped_json(runs)})
        return
    for line in skipped_lines(runs):
        say(line)
    _print(model, result, response)
    if files:
        say(f"wrote {len(files)} figures to {output}")


def _as_json(result: Validation, response: FrequencyTable | None, units: Units) -> dict[str, object]:
    """Return the fits and the frequency response in the rig's units."""
    from flexdrive_gym.units import in_rig_units  # noqa: PLC0415

    speed = units.one("mm/s")
    return {
        "rms": result.rms / speed,
        "floor": result.floor / speed,
        "unit": units.name("mm/s"),
        **({"rms_mm_s": result.rms, "floor_mm_s": result.floor} if units.lab else {}),
        "per_recording": [f.of_rig(units) for f in result.fits()],
        "notes": result.notes,
        "frequency_response": None if response is None else in_rig_units(response.rows, units),
    }


def _print(model: Drive, result: Validation, response: FrequencyTable | None) -> None:
    """Print the fits by recording and channel, the notes, and the frequency response."""
    from baselines.report.words import by_number  # noqa: PLC0415

    fits = [f.of_rig(model.units) for f in result.fits()]
    table(
        f"{model.name} against {len(result.overlays)} recording{'' if len(result.overlays) == 1 else 's'}",
        ["recording", "channel", "rms", "floor", "unit", "NRMSE fit", "VAF", "how"],
        [
            [
                f.recording,
                f.channel,
                number(f.rms, 3),
                number(f.floor, 3),
                f.unit,
                _percent(f.nrmse),
                _percent(f.vaf),
                f.how,
            ]
            for f in sorted(fits, key=lambda f: (by_number(f.recording), f.channel))
        ],
    )
    for note in result.notes:
        say(f"note: {note}")
    say(result.summary())
    if response is not None:
        columns, rows = response.as_table()
        table("frequency response (3.4)", columns, rows)


def _percent(value: float) -> str:
    return "–" if value != value else f"{100.0 * value:.1f} %"  # noqa: PLR0124  (nan)


def _write_figures(folder: Path, drive: Drive, result: Validation, response: FrequencyTable | None) -> list[Path]:
    from identification.plots import plot_bode, plot_validation  # noqa: PLC0415
    from identification.plots.style import save_png  # noqa: PLC0415

    figures = {f"overlay_{o.measured.name}.png": plot_validation(o.measured, o.simulated) for o in result.overlays}
    if response is not None and drive.carts == 2:
        both = plot_bode(drive.linear, response, drive, response.amplitude)
        figures |= {f"bode_cart_{i}.png": figure for i, figure in enumerate(both, start=1)}
    return [save_png(figure, folder / name, 110) for name, figure in figures.items()]
