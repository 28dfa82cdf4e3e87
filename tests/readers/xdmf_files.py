"""Meshes of dolfinx, with tags, in memory and in XDMF files; XDMF files of meshio."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import _dolfinx

import dolfinx.io  # isort: skip
import dolfinx.mesh  # isort: skip

CELLS = ["triangle", "quadrilateral", "tetrahedron", "hexahedron"]


def bar(cell: str) -> Any:
    """A mesh of 2 x 1 (x 1): 4 x 2 (x 2) cells, or each of these split."""
    kind = getattr(dolfinx.mesh.CellType, cell)
    if cell in ("triangle", "quadrilateral"):
        return dolfinx.mesh.create_rectangle(MPI.COMM_SELF, [[0.0, 0.0], [2.0, 1.0]], [4, 2], kind)
    return dolfinx.mesh.create_box(MPI.COMM_SELF, [[0.0, 0.0, 0.0], [2.0, 1.0, 1.0]], [4, 2, 2], kind)


def cell_tags(mesh: Any, name: str = "cell_tags") -> Any:
    """Tag 1 on the cells up to x = 1, tag 2 on the others."""
    dim = mesh.topology.dim
    values = np.full(mesh.topology.index_map(dim).size_local, 2, dtype=np.int32)
    values[dolfinx.mesh.locate_entities(mesh, dim, lambda x: x[0] < 1.0 + 1e-9)] = 1
    tags = dolfinx.mesh.meshtags(mesh, dim, np.arange(values.size, dtype=np.int32), values)
    tags.name = name
    return tags


def facet_tags(mesh: Any, name: str = "facet_tags") -> Any:
    """Tag 3 at x = 2, tag 4 at y = 0."""
    dim = mesh.topology.dim - 1
    mesh.topology.create_connectivity(dim, dim + 1)
    ends = [
        dolfinx.mesh.locate_entities_boundary(mesh, dim, lambda x, d=d, at=at: np.isclose(x[d], at))
        for d, at in ((0, 2.0), (1, 0.0))
    ]
    facets, values = np.concatenate(ends), np.repeat([3, 4], list(map(len, ends)))
    order = np.argsort(facets)
    tags = dolfinx.mesh.meshtags(mesh, dim, facets[order].astype(np.int32), values[order].astype(np.int32))
    tags.name = name
    return tags


def everywhere(mesh: Any) -> tuple[Any, Any]:
    """Tag 1 on all cells, tag 3 on all facets of the boundary."""
    dim = mesh.topology.dim
    mesh.topology.create_connectivity(dim - 1, dim)
    cells = np.arange(mesh.topology.index_map(dim).size_local, dtype=np.int32)
    facets = dolfinx.mesh.locate_entities_boundary(mesh, dim - 1, lambda x: np.full(x.shape[1], True))
    found = []
    for name, d, entities, value in (
        ("cell_tags", dim, cells, 1),
        ("facet_tags", dim - 1, np.sort(facets), 3),
    ):
        tags = dolfinx.mesh.meshtags(mesh, d, entities, np.full(len(entities), value, dtype=np.int32))
        tags.name = name
        found.append(tags)
    return found[0], found[1]


def write(path: Path, mesh: Any, *tags: Any) -> Path:
    """Write a mesh and its tags as dolfinx does."""
    with dolfinx.io.XDMFFile(MPI.COMM_SELF, str(path), "w") as file:
        file.write_mesh(mesh)
        for one in tags:
            file.write_meshtags(*((one,) if _dolfinx.version() < (0, 7) else (one, mesh.geometry)))
    return path


def third_order_triangle() -> Any:
    """A mesh of one triangle with ten nodes."""
    cells, points = np.arange(10, dtype=np.int64)[None], np.random.default_rng(0).random((10, 2))
    if _dolfinx.version() < (0, 7):
        import ufl

        domain = ufl.Mesh(ufl.VectorElement("Lagrange", ufl.triangle, 3))
        return dolfinx.mesh.create_mesh(MPI.COMM_SELF, cells, points, domain)
    import basix.ufl

    element = basix.ufl.element("Lagrange", "triangle", 3, shape=(2,))
    return dolfinx.mesh.create_mesh(MPI.COMM_SELF, cells=cells, x=points, e=element)


@pytest.fixture
def meshio(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """meshio, which asks for h5py also where it writes the numbers into the file itself."""
    monkeypatch.setitem(sys.modules, "h5py", ModuleType("h5py"))
    return pytest.importorskip("meshio")
