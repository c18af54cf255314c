"""How Gymnasium learns the environments' ids in a script that never imports this package.

``gymnasium.make`` knows what is in its registry. Gymnasium 0.26 to 0.29 filled it from the entry points of the group
``gymnasium.envs``; Gymnasium 1.0 gave that up, so the entry point, which we have, does nothing there. What works is a start-up
file of the installation: ``flexdrive_gymnasium.pth`` runs :func:`install` when Python starts, and Gymnasium's module of
environments, whenever it is imported, is followed by :func:`register`.

A wheel carries this file as ``_flexdrive_gymnasium`` beside the package (``pyproject.toml``), because whatever lies in a package
imports that package first, with its compiler. So nothing but ``sys`` is imported at its top. ``docs/decisions/0032`` has the
reasons.
"""

import sys

TYPE_CHECKING = False  # typing takes longer to import than everything here; type checkers know the name
if TYPE_CHECKING:
    from importlib.machinery import ModuleSpec
    from types import ModuleType
    from typing import Any

_ENVIRONMENTS = "gymnasium.envs"


def register() -> None:
    """Run ``flexdrive_gym/registration.py`` without the package, and what it defines."""
    from importlib.util import find_spec, module_from_spec, spec_from_file_location  # noqa: PLC0415
    from pathlib import Path  # noqa: PLC0415

    package = find_spec("flexdrive_gym")
    if package is None or package.origin is None:
        raise ModuleNotFoundError("No module named 'flexdrive_gym'")
    spec: Any = spec_from_file_location("_flexdrive_ids", Path(package.origin).with_name("registration.py"))
    ids = module_from_spec(spec)
    spec.loader.exec_module(ids)
    ids.register()


class Follower:
    """Finds Gymnasium's module of environments as the other finders do, and has :func:`register` follow its import."""

    def find_spec(self, name: str, path: "Any" = None, target: "ModuleType | None" = None) -> "ModuleSpec | None":
        """Return the spec of that module; ``None`` for every other."""
        if name != _ENVIRONMENTS:
            return None
        # out of the way meanwhile, so that finders which ask all others, as this one does, cannot ask each other for ever
        sys.meta_path.remove(self)
        spec = next((found for finder in sys.meta_path if (found := finder.find_spec(name, path, target))), None)
        loader: Any = None if spec is None else spec.loader
        if loader is not None:
            execute = loader.exec_module

            def exec_module(module: "ModuleType") -> None:
                execute(module)
                if module.__name__ == _ENVIRONMENTS:
                    _follow()

            loader.exec_module = exec_module
        return spec


def _follow() -> None:
    try:
        register()
    except Exception as error:  # noqa: BLE001  (Gymnasium must work without us)
        import warnings  # noqa: PLC0415

        warnings.warn(
            f"flexdrive: its environments could not be registered ({error!r}). Import flexdrive_gym to see why.",
            stacklevel=2,
        )


def install() -> None:
    """Have :func:`register` called when Gymnasium is imported; called when Python starts."""
    if _ENVIRONMENTS not in sys.modules and not any(isinstance(finder, Follower) for finder in sys.meta_path):
        sys.meta_path.insert(0, Follower())
