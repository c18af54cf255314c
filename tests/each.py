"""Many cases in one test: all of them run, and those that fail are named."""

import inspect
from collections.abc import Callable, Iterable, Sequence
from functools import wraps

import pytest
from _pytest.mark.structures import ParameterSet


def each(names: str | Sequence[str], cases: Iterable, ids: Callable | Sequence | None = None) -> Callable:
    """Like ``pytest.mark.parametrize``, but one test.

    For what the same few lines say of a whole catalogue: a failure names the cases, and every case has its own traceback.
    Fixtures are shared by the cases, except ``tmp_path``: every case has a folder of its own. A test that needs other fresh ones
    is parametrised.
    """
    called = [name.strip() for name in names.split(",")] if isinstance(names, str) else list(names)
    named = None if ids is None or callable(ids) else list(ids)
    rows = []
    for i, case in enumerate(cases):
        if isinstance(case, ParameterSet):
            if case.marks:
                raise TypeError(f"cases: must have no marks, which one test cannot heed; got {case}. Parametrise.")
            values, name = tuple(case.values), case.id
        else:
            values, name = (case,) if len(called) == 1 else tuple(case), None
        if name is None and ids is not None:
            name = named[i] if named is not None else ids(case if len(called) == 1 else values)
        rows.append((name or ", ".join(f"{v!r:.60}" for v in values), dict(zip(called, values, strict=True))))

    def decorate(function: Callable) -> Callable:
        signature = inspect.signature(function)

        @wraps(function)
        def test(*args, **fixtures):
            failed = {}
            for i, (name, values) in enumerate(rows):
                own = {}
                if "tmp_path" in fixtures:
                    own["tmp_path"] = fixtures["tmp_path"] / str(i)
                    own["tmp_path"].mkdir()
                try:
                    function(*args, **values, **{**fixtures, **own})
                except (Exception, pytest.fail.Exception) as error:  # noqa: BLE001  (raised below, all of them)
                    error.add_note(f"case: {name}")
                    failed[name] = error
            if len(failed) == 1:
                raise next(iter(failed.values()))
            if failed:
                said = f"{len(failed)} of {len(rows)} cases fail: {'; '.join(failed)}"
                raise BaseExceptionGroup(said, list(failed.values()))

        kept = [p for name, p in signature.parameters.items() if name not in called]
        test.__signature__ = signature.replace(parameters=kept)
        return test

    return decorate
