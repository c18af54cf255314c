"""``flexdrive experiment``."""

from __future__ import annotations

import math
import signal
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from baselines.cli._output import Json, number, print_json, progress, say, table
from baselines.cli._results import Force, interrupted_says, require_no_recordings

if TYPE_CHECKING:
    from baselines.rig import Limits, Rig, RigBench
    from flexdrive_gym import Recording
    from flexdrive_gym.units import Units

# a rig's gain is searched as finely as its runs repeat
_RIG_PRECISION = 1e-2
# a command that pushes one way for so long moves no vibration, it runs away
_RIG_RESTING_S = 0.5


_TIMES = {
    "response": "response of this computer: sample to command",
    "latency": "loop latency by the rig's clock: sample to command",
    "jitter": "jitter: time between arrivals, less the period",
}


class Part(StrEnum):
    """Sections of the handout."""

    STABLE = "2.1"
    CRITICAL = "2.2"
    UNSTABLE = "2.3"
    COLLOCATED = "2.4"
    SQUARES = "2.5"
    SINES = "2.6"


def experiment(
    drive: Annotated[
        Path | None,
        typer.Argument(
            exists=True,
            dir_okay=False,
            metavar="DRIVE",
            help="A drive.toml: what a simulated rig is; for another rig, a first guess of its critical gain.",
        ),
    ] = None,
    output: Annotated[
        Path, typer.Option("--output", "-o", file_okay=False, help="Folder for the recordings.", show_default=False)
    ] = ...,  # type: ignore[assignment]
    rig: Annotated[
        str,
        typer.Option(
            help="Where the rig is: simulated, udp://HOST:PORT or serial:///dev/ttyUSB0?baud=921600 (docs/rig.md). Not a "
            "rig.toml: that says what the columns of recordings mean, and this command reads none.",
            metavar="ADDRESS",
        ),
    ] = "simulated",
    part: Annotated[list[Part] | None, typer.Option(help="Make these sections only; repeatable.")] = None,
    square: Annotated[
        list[float] | None,
        typer.Option(
            min=1e-9,
            max=1e9,
            help="Amplitude of a square [V, or the rig's]; repeatable; default: 1.5 and 2 V, or 60 % and 80 % of what another "
            "rig's recordings reached.",
        ),
    ] = None,
    sine: Annotated[
        float | None,
        typer.Option(
            min=1e-9,
            max=1e9,
            help="Amplitude of the sines [V, or the rig's]; default: 2.5 V, or what another rig's recordings reached.",
        ),
    ] = None,
    frequency: Annotated[
        list[float] | None, typer.Option(min=0.01, max=500.0, help="Of a sine [Hz]; repeatable.")
    ] = None,
    travel: Annotated[
        float | None,
        typer.Option(
            min=1e-9, max=1e9, help="Stop where a cart is farther from zero [mm, or the rig's]; default: the rig's."
        ),
    ] = None,
    voltage: Annotated[
        float | None, typer.Option(min=1e-9, max=1e9, help="Largest command [V, or the rig's]; default: the rig's.")
    ] = None,
    late: Annotated[
        float, typer.Option(min=0.1, max=1e4, help="Stop where a sample comes later, or so long a gap is lost [ms].")
    ] = 20.0,
    watchdog: Annotated[
        float,
        typer.Option(
            min=1.0, max=1e4, help="Stop after so long without a sample, on this side, or a command, on the rig's [ms]."
        ),
    ] = 100.0,
    compress: Annotated[bool, typer.Option(help="Write .csv.gz.")] = False,
    force: Force = False,
    json: Json = False,
) -> None:
    """Run the in-lab session 2.1-2.6 on a rig, simulated by default; write recordings in the rig's format and units.

    A rig with units of its own gets a rig.toml beside them, by which they are read back: --rig rig.toml.
    """
    from baselines.lab.experiments import (  # noqa: PLC0415
        FREQUENCIES_HZ,
        PRECISION,
        SINE_V,
        SQUARES_V,
        lab_session,
        limit_in_the_lab,
    )
    from baselines.lab.lab_scale import on_lab_scale  # noqa: PLC0415
    from baselines.rig import RigBench, open_rig  # noqa: PLC0415
    from flexdrive_gym import load_drive  # noqa: PLC0415
    from flexdrive_gym.files import only_writer  # noqa: PLC0415
    from identification import write_rig  # noqa: PLC0415

    guess = None if drive is None else on_lab_scale(load_drive(drive))
    require_no_recordings(output, force=force)
    parts = tuple(p.value for p in part or Part)
    with (
        only_writer(output),
        _connected(open_rig(rig, guess)) as real,
        interrupted_says(lambda: "0 V was put out; the recordings written so far are whole, and stay."),
        _terminated_as_interrupted(),
        progress() as bar,
    ):
        units = real.description.units
        squares = [units.to_engine(value, "V") for value in square] if square else SQUARES_V
        frequencies = [units.to_engine(value, "Hz") for value in frequency] if frequency else FREQUENCIES_HZ
        task = bar.add_task("experiments", total=_count(parts, len(squares), len(frequencies)))
        limits, simulated = _limits(real, travel, voltage, late, watchdog), real.description.returns
        bench = RigBench(real, limits, tell=lambda sentence: None if json else print(sentence, file=sys.stderr))
        if not json and not simulated:
            say(_told(real, bench.limits))
        runs = lab_session(
            bench,
            squares=squares,
            sine_amplitude=SINE_V if sine is None else units.to_engine(sine, "V"),
            frequencies=frequencies,
            parts=parts,
            near=None if simulated or guess is None else limit_in_the_lab(guess),
            precision=PRECISION if simulated else _RIG_PRECISION,
        )
        written = _recorded(runs, output, units, compress=compress, told=lambda: bar.advance(task))
        described = None if units.lab else write_rig(units, bench.carts, output / "rig.toml", real.description.name)
    _print_results(output, rig, bench, written, described, json=json)


