"""Element sets that an Abaqus file names with its elements: meshio may assign them wrongly."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fenics_contact.errors import InvalidInputError

if TYPE_CHECKING:
    import meshio

_ELEMENT = re.compile(r"^\*element\s*,", re.IGNORECASE)
_NODE = re.compile(r"^\*node\s*(,|$)", re.IGNORECASE)
_ELSET = re.compile(r",\s*elset\s*=\s*([^,\n]+)", re.IGNORECASE)


def with_element_sets(mesh: meshio.Mesh, path: Path) -> meshio.Mesh:
    """Return the mesh with the sets of ``*ELEMENT, ELSET=name`` as in the file.

    meshio 5.3 assigns the n-th of these names to the n-th block, even if a block has none or two blocks have
    the same.

    Args:
        mesh: meshio's mesh; its sets of those names are replaced.
        path: The file; files of other formats, and those that include others, are skipped.

    Returns:
        The same mesh.

    Raises:
        InvalidInputError: If the file lists nodes in several places, of which meshio keeps the last.
    """
    if path.suffix.lower() != ".inp":
        return mesh
    with path.open(errors="replace") as file:
        lines = [line for line in file if line.startswith("*")]
    _check_nodes(lines, path)
    heads = [line for line in lines if _ELEMENT.match(line)]
    if len(heads) != len(mesh.cells):
        return mesh
    names = [match.group(1).strip() if (match := _ELSET.search(head)) else None for head in heads]
    for name in filter(None, dict.fromkeys(names)):
        mesh.cell_sets[name] = [
            np.arange(len(block)) if name == mine else np.zeros(0, dtype=np.int64)
            for mine, block in zip(names, mesh.cells, strict=True)
        ]
    return mesh


def _check_nodes(lines: Sequence[str], path: Path) -> None:
    count = sum(bool(_NODE.match(line)) for line in lines)
    if count > 1:
        raise InvalidInputError(
            f"file '{path}' must list its nodes under one *NODE, it has {count}, of which meshio keeps the "
            "last: write it without parts and assemblies, or save the mesh in another format"
        )
