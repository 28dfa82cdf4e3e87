"""Small meshes of every cell type as plain arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.gallery import block

CELLS = ["triangle", "quadrilateral", "tetrahedron", "hexahedron"]


@dataclass(frozen=True)
class Sample:
    """Points (n, dim), cells and surfaces as the package's meshes have them."""

    points: np.ndarray
    cells: np.ndarray
    surfaces: dict[str, np.ndarray]

    @property
    def dim(self) -> int:
        return int(self.points.shape[1])


def box(cell: str, size: tuple[float, float, float], counts: tuple[int, int, int]) -> Sample:
    """A box from the origin; in the plane a rectangle, with the first two sizes and counts."""
    if cell in ("tetrahedron", "hexahedron"):
        mesh = block((0, 0, 0), size, counts, cell)
        return Sample(mesh.points, mesh.cells, dict(mesh.surfaces))
    nx, ny = counts[:2]
    number = np.arange((nx + 1) * (ny + 1)).reshape(nx + 1, ny + 1)
    x, y = np.meshgrid(np.linspace(0, size[0], nx + 1), np.linspace(0, size[1], ny + 1), indexing="ij")
    around = [number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]]
    quads = np.stack([corner.ravel() for corner in around], axis=1)
    cells = quads if cell == "quadrilateral" else np.vstack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    lines = {"x0": number[0], "x1": number[-1], "y0": number[:, 0], "y1": number[:, -1]}
    surfaces = {name: np.stack([line[:-1], line[1:]], axis=1) for name, line in lines.items()}
    return Sample(np.stack([x.ravel(), y.ravel()], axis=1), cells, surfaces)


def shuffled(sample: Sample) -> Sample:
    """The same with nodes and cells numbered at random: nothing may rest on a natural order."""
    rng = np.random.default_rng(3)
    number = rng.permutation(len(sample.points))
    points = np.empty_like(sample.points)
    points[number] = sample.points
    surfaces = {name: number[facets] for name, facets in sample.surfaces.items()}
    return Sample(points, number[sample.cells][rng.permutation(len(sample.cells))], surfaces)
