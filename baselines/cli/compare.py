"""``flexdrive compare``."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, field
from enum import StrEnum
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from baselines.cli._command import MOST_SEED, MOST_THREADS, jobs_given, positive
from baselines.cli._output import Json, print_json, progress, say, table
from baselines.cli._results import Force, interrupted_says, result_folder

if TYPE_CHECKING:
    from collections.abc import Sequence

    from baselines.compare import Comparison, Improvement, Summary
    from flexdrive_gym import Drive
    from flexdrive_gym.units import Units


_KEPT = (
    "nothing of this comparison is kept. The same command begins again; fewer --draws, fewer --controllers and --no-effects take "
    "less time."
)


# a command that is held for longer than a second controls nothing on this drive
_LONGEST_MS = 1000


class Backend(StrEnum):
    """Where runs are computed."""

    threading = "threading"
    loky = "loky"
    dask = "dask"
    sequential = "sequential"


def compare(
    drives: Annotated[
        list[Path],
        typer.Argument(
            exists=True,
            dir_okay=False,
            metavar="DRIVE...",
            help="A drive.toml; several are compared one by one, side by side.",
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", file_okay=False, help="Folder for compare.html and teaching.html, pages with plots."
        ),
    ] = None,
    controllers: Annotated[
        list[str] | None,
        typer.Option(
            "--controllers",
            "-c",
            help="Names, comma-separated or repeated; default: all. Your own: own.toml (a linear controller as data) or "
            "own.py:MyController, whose code is run.",
        ),
    ] = None,
    agents: Annotated[
        list[str] | None,
        typer.Option(
            "--agents",
            "-a",
            help="Trained agents: names or policy files (.npz), comma-separated or repeated; none for none; default: all "
            "ready-trained ones.",
        ),
    ] = None,
    periods: Annotated[
        str, typer.Option(help="Sample times for which controllers are designed [ms], comma-separated.")
    ] = "1,5",
    references: Annotated[
        list[str] | None,
        typer.Option(
            "--references",
            "-r",
            help="Beside the handout's trajectory: name or name:keyword=value, comma-separated or repeated; none for none; "
            "default: s_curve, square, sine, chirp, prbs.",
        ),
    ] = None,
    draws: Annotated[
        int | None, typer.Option(min=0, max=20_000, help="Drives drawn from the covariance; default: 500.")
    ] = None,
    effects: Annotated[
        bool, typer.Option(help="Also run every left-out effect of the catalogue at its typical size.")
    ] = True,
    duration: Annotated[float, typer.Option(min=0.5, max=600.0, help="Of a run along a reference [s].")] = 4.0,
    limit: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            max=1e9,
            callback=positive,
            help="Of the command [V, or the rig's]; never more than the drive's own. Default: 8 V, or what the rig's recordings "
            "reached.",
        ),
    ] = None,
    tolerance: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            max=1e9,
            callback=positive,
            help="For settling and success [mm, or the rig's]; default: 2 in 50 mm.",
        ),
    ] = None,
    empirical: Annotated[bool, typer.Option(help="Also find margins by trial.")] = True,
    seed: Annotated[int, typer.Option(min=0, max=MOST_SEED, help="Of the draws.")] = 0,
    backend: Annotated[
        Backend, typer.Option(help="Where runs are computed; the answer does not change.")
    ] = Backend.threading,
    jobs: Annotated[
        int,
        typer.Option(
            min=-1, max=MOST_THREADS, callback=jobs_given, help="Workers of this machine; -1: as many as cores."
        ),
    ] = -1,
    scheduler: Annotated[str | None, typer.Option(help="Address of a Dask scheduler, tcp://HOST:PORT.")] = None,
    everything: Annotated[
        bool, typer.Option("--all", help="Print every controller with all measures, not the eight that matter most.")
    ] = False,
    force: Force = False,
    json: Json = False,
) -> None:
    """Compare controllers and trained agents on the drive, on drives drawn from its covariance, and with left-out effects."""
    from baselines import compare as comparing  # noqa: PLC0415
    from baselines.lab.lab_scale import on_lab_scale  # noqa: PLC0415
    from flexdrive_gym import load_drive  # noqa: PLC0415

    rigs = {label: on_lab_scale(load_drive(path)) for label, path in _labels(drives).items()}
    asked = _names(controllers) or []
    for file in dict.fromkeys(name.rpartition(":")[0] for name in asked if ".py:" in name):
        typer.echo(f"running the code in {file}", err=True)
    along = _names(references)
    options = {
        "limit": limit, "tolerance": tolerance, "duration": duration, "empirical": empirical, "seed": seed,
        "backend": backend.value, "jobs": jobs, "scheduler": scheduler, "draws": draws, "effects": effects,
        "references": comparing.UNSEEN if along is None else along,
    }  # fmt: skip
    found: dict[str, Found] = {}
    with ExitStack() as held:
        held.enter_context(interrupted_says(lambda: _KEPT))
        if output is not None:
            held.enter_context(result_folder(output, "compare.html", force=force))
        for label, rig in rigs.items():
            folder = output if len(rigs) == 1 or output is None else output / label
            found[label] = _compare(rig, asked, _names(agents), _seconds(periods), options)
            if folder is not None:
                found[label].pages = _write(found[label].result, folder)
        both = _write_drives_page(found, output) if len(found) > 1 and output is not None else []
    if json:
        each = {label: f.as_json() for label, f in found.items()}
        print_json(each[next(iter(each))] if len(each) == 1 else {"drives": each, "pages": both})
        return
    _print(found, everything=everything)
    for page in [*(p for f in found.values() for p in f.pages), *both]:
        say(f"wrote {page}")


@dataclass
class Found:
    """What was found of one drive."""

    result: Comparison
    summaries: Sequence[Summary]
    improvements: Sequence[Improvement]
    remarks: list[str]
    pages: list[Path] = field(default_factory=list)

    def as_json(self) -> dict[str, object]:
        """Return it as one object."""
        from flexdrive_gym.units import in_rig_units  # noqa: PLC0415

        units = self.result.drive.units
        groups = {s.name: in_rig_units(s, units) for s in self.summaries}
        return _as_json(in_rig_units(self.result, units)) | {
            "groups": groups, "improvements": self.improvements, "notes": self.remarks, "pages": self.pages,
        }  # fmt: skip


def _labels(drives: Sequence[Path]) -> dict[str, Path]:
    """Return a label per file: its name, or its path's end where names are alike."""
    names = [path.stem for path in drives]
    if len(set(names)) < len(names):
        names = [f"{path.resolve().parent.name}_{path.stem}" for path in drives]
    if len(set(names)) < len(names):
        raise ValueError(f"drives: must be different files; got {', '.join(map(str, drives))}.")
    return dict(zip(names, drives, strict=True))


