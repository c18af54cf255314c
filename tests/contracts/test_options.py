"""Every option of every command: numbers are bounded, and help keeps its units."""

import math
import re
import typing

import pytest
import typer
from typer.testing import CliRunner

from baselines.cli import app
from flexdrive_gym import DEFAULT_DRIVE, save_drive
from tests.each import each

COMMANDS = typer.main.get_command(app).commands
FUNCTIONS = {command.callback.__name__: command.callback for command in app.registered_commands}


def hints(command):
    """Return name, type and typer's information of every parameter."""
    for name, hint in typing.get_type_hints(FUNCTIONS[command], include_extras=True).items():
        plain, *about = typing.get_args(hint) if typing.get_origin(hint) is typing.Annotated else (hint,)
        yield name, plain, about[0] if about else None


def kinds(hint):
    """Return the plain types within a hint."""
    inner = typing.get_args(hint)
    return {hint} if not inner else set().union(*(kinds(part) for part in inner))


NUMBERS = [
    (command, "--" + name.replace("_", "-"), about)
    for command in FUNCTIONS
    for name, hint, about in hints(command)
    if kinds(hint) & {int, float}
]
IDS = [command + option for command, option, _ in NUMBERS]
WRONG = ["nan", "inf", "-inf", "1e308", "-1e308", "1" + "0" * 30, "-2", "a text", "", "1,5", "0x10", "1_0"]


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    folder = tmp_path_factory.mktemp("place")
    save_drive(DEFAULT_DRIVE, folder / "drive.toml")
    (folder / "run.csv").write_text("")
    return folder


def parsed(command, option, value, place):
    """Return the value that a command would get, or the message that refuses it."""
    needed = {"DRIVE": "drive.toml", "DRIVE...": "drive.toml", "RECORDINGS...": "run.csv", "FOLDER...": "."}
    arguments = [str(place / needed[p.metavar]) if p.metavar != "NAME" else "emps" for p in COMMANDS[command].params
                 if p.param_type_name == "argument" and p.required]  # fmt: skip
    if command in {"benchmark", "rigs"}:
        arguments += ["--data", str(place)]
    if command == "export":
        arguments += ["--to", "matlab"]
    if any("-o" in p.opts for p in COMMANDS[command].params):
        arguments += ["-o", str(place / "out")]
    try:
        context = COMMANDS[command].make_context(command, [*arguments, f"{option}={value}"])
    except Exception as error:  # noqa: BLE001
        assert type(error).__name__ in {"BadParameter", "UsageError"}, error  # noqa: PT017
        return error.format_message()
    return next(context.params[p.name] for p in COMMANDS[command].params if option in p.opts)


def test_there_are_numbers_to_try():
    assert {"compare--draws", "stability--gain", "train--envs"} <= set(IDS)


@each(("command", "option", "about"), NUMBERS, ids=IDS)
def test_a_number_is_bounded_on_both_sides(command, option, about):
    assert about.min is not None
    assert about.max is not None
    assert math.isfinite(about.max)


@each(("command", "option", "about"), NUMBERS, ids=IDS)
def test_a_wrong_number_is_refused_by_the_name_of_its_option(command, option, about, place):
    for value in WRONG:
        found = parsed(command, option, value, place)
        if isinstance(found, str):
            assert option in found
            assert value in found
            continue
        # what is taken is a number in the range
        for number in found if isinstance(found, list | tuple) else [found]:
            assert about.min <= number <= about.max
    for value in ("nan", "inf", "1e308", "a text"):
        assert isinstance(parsed(command, option, value, place), str)


@each("command", ["compare", "blind"])
def test_no_workers_are_refused(command, place):
    assert "neither a number of workers" in parsed(command, "--jobs", 0, place)
    assert parsed(command, "--jobs", -1, place) == -1


@each("command", COMMANDS)
def test_help_keeps_its_brackets(command):
    shown = CliRunner().invoke(app, [command, "--help"], env={"COLUMNS": "200", "TERMINAL_WIDTH": "200"}).output
    shown = re.sub(r"[\s│]+", " ", shown)
    texts = [FUNCTIONS[command].__doc__, *(getattr(about, "help", None) for _, _, about in hints(command))]
    brackets = [b for text in texts if text for b in re.findall(r"\[[^\]]*\]", text)]
    assert all(b in shown for b in brackets), (brackets, shown)


def test_every_command_that_reads_recordings_takes_a_description_and_a_choice():
    reading = {
        name for name, command in COMMANDS.items() if any("RECORDINGS" in (p.metavar or "") for p in command.params)
    }
    assert {"check", "identify", "validate", "diagnose", "report", "lab"} <= reading
    for name in (*reading, "term"):
        taken = {option for p in COMMANDS[name].params for option in p.opts}
        assert {"--rig", "--strict", "--only", "--skip"} <= taken, name


@each("command", [c for c in COMMANDS if any(p.param_type_name == "argument" for p in COMMANDS[c].params)])
def test_nothing_is_no_path(command):
    """As a path an empty text is the present folder, which nobody asked for: a variable of a shell is unset."""
    for arguments, place in (([""], 1), (["here", "--output="], 2)):
        told = CliRunner().invoke(app, [command, *arguments])
        assert told.exit_code == 2
        assert f"argument {place} must not be empty" in " ".join(told.output.split())
