"""What ``mkdocs build`` adds to the pages in ``docs``: environments, effects, reference, command line, notebooks, decisions."""

import importlib
import io
import re
import sys
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File
from mkdocs.utils import get_relative_url

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))  # the hooks are files of this folder, run from wherever mkdocs is

REFERENCE = {
    "flexdrive_gym": "drive, recordings, environments",
    "identification": "reading, identification, validation, diagnosis",
    "baselines.compare": "comparison of controllers",
    "baselines.controllers": "designs",
}


def _picture(config: Any, files: Any, uri: str, figure: Any) -> None:
    out = io.BytesIO()
    figure.savefig(out, dpi=110, format="png")
    files.append(File.generated(config, uri, content=out.getvalue()))


def _effects(config: Any, files: Any) -> list[Any]:
    from docs.site.effects import caption, picture
    from docs.site.rst import markdown
    from flexdrive_gym.drive.effects import EFFECTS

    entries: list[Any] = [{"All effects": "physics.md"}]
    for effect in sorted(EFFECTS, key=lambda e: (not e.base, e.id)):
        module = importlib.import_module(f"flexdrive_gym.drive.effects.{effect.id}")
        rows = [
            f"| `{effect.key(where, q.name)}` | {q.meaning} | {q.unit} | {q.null:g} | {q.lower:g} … {q.upper:g} | {q.role} |"
            for where in effect.where
            for q in effect.parameters
        ]
        like = ", ".join(f"[{i}]({i}.md)" if any(e.id == i for e in EFFECTS) else i for i in effect.looks_like)
        told = [
            f"- Recognised by: {effect.tells_itself_by}." if effect.tells_itself_by else "",
            f"- Looks like: {like}." if like else "",
            f"- Experiment that tells them apart: {effect.separating_experiment}."
            if effect.separating_experiment
            else "",
        ]
        parts = [
            f"# `{effect.id}`",
            markdown(module.__doc__ or ""),
            f"![{effect.id}: present against absent]({effect.id}.png)",
            f"*{caption(effect)}*",
            f"`{effect.equation}`, at {', '.join(w.replace('_', ' ') for w in effect.where)}.",
            "\n".join(line for line in told if line),
            "| parameter | meaning | unit | null | bounds | role |\n|---|---|---|---|---|---|\n" + "\n".join(rows),
            f"Reference: {effect.reference}." if effect.reference else "",
            f"Source: `flexdrive_gym/drive/effects/{effect.id}.py`; the picture: `python -m docs.site.effects`.",
        ]
        uri = f"effects/{effect.id}.md"
        files.append(File.generated(config, uri, content="\n\n".join(p for p in parts if p) + "\n"))
        _picture(config, files, f"effects/{effect.id}.png", picture(effect))
        entries.append({effect.id.replace("_", " "): uri})
    return entries


def _reference(config: Any, files: Any) -> list[Any]:
    entries: list[Any] = [{"Command line": "reference/commands.md"}]
    for name, what in REFERENCE.items():
        module = importlib.import_module(name)
        public = [n for n in module.__all__ if n[0] != "_" and getattr(getattr(module, n), "__doc__", None)]
        blocks = "\n\n".join(
            f"::: {name}.{n}" for n in public if not isinstance(getattr(module, n), str | dict | tuple)
        )
        uri = f"reference/{name}.md"
        files.append(File.generated(config, uri, content=f"# {name}\n\n`{name}`: {what}.\n\n{blocks}\n"))
        entries.append({name: uri})
    files.append(File.generated(config, "reference/commands.md", content=_commands()))
    return entries


def _commands() -> str:
    import typer

    from baselines.cli import app

    group: Any = typer.main.get_command(app)
    parts = ["# Command line", "`flexdrive COMMAND`. Exit codes: 0 success, 1 failed with a sentence, 2 wrong usage."]
    for name, command in group.commands.items():
        rows = [
            f"| `{' '.join(p.opts) if p.param_type_name == 'option' else p.metavar or p.name}` | "
            f"{_plain(getattr(p, 'help', '') or '')} |"
            for p in command.params
        ]
        parts += [
            f"## flexdrive {name}",
            _plain(command.help or ""),
            "| argument | meaning |\n|---|---|\n" + "\n".join(rows),
        ]
    return "\n\n".join(parts) + "\n"


def _plain(text: str) -> str:
    text = re.sub(r"\\(?=\[)", "", text)
    return " ".join(text.replace("|", r"\|").replace("<", "&lt;").split())


def _notebooks(config: Any, files: Any) -> list[Any]:
    from docs.site.notebooks import page

    entries: list[Any] = []
    for stem in ("handout", "own_controller", "own_rig"):
        file = ROOT / "examples" / "notebooks" / f"{stem}.py"

        def kept(number: int, figure: Any, stem: str = stem) -> str:
            _picture(config, files, f"tutorials/{stem}_{number}.png", figure)
            return f"{stem}_{number}.png"

        text = page(file, kept)
        files.append(File.generated(config, f"tutorials/{stem}.md", content=text))
        entries.append(f"tutorials/{stem}.md")
    return entries


def _decisions() -> list[Any]:
    return [f"decisions/{file.name}" for file in sorted((ROOT / "docs" / "decisions").glob("*.md"))]


def on_files(files: Any, *, config: Any) -> Any:
    """Add the pages that are made from the code, and put them where the navigation names them."""
    made = {
        "EFFECTS": _effects(config, files),
        "ENVIRONMENTS": [f"environments/{file.name}" for file in sorted((ROOT / "docs" / "environments").glob("*.md"))],
        "REFERENCE": _reference(config, files),
        "NOTEBOOKS": _notebooks(config, files),
        "DECISIONS": _decisions(),
    }
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    files.append(File.generated(config, "changelog.md", content=changes))

    def filled(entries: list[Any]) -> list[Any]:
        nav: list[Any] = []
        for entry in entries:
            if isinstance(entry, str) and entry in made:
                nav += made[entry]
            elif isinstance(entry, dict):
                nav.append({k: filled(v) if isinstance(v, list) else v for k, v in entry.items()})
            else:
                nav.append(entry)
        return nav

    config.nav = filled(config.nav)
    return files


def on_page_markdown(markdown: str, **_more: Any) -> str:
    """Write formulas so that browsers draw them without a script."""
    from docs.site.rst import formulas

    return formulas(markdown)


# Material would load this script, by which the search works in pages opened as files, from elsewhere
_SHIM, _OWN_SHIM = "https://unpkg.com/iframe-worker/shim", "assets/iframe-worker.js"


def on_post_page(output: str, *, page: Any, **_more: Any) -> str:
    """Load the search's script from the site itself."""
    return output.replace(_SHIM, get_relative_url(_OWN_SHIM, page.url))


def on_post_template(output_content: str, **_more: Any) -> str:
    """Likewise in the page for missing pages."""
    return output_content.replace(_SHIM, _OWN_SHIM)
