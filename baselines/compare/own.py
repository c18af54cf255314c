"""Controllers of one's own in a comparison: objects in Python, code in a file, or a linear controller as data.

A TOML file describes a :class:`~flexdrive_gym.LinearController` and runs nothing; a Python file is run, on purpose. Files speak
the rig's units: their gains, limits, readings and commands are brought to the scale of the drive that they shall run on.
"""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import sys
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from math import inf
from pathlib import Path
from typing import Any

from baselines.compare.entries import READS, Entry
from baselines.controllers import SAMPLE_TIME_S
from baselines.evaluation.adapters import PolicyController
from flexdrive_gym import Controller, Drive, LinearController, Observation, PControl
from flexdrive_gym.drive.controller import command_of
from flexdrive_gym.units import Units

FORMS = {
    "tf": ("numerator", "denominator", "reads", "domain"),
    "ss": ("A", "B", "C", "D", "inputs", "domain"),
}
COMMON = ("title", "sample_time", "limit")


def is_own(name: str) -> bool:
    """Whether a name on a command line stands for a file with a controller of one's own."""
    return name.endswith((".toml", ".py")) or ".py:" in name


def own_entry(name: str, controller: Controller) -> Entry:
    """Return a controller of one's own as an entry of a comparison.

    Parameters
    ----------
    name
        For tables.
    controller
        Anything with the protocol. P-control and linear controllers have analytic margins; any other is a black box, called at
        the rig's 1 kHz.

    Raises
    ------
    TypeError
        If it cannot be called.
    """
    if isinstance(controller, type) or not callable(controller):
        raise TypeError(
            f"controllers: {name!r} must be an object that is called with an observation and returns the command [V]; got "
            f"{controller!r}." + (" Make one of the class." if isinstance(controller, type) else "")
        )
    if isinstance(controller, PControl):
        controller = controller.linear()
    if isinstance(controller, LinearController):
        title = f"own linear controller of order {controller.order}"
        return Entry(name, controller, title, controller.reads, group=name, period=controller.sample_time)
    if isinstance(controller, PolicyController):
        task = controller.task
        title = f"own policy, acts every {1e3 * task.control_period:g} ms"
        # a policy shows what it learnt: it is swept, and stands with the agents
        return Entry(name, controller, title, READS[task.sensing], group=name, period=task.control_period, learnt=True)
    plain: Any = controller.controller if isinstance(controller, OfRig) else controller
    time = controller.units.one("s") if isinstance(controller, OfRig) else 1.0
    said = "" if inspect.isfunction(plain) else (inspect.getdoc(type(plain)) or "").partition("\n")[0]
    return Entry(
        name, controller, said or "own controller, a black box", getattr(plain, "reads", "x1, x2"), group=name,
        period=time * float(getattr(plain, "sample_time", SAMPLE_TIME_S)),
    )  # fmt: skip


def as_entries(controllers: Sequence[Entry] | Mapping[str, Controller | Entry]) -> list[Entry]:
    """Return entries from entries, or from controllers by name."""
    if not isinstance(controllers, Mapping):
        return list(controllers)
    return [replace(c, name=n) if isinstance(c, Entry) else own_entry(n, c) for n, c in controllers.items()]


def load_own(name: str, drive: Drive, limit: float = inf) -> Entry:
    """Return the controller of one's own that a file holds.

    Parameters
    ----------
    name
        ``FILE.toml``, or ``FILE.py:Name`` with the name of a class, a function or an object. The file is run. A class is made
        with the drive, its numbers in the rig's units, if its constructor asks for one argument, else with none; so is a function
        whose only argument is called ``drive``; any other function is the controller itself.
    drive
        On which it shall run; its units are the file's.
    limit
        Of the command [V], for a linear controller without one.

    Raises
    ------
    FileNotFoundError, ValueError, TypeError
        For a missing file or name, or what is no controller.
    """
    if name.endswith(".toml"):
        controller = load_linear(Path(name)).rescaled(drive.units)
        made = own_entry(Path(name).stem, controller.replace(limit=min(limit, controller.limit)))
        title = _table(Path(name)).get("title")
        return replace(made, title=str(title)) if title else made
    path, _, called = name.rpartition(":") if not name.endswith(".py") else (name, "", "")
    file = Path(path)
    if not called:
        raise ValueError(f"controllers: must name what to take from the file; got {name!r}. Try {name}:MyController.")
    if not file.is_file():
        raise FileNotFoundError(f"controllers: no file {file}.")
    made = _made(_loaded(file, called), drive.in_rig_units())
    return own_entry(called, in_engine_units(made, drive.units))


