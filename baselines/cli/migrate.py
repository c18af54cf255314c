"""``flexdrive migrate``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from baselines.cli._output import Json, print_json, say


def migrate(
    file: Annotated[
        Path,
        typer.Argument(
            exists=True, dir_okay=False, metavar="FILE", help="A drive.toml or diagnosis.json of any release."
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", dir_okay=False, help="Where to write it; default: in its place."),
    ] = None,
    json: Json = False,
) -> None:
    """Bring a drive.toml or diagnosis.json of an earlier release to the present schema."""
    from flexdrive_gym.files import write_atomically  # noqa: PLC0415

    before, after, text = _toml(file) if file.suffix == ".toml" else _json(file)
    written = output or file
    if output is not None or before != after:
        write_atomically(written, text)
    if json:
        print_json({"file": written, "schema_before": before, "schema": after})
    elif before == after and output is None:
        say(f"{file} has schema {after}, the present one; it stays as it is")
    else:
        say(f"wrote {written} with schema {after}; {file} had {before}")


def _toml(file: Path) -> tuple[int, int, str]:
    import tomllib  # noqa: PLC0415

    from flexdrive_gym.drive.toml import SCHEMA, dumps, load_drive  # noqa: PLC0415

    drive = load_drive(file)  # says what is wrong with it
    return tomllib.loads(file.read_text(encoding="utf-8"))["schema"], SCHEMA.number, dumps(drive)


def _json(file: Path) -> tuple[int, int, str]:
    from json import dumps, loads  # noqa: PLC0415

    from identification.diagnosis_file import SCHEMA, load_diagnosis  # noqa: PLC0415

    found = load_diagnosis(file)
    text = dumps(found, indent=1, ensure_ascii=False) + "\n"
    return loads(file.read_text(encoding="utf-8"))["schema"], SCHEMA.number, text
