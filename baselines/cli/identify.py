"""``flexdrive identify``."""

from __future__ import annotations

from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from baselines.cli._command import MOST_THREADS
from baselines.cli._output import Json, Recordings, interval, number, print_json, progress, say, table
from baselines.cli._reading import Only, RigFile, Skip, Strict, read, skipped_json, skipped_lines
from baselines.cli._results import result_file

if TYPE_CHECKING:
    from identification import Identification, MaximumLikelihood
    from identification.quantities import Quantity


class Method(StrEnum):
    """How to identify."""

    handout = "handout"
    ml = "ml"


Ratio = Annotated[float | None, typer.Option(min=1e-3, max=1e3, help="Hold this ratio (handout: 0.54, 0.1, 0.1).")]


def identify(
    recordings: Recordings,
    output: Annotated[Path, typer.Option("--output", "-o", help="Where to write the drive.")] = Path("drive.toml"),
    method: Annotated[Method, typer.Option(help="Handout 3.2, or maximum likelihood.")] = Method.ml,
    alpha: Ratio = None,
    beta: Ratio = None,
    gamma: Ratio = None,
    p: Annotated[
        float | None, typer.Option(min=1e-3, max=1e6, help="Handout only: use this real pole [1/s] (3.3).")
    ] = None,
    damping: Annotated[bool, typer.Option(help="ml only: fit the spring's damping C too.")] = False,
    compare_tied: Annotated[bool, typer.Option(help="ml only: also fit with the handout's ratios held.")] = True,
    rig: RigFile = None,
    strict: Strict = False,
    only: Only = None,
    skip: Skip = None,
    threads: Annotated[
        int | None, typer.Option(min=1, max=MOST_THREADS, help="ml only: threads; the answer does not change.")
    ] = None,
    json: Json = False,
) -> None:
    """Identify the drive; print the quantities of handout 3.5 and write drive.toml."""
    from flexdrive_gym import save_drive  # noqa: PLC0415
    from identification import MaximumLikelihood, check  # noqa: PLC0415
    from identification import identify as run  # noqa: PLC0415
    from identification.likelihood import identify_by_likelihood  # noqa: PLC0415
    from identification.quantities import HANDOUT_RATIOS  # noqa: PLC0415
    from identification.recordings.faults import gathered  # noqa: PLC0415
    from identification.recordings.recording_set import notes_of  # noqa: PLC0415
    from identification.selection import select  # noqa: PLC0415

    result_file(output)
    ties = {n: v for n, v in (("alpha", alpha), ("beta", beta), ("gamma", gamma)) if v is not None}
    with progress() as bar:
        task = bar.add_task("reading recordings", total=4)
        runs = read(recordings, rig, strict, only, skip)
        bar.update(task, advance=1, description="identifying")
        found = run(runs, method.value, ties=ties or None, p=p, damping=damping, threads=threads)
        bar.update(task, advance=1, description="handout's ratios held")
        tied = None
        if method is Method.ml and compare_tied and not ties and found.drive.carts == 2:
            tied = identify_by_likelihood(select(runs).usable, ties=HANDOUT_RATIOS, threads=threads)
        bar.update(task, advance=1, description="checking")
        own = found.result if isinstance(found.result, MaximumLikelihood) and not ties and not damping else None
        checked = check(runs, folders=recordings, fit=own, threads=threads)
        bar.update(task, advance=1)
    save_drive(found.drive, output)
    alarms, remarks = notes_of(runs)
    remarks += [
        f"{r.name}: {f.where} {f.id}, {f.start_s:.3f} to {f.end_s:.3f} s{f' ({f.note})' if f.note else ''}, left out"
        for r in runs
        for f in gathered(r.faults)
    ]
    if json:
        notes = [f"{r.name}: {note}" for r in runs for note in r.notes]
        result = _as_json(found, tied, output) | {"recording_notes": notes, "skipped": skipped_json(runs)}
        print_json(result | {"ready": checked.ready, "check": checked.remarks()})
        return
    for line in [*skipped_lines(runs), *checked.remarks(), *(f"warning: {text}" for text in alarms)]:
        say(line)
    for title, columns, rows in checked.tables()[2:]:
        table(title, columns, rows)
    _print(found, tied, output, remarks)


def _as_json(found: Identification, tied: MaximumLikelihood | None, output: Path) -> dict[str, object]:
    from identification import MaximumLikelihood  # noqa: PLC0415

    units = found.drive.units
    result: dict[str, object] = {
        "drive": output,
        "method": found.method,
        "quantities": {name: q.of_rig(units) for name, q in found.quantities.items()},
        "effects": {name: q.of_rig(units) for name, q in found.effects.items()},
        "notes": found.result.notes,
    }
    speed = units.one("mm/s")
    if isinstance(found.result, MaximumLikelihood):
        result |= {
            "ratios": found.result.ratios,
            "rms": found.result.rms / speed,
            "tied_rms": None if tied is None else tied.rms / speed,
            "unit": units.name("mm/s"),
            "effective_samples": found.result.effective_samples,
            "per_recording": [replace(c, rms=c.rms / speed) for c in found.result.channels],
        }
        if units.lab:  # names of keys from before there were other units
            result |= {"rms_mm_s": result["rms"], "tied_rms_mm_s": result["tied_rms"]}
    return result


def _spread(q: Quantity) -> str:
    """Return the 95 % interval of a fit, or the standard error of a reading."""
    if q.ci95 is not None or q.standard_error is None:
        return interval(q.ci95)
    return f"± {q.standard_error:.2g}"


def _print(found: Identification, tied: MaximumLikelihood | None, output: Path, remarks: list[str]) -> None:
    from identification import MaximumLikelihood  # noqa: PLC0415
    from identification.likelihood import improvement  # noqa: PLC0415

    result, units = found.result, found.drive.units
    rows = {name: q.of_rig(units) for name, q in found.quantities.items()}
    if isinstance(result, MaximumLikelihood):
        rows |= dict(result.ratios)
    rows |= {name: q.of_rig(units) for name, q in found.effects.items()}
    table(
        f"identified by {'the handout' if found.method == 'handout' else 'maximum likelihood'}",
        ["quantity", "value", "standard error" if found.method == "handout" else "95 % interval", "unit", "how"],
        [[name, number(q.value, 5), _spread(q), q.unit or "–", q.how] for name, q in rows.items()],
    )
    if isinstance(result, MaximumLikelihood):
        say(
            f"rms residual {units.text(result.rms, 'mm/s', 3)} over {result.samples} samples, worth "
            f"{result.effective_samples:.0f} independent ones"
        )
        if tied is not None:
            say(
                f"with the handout's ratios held: {units.text(tied.rms, 'mm/s', 3)}; freeing them cuts the squared error by "
                f"{100.0 * improvement(tied, result):.0f} %"
            )
    for note in [*result.notes, *remarks]:
        say(f"note: {note}")
    say(f"wrote {output}")