def _compare(
    rig: Drive, asked: Sequence[str], agents: list[str] | None, periods: list[float], options: dict[str, Any]
) -> Found:
    """Compare the asked controllers on one drive; none asked for are all."""
    from baselines import compare as comparing  # noqa: PLC0415

    options = options | _of_engine(rig.units, options["limit"], options["tolerance"])
    options["references"] = [comparing.named_reference(name, rig.units) for name in options["references"]]
    learnt = comparing.agent_entries(rig, agents)
    draws, remarks = options["draws"], []
    if draws is None and rig.covariance is None:
        remarks.append("the drive has no covariance, so no drives are drawn; identify it with --method ml")
    with progress() as bar:
        task = bar.add_task("designing", total=None)
        own = [comparing.load_own(name, rig, options["limit"]) for name in asked if comparing.is_own(name)]
        families = [name for name in asked if not comparing.is_own(name)]
        chosen, skipped = (
            comparing.entries(rig, families, limit=options["limit"], periods=periods)
            if families or not own
            else ([], {})
        )
        everyone = [*own, *chosen, *comparing.previewed_entries(rig, chosen, learnt), *learnt]
        bar.update(task, description="comparing")
        result = comparing.compare(
            rig, everyone, skipped=skipped, **options,
            progress=lambda done, total: bar.update(task, completed=done, total=total),
        )  # fmt: skip
        bar.update(task, description="summing up")
        summaries, improvements = comparing.summarise(result)
    return Found(result, summaries, improvements, remarks)


def _of_engine(units: Units, limit: float | None, tolerance: float | None) -> dict[str, float]:
    """Return command limit and tolerance in the engine's units; without them those of the lab, whose task every rig has."""
    from baselines.evaluation.metrics import TOLERANCE_MM  # noqa: PLC0415
    from flexdrive_gym.drive.default import HANDOUT_LIMIT_V  # noqa: PLC0415

    own = HANDOUT_LIMIT_V if units.lab else inf
    return {
        "limit": own if limit is None else units.to_engine(limit, "V"),
        "tolerance": TOLERANCE_MM if tolerance is None else units.to_engine(tolerance, "mm"),
    }


def _names(given: list[str] | None) -> list[str] | None:
    """Return names from repeated and comma-separated options; ``none`` is an empty list."""
    if given is None:
        return None
    names = [name.strip() for item in given for name in item.split(",") if name.strip()]
    return [] if names == ["none"] else names


def _seconds(periods: str) -> list[float]:
    """Return sample times [s] from a list in milliseconds, each a whole number of the rig's."""
    found = []
    for item in periods.split(","):
        try:
            value = float(item)
        except ValueError:
            value = 0.0
        if not 1.0 <= value <= _LONGEST_MS or abs(value - round(value)) > 1e-9:
            raise ValueError(
                f"periods: must be whole milliseconds from 1 to {_LONGEST_MS}; got {item!r}. Try --periods 1,5."
            )
        found.append(1e-3 * round(value))
    return list(dict.fromkeys(found))


