"""Where many independent runs are computed: here, in other processes, or on a Dask cluster.

A worker that is lost loses nothing: Dask computes its runs again elsewhere.
"""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal, Protocol

Backend = Literal["threading", "loky", "dask", "sequential"]
Progress = Callable[[int, int], None]
Keep = Callable[[int, Any], None]
Work = Sequence[tuple[Callable[..., Any], tuple[Any, ...]]]
# what may have a docstring
_DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
# how long a scheduler and its workers may take to answer on a busy machine [s]
_PATIENCE_S = 30


class Run(Protocol):
    """Runs jobs and returns their results in the order of the list; ``keep`` gets each with its place as soon as it is there."""

    def __call__(self, work: Work, progress: Progress, keep: Keep = ...) -> list[Any]:  # noqa: D102
        ...


def code_digest(packages: Sequence[str]) -> str:
    """Return a digest of the code of packages and modules, under which results are kept: those of other code are made again.

    What a comment or a docstring says is no code, nor how lines are broken. Every version of Python finds the same.
    """
    files = []
    for package in packages:
        spec = find_spec(package)
        assert spec is not None
        assert spec.origin is not None
        file = Path(spec.origin)
        own = sorted(file.parent.rglob("*.py")) if file.name == "__init__.py" else [file]
        files += [(path.name, path.read_text(encoding="utf-8")) for path in own]
    return _digest(tuple(files))


@cache
def _digest(files: tuple[tuple[str, str], ...]) -> str:
    """Return the digest of modules by their names and texts; to parse them all takes seconds."""
    code = hashlib.sha256()
    for name, text in files:
        code.update(f"{name}\n{_said(ast.parse(text))}\n".encode())
    return code.hexdigest()[:12]


def _said(node: Any) -> Any:
    """Return what a part of a module says as nested lists, without docstrings, and the same by every Python's parser."""
    if isinstance(node, list):
        return [_said(part) for part in node]
    if not isinstance(node, ast.AST):
        return repr(node)
    fields = dict(ast.iter_fields(node))
    if isinstance(node, _DOCUMENTED) and ast.get_docstring(node, clean=False) is not None:
        fields["body"] = node.body[1:]
    if isinstance(node, ast.JoinedStr):
        # Python 3.12 ends some formats with an empty text
        fields["values"] = [v for v in node.values if not (isinstance(v, ast.Constant) and v.value == "")]
    # what is empty has no field in some versions
    return [type(node).__name__, *([name, _said(v)] for name, v in fields.items() if v is not None and v != [])]


def run_jobs(work: Work, backend: Backend, jobs: int, scheduler: str | None, progress: Progress) -> list[Any]:
    """Run jobs and return their results in the order of the list, wherever they are computed.

    Parameters
    ----------
    work
        Functions with their arguments; they and their results must pickle for ``loky`` and ``dask``.
    backend, jobs, scheduler
        As in :func:`workers`.
    progress
        Called with the number done and the number of all.

    Raises
    ------
    ValueError
        For an unknown backend, or a scheduler that is missing or does not answer.
    """
    with workers(backend, jobs, scheduler) as run:
        return run(work, progress)


@contextmanager
def workers(backend: Backend, jobs: int, scheduler: str | None) -> Iterator[Run]:
    """Yield what runs jobs, once its workers can be reached: whoever writes files does so after that.

    Parameters
    ----------
    backend
        Where they work.
    jobs
        Workers of this machine; -1: as many as cores. Dask has its own.
    scheduler
        Address of the Dask scheduler, for ``dask``.

    Yields
    ------
    callable
        Takes the jobs, the progress as :func:`run_jobs` does, and who keeps a result as soon as it is there.

    Raises
    ------
    ValueError
        For an unknown backend, or a scheduler that is missing or does not answer.
    """
    from joblib import parallel_config  # noqa: PLC0415  (slow to import)

    if backend not in ("threading", "loky", "dask", "sequential"):
        raise ValueError(f"backend: must be threading, loky, dask or sequential; got {backend!r}.")
    if backend != "dask":
        with parallel_config(backend, n_jobs=1 if backend == "sequential" else jobs):
            yield _gather
        return
    # the client's own messages about lost workers are no results
    with _connected(scheduler), parallel_config("dask", wait_for_workers_timeout=_PATIENCE_S):
        yield _gather


def _gather(work: Work, progress: Progress, keep: Keep = lambda _place, _result: None) -> list[Any]:
    from joblib import Parallel, delayed  # noqa: PLC0415

    calls = [delayed(_numbered)(place, function, arguments) for place, (function, arguments) in enumerate(work)]
    found: dict[int, Any] = {}
    for place, result in Parallel(return_as="generator_unordered")(calls):
        keep(place, result)
        found[place] = result
        progress(len(found), len(calls))
    return [found[place] for place in range(len(calls))]


def _numbered(place: int, function: Callable[..., Any], arguments: tuple[Any, ...]) -> tuple[int, Any]:
    return place, function(*arguments)


def _connected(scheduler: str | None) -> Any:
    if scheduler is None:
        raise ValueError("scheduler: the dask backend needs an address; got none. Pass --scheduler tcp://HOST:PORT.")
    try:
        import distributed  # noqa: PLC0415
    except ImportError as error:
        raise ValueError("backend: dask is not installed. pip install 'flexdrive[dask]'.") from error
    make: Any = distributed.Client
    try:
        return make(scheduler, timeout=_PATIENCE_S, set_as_default=True)
    except (OSError, ValueError) as error:
        raise ValueError(
            f"scheduler: must be the address of a running Dask scheduler; got {scheduler!r} ({error}). Start one with "
            "'dask scheduler' and workers with 'dask worker ADDRESS'."
        ) from error
