"""Where many independent runs are computed: here, in other processes, or on a Dask cluster.

A worker that is lost loses nothing: Dask computes its runs again elsewhere.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Literal

Backend = Literal["threading", "loky", "dask", "sequential"]
Progress = Callable[[int, int], None]


def run_jobs(
    work: Sequence[tuple[Callable[..., Any], tuple[Any, ...]]],
    backend: Backend,
    jobs: int,
    scheduler: str | None,
    progress: Progress,
) -> list[Any]:
    """Run jobs and return their results in the order of the list, wherever they are computed.

    Parameters
    ----------
    work
        Functions with their arguments; they and their results must pickle for ``loky`` and ``dask``.
    jobs
        Workers of this machine; -1: as many as cores. Dask has its own.
    scheduler
        Address of the Dask scheduler, for ``dask``.
    progress
        Called with the number done and the number of all.

    Raises
    ------
    ValueError
        For an unknown backend, or a scheduler that is missing or does not answer.
    """
    from joblib import Parallel, delayed, parallel_config  # noqa: PLC0415  (slow to import)

    if backend not in ("threading", "loky", "dask", "sequential"):
        raise ValueError(f"backend: must be threading, loky, dask or sequential; got {backend!r}.")
    calls = [delayed(function)(*arguments) for function, arguments in work]

    def gather() -> list[Any]:
        found = []
        for done in Parallel(return_as="generator")(calls):
            found.append(done)
            progress(len(found), len(calls))
        return found

    if backend != "dask":
        with parallel_config(backend, n_jobs=1 if backend == "sequential" else jobs):
            return gather()
    if scheduler is None:
        raise ValueError("scheduler: the dask backend needs an address; got none. Pass --scheduler tcp://HOST:PORT.")
    try:
        import distributed  # noqa: PLC0415
    except ImportError as error:
        raise ValueError("backend: dask is not installed. pip install 'flexdrive[dask]'.") from error
    make: Any = distributed.Client
    try:
        client = make(scheduler, timeout="20s", set_as_default=True)
    except (OSError, ValueError) as error:
        raise ValueError(
            f"scheduler: must be the address of a running Dask scheduler; got {scheduler!r} ({error}). Start one with "
            "'dask scheduler' and workers with 'dask worker ADDRESS'."
        ) from error
    # the client's own messages about lost workers are no results
    with client, parallel_config("dask"):
        return gather()
