"""A bar of hexahedra, pyramids, prisms and tetrahedra, and plates of triangles and quadrilaterals."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from fenics_contact import Body, Scene, Support, Traction, solve_scene
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.mesh import bisection_partition, boundary_faces, joined_cells, quadratic, serendipity
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.cell_types import HEXAHEDRON

ORDERS = {
    "linear": lambda mesh: mesh,
    "quadratic": quadratic,
    "serendipity": lambda m: serendipity(quadratic(m)),
}


def named_sides(points: np.ndarray, cells: np.ndarray) -> BodyMesh:
    """Return a mesh with the sides x0, x1, ... of its bounding box as surfaces."""
    dim = points.shape[1]
    facets, _ = boundary_faces(cells, dim)
    corners = points[facets[:, : 2 * (dim - 1)]]
    sides = {
        f"{'xyz'[i]}{k}": facets[(np.abs(corners[:, :, i] - end) < 1e-9).all(axis=1)]
        for i in range(dim)
        for k, end in enumerate((points[:, i].min(), points[:, i].max()))
    }
    return BodyMesh(points, cells, sides)


def mixed_bar() -> BodyMesh:
    """Return a bar from 0 to 2 with a layer of each shape along x, tetrahedra behind pyramids."""
    whole = block((0, 0, 0), (2, 1, 1), (4, 2, 2))
    points = whole.points.tolist()
    found: dict[str, list] = {"hexahedron": [], "pyramid": [], "prism": [], "tetrahedron": []}
    for cell in whole.cells:
        place = whole.points[cell].mean(axis=0)
        if place[0] < 0.5:
            found["hexahedron"].append(cell)
        elif 1.0 < place[0] < 1.5:
            found["prism"] += [cell[[0, 1, 2, 4, 5, 6]], cell[[0, 2, 3, 4, 6, 7]]]
        else:
            middle = len(points)
            points.append(place.tolist())
            for face in HEXAHEDRON.faces:
                base = cell[face][::-1]
                if place[0] < 1.0 or np.allclose(whole.points[base, 0], 1.5):
                    found["pyramid"].append([*base, middle])
                else:
                    a, b, c, d = np.roll(base, -int(np.argmin(base)))
                    found["tetrahedron"] += [[a, b, c, middle], [a, c, d, middle]]
    return named_sides(np.array(points), joined_cells(found))


def mixed_plate() -> BodyMesh:
    """Return a plate from 0 to 2, of triangles where x is above 1."""
    whole = rectangle((0, 0), (2, 1), (5, 3))
    right = whole.points[whole.cells].mean(axis=1)[:, 0] > 1.0
    triangles = whole.cells[right][:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
    cells = joined_cells({"quadrilateral": whole.cells[~right], "triangle": triangles}, dim=2)
    return named_sides(whole.points, cells)


def shaken(mesh: BodyMesh, size: float) -> BodyMesh:
    """Move the nodes inside by a fraction of the length, without a pattern."""
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    inside = ((mesh.points > low + 1e-9) & (mesh.points < high - 1e-9)).all(axis=1)
    points = mesh.points.copy()
    points[inside] += size * np.random.default_rng(3).uniform(-1, 1, (inside.sum(), mesh.dim))
    return mesh.moved(points)


def displacement_on(comm: MPI.Comm) -> list[list[float]]:
    """Return the displacement of a clamped mixed bar in five subdomains. Collective."""
    mesh = mixed_bar()
    scene = Scene(
        {"bar": Body(mesh, IsotropicElasticity(100.0, 0.3))},
        [Support("bar", "x0")],
        [Traction("bar", "x1", (0.03, 0.02, 0.1))],
    )
    state = solve_scene(scene, comm, partitions={"bar": bisection_partition(mesh, 5)}, tolerance=1e-11)
    return [row.tolist() for row in state.gather_displacement("bar")]
