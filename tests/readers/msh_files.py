"""Small meshes in gmsh, and .msh files written by hand."""

from __future__ import annotations

import signal
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

import pytest

CUBE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
TRIANGLE, QUADRILATERAL, TETRAHEDRON, HEXAHEDRON, PRISM, PYRAMID = 2, 3, 4, 5, 6, 7
TRIANGLE_10, QUADRILATERAL_8 = 21, 16
"""gmsh's numbers of types of elements."""


@contextmanager
def own_gmsh() -> Iterator[ModuleType]:
    """Open a session of the caller's own."""
    handler = signal.getsignal(signal.SIGINT)
    import gmsh

    gmsh.initialize(readConfigFiles=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.add("press")
    yield gmsh
    gmsh.finalize()
    signal.signal(signal.SIGINT, handler)


def changed_gmsh(folder: Path, statement: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let processes that are started from now on import a gmsh after which a statement runs."""
    lines = ["import sys", f"sys.path.remove({str(folder)!r})", "del sys.modules['gmsh']", "import gmsh"]
    (folder / "gmsh.py").write_text("\n".join([*lines, statement, ""]))
    monkeypatch.syspath_prepend(str(folder))


def name(gmsh: ModuleType, dim: int, tags: Sequence[int], text: str) -> None:
    """Put entities into a physical group."""
    gmsh.model.setPhysicalName(dim, gmsh.model.addPhysicalGroup(dim, tags), text)


def within(gmsh: ModuleType, dim: int, low: Sequence[float], high: Sequence[float]) -> list[int]:
    """Entities in a box."""
    grown = [x - 1e-3 for x in low] + [x + 1e-3 for x in high]
    return [tag for _, tag in gmsh.model.getEntitiesInBoundingBox(*grown, dim)]


def two_boxes(gmsh: ModuleType, shared: bool = True) -> None:
    """A "table" of 2 x 1 x 1 and a "tool", a unit cube on it, with "top", "bottom" and "interface"."""
    gmsh.model.occ.addBox(0, 0, 0, 2, 1, 1, 1)
    gmsh.model.occ.addBox(0, 0, 1, 1, 1, 1, 2)
    if shared:
        gmsh.model.occ.fragment([(3, 1)], [(3, 2)])
    gmsh.model.occ.synchronize()
    name(gmsh, 2, within(gmsh, 2, (0, 0, 0), (2, 1, 0)), "bottom")
    name(gmsh, 2, within(gmsh, 2, (0, 0, 2), (1, 1, 2)), "top")
    name(gmsh, 2, within(gmsh, 2, (0, 0, 1), (1, 1, 1)), "interface")
    name(gmsh, 3, [1], "table")
    name(gmsh, 3, [2], "tool")
    gmsh.option.setNumber("Mesh.MeshSizeMin", 0.6)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.6)
    gmsh.model.mesh.generate(3)


def rectangle_surface(gmsh: ModuleType, corners: Sequence[Sequence[float]], cells: int, quads: bool) -> int:
    """A transfinite surface with its corners in the given order; returns its tag."""
    geo = gmsh.model.geo
    points = [geo.addPoint(*corner) for corner in corners]
    lines = [geo.addLine(points[k], points[(k + 1) % 4]) for k in range(4)]
    surface = int(geo.addPlaneSurface([geo.addCurveLoop(lines)]))
    for line in lines:
        geo.mesh.setTransfiniteCurve(line, cells + 1)
    geo.mesh.setTransfiniteSurface(surface)
    if quads:
        geo.mesh.setRecombine(2, surface)
    geo.synchronize()
    return surface


def write_22(
    path: Path,
    points: Sequence[Sequence[float]],
    elements: Sequence[tuple[int, int, Sequence[int]]],
    names: Mapping[tuple[int, int], str],
) -> Path:
    """Write a .msh 2.2 file.

    Args:
        path: The file.
        points: Coordinates.
        elements: Type, number of the physical group (and entity), and nodes counted from 0 of every element.
        names: Dimension and number of a physical group to its name.
    """
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", str(len(names))]
    lines += [f'{dim} {number} "{text}"' for (dim, number), text in names.items()]
    lines += ["$EndPhysicalNames", "$Nodes", str(len(points))]
    lines += [f"{n} {x} {y} {z}" for n, (x, y, z) in enumerate(points, 1)]
    lines += ["$EndNodes", "$Elements", str(len(elements))]
    for n, (kind, group, nodes) in enumerate(elements, 1):
        lines.append(" ".join(map(str, [n, kind, 2, group, max(group, 1), *(node + 1 for node in nodes)])))
    path.write_text("\n".join([*lines, "$EndElements", ""]))
    return path