def _recorded(
    runs: Iterable[Recording], output: Path, units: Units, *, compress: bool, told: Callable[[], None]
) -> list[dict[str, Any]]:
    """Write every run as soon as it is made; return file, experiment and notes of each."""
    from identification import write_recording  # noqa: PLC0415

    written = []
    for run in runs:
        path = output / f"{run.name}{'.csv.gz' if compress else '.csv'}"
        write_recording(run, path)
        written.append({"file": path, "experiment": run.excitation.text(units), "notes": run.notes})
        told()
    return written


@contextmanager
def _connected(rig: Rig) -> Iterator[Rig]:
    try:
        yield rig
    finally:
        rig.close()


@contextmanager
def _terminated_as_interrupted() -> Iterator[None]:
    """Have every polite end from outside stop the motor as Ctrl-C does, and Ctrl-C where a shell's background ignores it."""

    def interrupt(_signal: int, _frame: Any) -> None:
        raise KeyboardInterrupt

    names = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
    before = {number: signal.signal(number, interrupt) for number in names}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _limits(rig: Rig, travel: float | None, voltage: float | None, late: float, watchdog: float) -> Limits:
    from baselines.rig import Limits  # noqa: PLC0415

    units = rig.description.units
    return Limits(
        travel=units.to_engine(travel, "mm") if travel else math.inf,
        voltage=units.to_engine(voltage, "V") if voltage else math.inf,
        resting=math.inf if rig.description.returns else _RIG_RESTING_S,
        late=late / 1e3,
        watchdog=watchdog / 1e3,
    )


def _count(parts: Sequence[str], squares: int, sines: int) -> int:
    many = {"2.5": squares, "2.6": sines}
    return sum(many.get(part, 1) for part in parts)


def _told(rig: Rig, limits: Limits) -> str:
    said = rig.description
    carts = f"{said.carts} cart{'s' if said.carts > 1 else ''}"
    clock = "" if said.real_time else "; its clock waits for commands, so it is a simulation"
    return (
        f"{said.name}: {carts}, a sample every {1e3 * said.period:g} ms{clock}. The motor stops beyond ±{limits.travel:g} mm, "
        f"after {1e3 * limits.watchdog:g} ms of silence, for a sample {1e3 * limits.late:g} ms late, and where "
        f"±{limits.voltage:g} V do not suffice for {limits.resting:g} s. Ctrl-C stops it at once."
    )


def _print_results(
    output: Path,
    address: str,
    bench: RigBench,
    written: Sequence[dict[str, Any]],
    described: Path | None,
    *,
    json: bool,
) -> None:
    from baselines.rig.timing import together  # noqa: PLC0415

    said, times = bench.rig.description, together(bench.timings.values()).summary()
    if json:
        told: dict[str, Any] = {
            "address": address,
            "name": said.name,
            "carts": said.carts,
            "period_s": said.period,
            "real_time": said.real_time,
        }
        told["limits"] = bench.limits
        print_json({"folder": output, "recordings": written, "rig": described, "connection": told, "timing_ms": times})
        return
    table(
        f"recordings of {said.name} in {output}",
        ["file", "experiment", "note"],
        [[Path(str(w["file"])).name, str(w["experiment"]), "; ".join(w["notes"])] for w in written],
    )
    say(f"wrote {len(written)} recordings")
    if described is not None:
        say(f"wrote {described}; read them with --rig {described}")
    table(
        "times of a sample",
        ["", "median [ms]", "99 % [ms]", "largest [ms]"],
        [
            [_TIMES[name], *(number(t[q], 3) for q in ("median", "p99", "max"))]
            for name, t in times.items()
            if t is not None
        ],
    )