def _write(result: Comparison, output: Path) -> list[Path]:
    from baselines.report.comparison_pages import write_comparison  # noqa: PLC0415

    with progress() as bar:
        bar.add_task("drawing", total=None)
        return write_comparison(result, output)


def _write_drives_page(found: dict[str, Found], output: Path) -> list[Path]:
    from baselines.report.comparison_pages import write_drives_page  # noqa: PLC0415

    return [write_drives_page({label: f.result for label, f in found.items()}, output)]


def _as_json(result: Comparison) -> dict[str, object]:
    """Return a comparison in the rig's units as one object; the lab's are part of a key's name, another rig's stand beside."""
    groups = ("nominal", "draw", "effect")
    units = result.drive.units
    _V, _mm = ("_V", "_mm") if units.lab else ("", "")
    return {
        "drive": result.drive.name,
        "units": {"length": units.length, "command": units.command},
        f"limit{_V}": min(result.limit, result.drive.voltage_limit),
        f"tolerance{_mm}": result.tolerance,
        "duration_s": result.duration,
        "seed": result.seed,
        "references": result.references,
        "cases": {group: sum(c.group == group and c.handout for c in result.cases) for group in groups}
        | {"unseen": sum(not c.handout for c in result.cases)},
        "controllers": {
            r.entry.name: {
                "title": r.entry.title,
                "feedback": r.entry.feedback,
                "period_s": r.entry.period,
                "learnt": r.entry.learnt,
                "group": r.entry.group,
                "notes": r.entry.notes,
                "nominal": r.nominal,
                "margins": r.margins,
                "empirical_margins": r.empirical,
                "margins_on_rig": r.on_rig,
                f"swing_with_friction{_mm}": r.swing,
                "draws": {"success": r.draws, "stable": r.stable_draws, f"rms{_mm}_quantiles": r.draw_rms},
                "effects": r.effects,
                "unseen": r.unseen,
            }
            for r in result.results
        },
        "skipped": result.skipped,
    }


def _print(found: dict[str, Found], *, everything: bool) -> None:
    """Print the comparison on every drive, and where there are several a table of all."""
    from baselines.compare.tables import drives_table  # noqa: PLC0415

    for f in found.values():
        _print_one(f.result, f.summaries, f.improvements, everything=everything)
        for remark in f.remarks:
            say(f"note: {remark}")
    if len(found) > 1:
        every = drives_table([(label, f.result.drive, f.result.results) for label, f in found.items()])
        table(every.title, every.columns, every.rows)


def _print_one(
    result: Comparison, summaries: Sequence[Summary], improvements: Sequence[Improvement], *, everything: bool
) -> None:
    from baselines.compare import headline, learnt_verdicts, shortlist  # noqa: PLC0415
    from baselines.compare.tables import overview_table  # noqa: PLC0415
    from flexdrive_gym.units import in_rig_units  # noqa: PLC0415

    units = result.drive.units
    told = in_rig_units(result, units)
    chosen = shortlist(told)
    overview = overview_table(told.drive, told.limit, chosen).of_rig(units)
    table(overview.title, overview.columns, overview.rows)
    for sentence in [*headline(result), *learnt_verdicts(result, summaries, improvements)]:
        say(sentence)
    if everything:
        _print_all(result, summaries)
        return
    more = len(result.results) - len(chosen)
    rest = f"{more} more controllers, all" if more else "All"
    say(f"{rest} margins and robustness: --all prints them, compare.html (-o DIR) and --json have them.")


def _print_all(result: Comparison, summaries: Sequence[Summary]) -> None:
    from baselines.compare.tables import BY_TRIAL, LINEAR, with_friction  # noqa: PLC0415
    from flexdrive_gym.units import in_rig_units  # noqa: PLC0415

    units = result.drive.units
    for found in result.tables():
        table(found.title, found.columns, found.rows)
    say(f"{LINEAR} {BY_TRIAL}")
    say(with_friction(units))
    if any(r.entry.learnt for r in result.results):
        table(
            units.label(
                "rms e along each reference [mm]: interquartile means, and 95 % intervals over training seeds and drives"
            ),
            ["group", "seeds", "handout", "failures", *result.references],
            [
                [s.name, str(s.seeds), str(s.rms), s.failures.percent, *(str(s.unseen[n]) for n in result.references)]
                for s in in_rig_units(summaries, units)
            ],
        )
    for r in result.results:
        for note in r.entry.notes:
            say(f"note: {r.entry.name}: {note}")
    for name, reason in result.skipped.items():
        say(f"left out: {name}: {reason}")
