"""The command ``flexdrive``."""

from __future__ import annotations

import os
import sys
from typing import Annotated

import typer

from baselines.cli import (
    benchmark,
    blind,
    check,
    compare,
    demo,
    design,
    diagnose,
    experiment,
    export,
    identify,
    lab,
    migrate,
    report,
    rigs,
    stability,
    term,
    train,
    validate,
)
from baselines.cli._command import Command

# the matrices here are small: threads of the linear algebra that spin for work cost more than they save, ten times as much on a
# machine that has other things to do; set before numpy is imported, which commands do when they run
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

app = typer.Typer(
    name="flexdrive",
    help="Identify, simulate, control and diagnose the two-mass flexible drive of a control laboratory.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for _module in (
    demo, check, identify, validate, stability, experiment, diagnose, design, train, compare, report, term, export, lab,
    migrate, blind, benchmark, rigs,
):  # fmt: skip
    app.command(cls=Command)(getattr(_module, _module.__name__.rsplit(".", 1)[-1]))


def _version(value: bool) -> None:
    if value:
        from flexdrive_gym.version import __version__, commit  # noqa: PLC0415

        print(f"flexdrive {__version__} (commit {commit() or 'unknown'})")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print version and commit.")
    ] = False,
) -> None:
    pass


# what brings a module that is not installed
_EXTRAS = {
    "torch": "rl",
    "stable_baselines3": "rl",
    "matplotlib": "report",
    "jinja2": "report",
    "nicegui": "lab",
    "distributed": "dask",
    "pygame": "render",
    "moviepy": "render",
}


def main() -> None:
    """Run the command line: exit 0 on success, 1 on failure with a sentence, 2 on wrong usage."""
    try:
        app()
    except (ValueError, TypeError, KeyError, OSError) as error:
        text = error.args[0] if isinstance(error, KeyError) and error.args else error
        print(f"flexdrive: {text}", file=sys.stderr)
        raise SystemExit(1) from error
    except ModuleNotFoundError as error:
        extra = _EXTRAS.get((error.name or "").partition(".")[0])
        if extra is None:
            raise
        print(f"flexdrive: needs {error.name}. Install it with: pip install 'flexdrive[{extra}]'", file=sys.stderr)
        raise SystemExit(1) from error
    except ArithmeticError as error:
        print(
            f"flexdrive: a value leads out of the range of numbers ({error}). Choose options and a drive nearer to a real rig's.",
            file=sys.stderr,
        )
        raise SystemExit(1) from error
    except MemoryError as error:
        print("flexdrive: the memory does not suffice. Ask for fewer or shorter runs at once.", file=sys.stderr)
        raise SystemExit(1) from error
    except KeyboardInterrupt:
        print("flexdrive: interrupted; nothing was half-written", file=sys.stderr)
        raise SystemExit(1) from None
