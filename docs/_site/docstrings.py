"""Docstrings as this project writes them, where Sphinx would read something else."""

from __future__ import annotations

import re
from typing import Any

from sphinx.application import Sphinx

from _site import signatures

#: Sphinx calls what has no priority, napoleon among it, at 500.
BEFORE_NAPOLEON, AFTER_NAPOLEON = 400, 600
#: Stands for a colon while napoleon looks: it would take "Volume of the link: ..." for a type and a text.
COLON = "\ue000"
_RULE = re.compile(r"^\|(\s*:?-+:?\s*\|)+$")


def hide_colons(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Keep the first line of a property's docstring as it is."""
    if what in ("attribute", "property") and lines:
        lines[0] = lines[0].replace(":", COLON)


def finish(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Put colons back, types beside names, and tables into Sphinx's own form."""
    text = [line.replace(COLON, ":") for line in lines]
    lines[:] = tables(types_beside_names(text, signatures.annotations(obj)))


def types_beside_names(lines: list[str], types: dict[str, str]) -> list[str]:
    """Put the type of each attribute beside its name, where napoleon puts none or one below the text."""
    written: list[str] = []
    for line in lines:
        name = line.removeprefix(".. attribute:: ")
        if name != line and name in types:
            written += [line, f"   :type: {types[name]}"]
        else:
            written.append(line)
    return written


def tables(lines: list[str]) -> list[str]:
    """Rewrite Markdown's tables as list tables."""
    written: list[str] = []
    number = 0
    while number < len(lines):
        following = lines[number + 1].strip() if number + 1 < len(lines) else ""
        if not (lines[number].strip().startswith("|") and _RULE.match(following)):
            written.append(lines[number])
            number += 1
            continue
        end = number
        while end < len(lines) and lines[end].strip().startswith("|"):
            end += 1
        indent = lines[number][: len(lines[number]) - len(lines[number].lstrip())]
        rows = [cells(line) for line in (lines[number], *lines[number + 2 : end])]
        written += [indent + line for line in list_table(rows)]
        number = end
    return written


def cells(row: str) -> list[str]:
    """Return the cells of a row of Markdown's."""
    return [cell.strip() for cell in re.split(r"(?<!\\)\|", row.strip().strip("|"))]


def list_table(rows: list[list[str]]) -> list[str]:
    """Write a list table, the first row of which is its head, unless that is empty."""
    head = ["   :header-rows: 1"] if any(rows[0]) else []
    body = rows if head else rows[1:]
    items = [
        ("   * - " if column == 0 else "     - ") + cell for row in body for column, cell in enumerate(row)
    ]
    return [".. list-table::", "   :widths: auto", *head, "", *items, ""]


def connect(app: Sphinx) -> None:
    """Connect to Sphinx."""
    app.connect("autodoc-process-docstring", hide_colons, priority=BEFORE_NAPOLEON)
    app.connect("autodoc-process-docstring", finish, priority=AFTER_NAPOLEON)