@dataclass(frozen=True, eq=False)
class OfRig:
    """A black box that speaks a rig's units as one that speaks the engine's.

    Parameters
    ----------
    controller
        Called with times, positions and velocities of the rig; returns its command.
    units
        The rig's.
    """

    controller: Any
    units: Units

    def reset(self) -> None:
        """Forget the past."""
        reset = getattr(self.controller, "reset", None)  # a plain function has none
        if reset is not None:
            reset()

    def __call__(self, observation: Observation, /) -> float:
        """Return the command [V]."""
        o, one = observation, self.units.one
        x, v = one("mm"), one("mm/s")
        told = Observation(o.t / one("s"), o.xr / x, o.x1 / x, o.x2 / x, o.v1 / v, o.v2 / v)
        return command_of(self.controller, told) * one("V")


def in_engine_units(controller: Any, units: Units) -> Controller:
    """Return what a file made for a rig as a controller on the engine's scale; policies are on it already."""
    if units.lab or isinstance(controller, PolicyController | type) or not callable(controller):
        return controller  # type: ignore[no-any-return]
    if isinstance(controller, PControl):
        return PControl(units.to_engine(controller.gain, "V/mm"), controller.feedback)
    if isinstance(controller, LinearController):
        return controller.rescaled(units)
    return OfRig(controller, units)


def _loaded(file: Path, called: str) -> Any:
    """Run a file and return what it calls so."""
    title = f"flexdrive_own_{file.stem}"
    specification = importlib.util.spec_from_file_location(title, file)
    if specification is None or specification.loader is None:
        raise ValueError(f"controllers: {file} is no Python file.")
    module = importlib.util.module_from_spec(specification)
    sys.modules[title] = module  # dataclasses and pickles look their module up
    specification.loader.exec_module(module)
    if not hasattr(module, called):
        names = [n for n in vars(module) if not n.startswith("_")]
        near = get_close_matches(called, names, n=1)
        raise ValueError(
            f"controllers: {file} has nothing called {called!r}."
            + (f" Did you mean {near[0]!r}?" if near else f" It has {', '.join(names) or 'nothing'}.")
        )
    _travel_by_value(module)
    return getattr(module, called)


def _travel_by_value(module: Any) -> None:
    """Let objects of a module go to worker processes, which cannot import it."""
    # joblib brings its own or takes the library's, Dask takes the library's
    for name in ("cloudpickle", "joblib.externals.cloudpickle"):
        try:
            importlib.import_module(name).register_pickle_by_value(module)
        except ModuleNotFoundError:
            continue


def _made(found: Any, drive: Drive) -> Any:
    if not (isinstance(found, type) or inspect.isfunction(found)):
        return found
    asked = [
        p.name for p in inspect.signature(found).parameters.values()
        if p.default is p.empty and p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD)
    ]  # fmt: skip
    if isinstance(found, type):
        return found(drive) if asked else found()
    return found(drive) if asked == ["drive"] else found


def _table(file: Path) -> dict[str, Any]:
    if not file.is_file():
        raise FileNotFoundError(f"controllers: no file {file}.")
    try:
        return tomllib.loads(file.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"controllers: {file} must be TOML; {error}.") from error


def load_linear(file: Path) -> LinearController:
    """Read a linear controller from a TOML file; ``docs/controllers.md`` describes it.

    Raises
    ------
    FileNotFoundError, ValueError
        If there is no such file, or it is no controller; the message names file, rule and value.
    """
    table = _table(file)
    forms = [form for form in FORMS if isinstance(table.get(form), dict)]
    if len(forms) != 1:
        raise ValueError(f"{file}: must have one table, [tf] or [ss]; got {', '.join(map(repr, table)) or 'nothing'}.")
    form = forms[0]
    for where, given, known in (("", table, (*COMMON, form)), (f"{form}.", table[form], FORMS[form])):
        for key in given:
            if key not in known:
                near = get_close_matches(key, known, n=1)
                raise ValueError(
                    f"{file}: {where}{key} is no entry; there are {', '.join(known)}."
                    + (f" Did you mean {near[0]!r}?" if near else "")
                )
    keywords = {k: table[k] for k in ("sample_time", "limit") if k in table}
    for key, value in keywords.items():
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise TypeError(f"{file}: {key} must be a number; got {value!r}.")
    make = LinearController.from_tf if form == "tf" else LinearController.from_ss
    try:
        return make(**table[form], **keywords, name=file.stem)
    except (TypeError, ValueError) as error:
        said = str(error).replace("LinearController.from_tf() ", "").replace("LinearController.from_ss() ", "")
        raise ValueError(f"{file}: {said}") from error
