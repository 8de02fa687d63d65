"""Definitions of figures, read from the docstrings of the functions and modules that measure them.

A docstring lists figures in its section "Figures:"; the text before it holds for all of them. A
name may hold `*`: `drift_2s_*` defines `drift_2s_mean_m` and the like.
"""

import ast
import re
from collections.abc import Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cache
from pathlib import Path
from typing import Final

PAGE: Final = """# Figures of the evaluation

Printed by `wayfarer eval define`. [evaluation.md](../../docs/evaluation.md) says how to measure
them, [README.md](README.md) has the values.
"""

HERE: Final = Path(__file__).parent
SOURCES: Final = {
    "All tables": "gait.py:gait_row",
    "realism": "random_motion.py:realism",
    "skating": "random_motion.py:skating",
    "reprojection": "reprojection.py:reprojection",
    "bodies": "random_motion.py:bodies",
    "predictor": "models.py:predictor_rows",
    "regressor": "models.py:regressor_rows",
    "control": "control.py:control_row",
    "scenes": "scenes/measures.py",
    "maneuvers": "maneuvers/maneuver.py",
    "two-sided": "twosided/figures.py",
}
"""Table → file, or file and function, whose docstring defines its figures."""


@dataclass(frozen=True)
class Group:
    """The figures of a table, and what holds for all of them."""

    title: str
    about: str
    figures: Mapping[str, str]  # name, or pattern with * → definition


@cache
def groups() -> tuple[Group, ...]:
    """All tables, in the order of `SOURCES`."""
    return tuple(_read(title, *source.split(":")) for title, source in SOURCES.items())


def _read(title: str, file: str, function: str = "") -> Group:
    """Reads a docstring without an import, since many of these modules need torch."""
    module = ast.parse((HERE / file).read_text())
    functions = {node.name: node for node in module.body if isinstance(node, ast.FunctionDef)}
    text = ast.get_docstring(functions[function] if function else module) or ""
    about, _, section = text.partition("\nFigures:\n")
    found = re.findall(r"^    (\S+): (.*(?:\n     .*)*)", section, re.MULTILINE)
    figures = {name: " ".join(words.split()) for name, words in found}
    return Group(title, " ".join(about.split()), figures)


def definitions(figure: str) -> list[tuple[str, str, str]]:
    """Title of the group, name and definition, of each group that defines `figure`: by its name,
    or otherwise by the first pattern that fits.
    """
    found = [
        (group.title, name, text)
        for group in groups()
        for name, text in group.figures.items()
        if fnmatchcase(figure, name)
    ]
    exact = [entry for entry in found if entry[1] == figure]
    first = {group: (group, name, text) for group, name, text in reversed(found)}
    return exact or list(first.values())[::-1]


def as_markdown() -> str:
    """The page: groups as sections, each with a table."""
    parts = [PAGE]
    for group in groups():
        parts.append(f"## {group.title}\n{group.about}\n")
        if group.figures:
            parts.append("| figure | definition |\n|---|---|")
            parts += [f"| `{name}` | {_cell(text)} |" for name, text in group.figures.items()]
            parts.append("")
    return "\n".join(parts)


def _cell(text: str) -> str:
    return text.replace("|", r"\|")
