"""The files of a comparison: compare.html, teaching.html, and a page that compares several drives."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from baselines.compare import Comparison, headline
from baselines.compare.tables import LINEAR, drives_table, with_friction
from baselines.report.compare_page import build_compare_page
from baselines.report.page import Section, render
from baselines.report.teaching_page import build_teaching_page
from flexdrive_gym import __version__
from flexdrive_gym.files import write_atomically


def write_comparison(comparison: Comparison, folder: str | Path) -> list[Path]:
    """Write ``compare.html`` and, for a drive with two carts, ``teaching.html`` into a folder; return their paths."""
    pages = {"compare.html": build_compare_page(comparison)}
    if comparison.drive.carts == 2:
        pages["teaching.html"] = build_teaching_page(comparison)
    return [write_atomically(Path(folder) / name, page.encode()) for name, page in pages.items()]


def write_drives_page(found: Mapping[str, Comparison], folder: str | Path) -> Path:
    """Write ``compare.html``, the same controllers on several drives, into a folder; return its path.

    Parameters
    ----------
    found
        Label of a drive to its comparison; the label is the folder of its own pages.
    """
    beside = Section("Comparison", "beside")
    table = drives_table([(label, c.drive, c.results) for label, c in found.items()])
    beside.table(table.columns, table.rows)
    beside.text(LINEAR)
    for said in dict.fromkeys(with_friction(comparison.drive.units) for comparison in found.values()):
        beside.text(said)
    sections = [beside]
    for i, (label, comparison) in enumerate(found.items()):
        section = Section(f"{label}: {comparison.drive.name}", f"drive_{i}")
        section.items(headline(comparison))
        for own in comparison.tables():
            section.heading(own.title)
            section.table(own.columns, own.rows)
        section.text(f"Plots and everything else: {label}/compare.html.")
        sections.append(section)
    page = render(
        title="Controllers on " + " and ".join(found),
        subtitle="designed anew for each drive, simulated on each; one section per drive",
        summary=[f"{label}: {headline(comparison)[0]}" for label, comparison in found.items()],
        sections=sections,
        footer=f"Made by flexdrive {__version__}: flexdrive compare.",
    )
    return write_atomically(Path(folder) / "compare.html", page.encode())
