"""Marked simplices are halved: meshes stay conforming, cells good, surfaces and regions as they were."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, Scene, Support, Traction, solve_scene
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, disc, rectangle
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.mesh import quadratic, refined, scaled_jacobian
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.cell_types import CELL_TYPES, shape_values
from fenics_contact.mesh.faces import boundary_faces, vector_areas
from fenics_contact.shapes import Sphere


def straight(dim: int) -> BodyMesh:
    """Return a box of simplices with two regions."""
    if dim == 2:
        mesh = rectangle((0.0, 0.0), (2.0, 1.0), (5, 3), "triangle")
    else:
        mesh = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (3, 2, 2), "tetrahedron")
    left = mesh.points[mesh.cells].mean(axis=1)[:, 0] < 0.9
    parts = {"left": np.flatnonzero(left), "right": np.flatnonzero(~left)}
    return BodyMesh(mesh.points, mesh.cells, mesh.surfaces, None, parts)


def round_one(shapes: bool) -> BodyMesh:
    """Return a disc of triangles."""
    mesh = disc(2.0, 3)
    halves = mesh.cells[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
    return BodyMesh(mesh.points, halves, mesh.surfaces, shapes=mesh.shapes if shapes else {})


def domed(dim: int) -> BodyMesh:
    """Return a box of simplices with a top that lies on a ball, and knows it."""
    mesh, top = straight(dim), f"{'xyz'[dim - 1]}1"
    points = mesh.points.copy()
    across = ((points[:, :-1] - 0.5) ** 2).sum(axis=1)
    points[:, -1] *= np.sqrt(25.0 - across) - 4.0
    ball = Sphere((*(dim - 1) * [0.5], -4.0), 5.0)
    return BodyMesh(points, mesh.cells, mesh.surfaces, shapes={top: ball})


def near(mesh: BodyMesh, reach: float) -> np.ndarray:
    """Mark the cells near a point on the right side."""
    centres = mesh.points[mesh.cells[:, : mesh.dim + 1]].mean(axis=1)
    return np.asarray(np.linalg.norm(centres - [2.0, 0.3, 0.4][: mesh.dim], axis=1) < reach)


ORDERS: dict[str, Callable[[BodyMesh], BodyMesh]] = {"linear": lambda mesh: mesh, "quadratic": quadratic}


def test_halves_of_squares_are_cut_alike_in_other_units_and_elsewhere() -> None:
    """Their edges have the ratio √2, from which on dolfinx cuts cells along their longest edge."""
    mesh, rng, found = rectangle((0.0, 0.0), (3.0, 3.0), (3, 3), "triangle"), np.random.default_rng(2), []
    scales, shifts = 10.0 ** rng.uniform(-9.0, 9.0, 5), rng.uniform(-3.0, 3.0, (5, 2))
    for scale, shift in zip([1.0, *scales], [np.zeros(2), *shifts], strict=True):
        other = BodyMesh(scale * (mesh.points + shift), mesh.cells, {})
        for _ in range(3):
            centres = other.points[other.cells].mean(axis=1) / scale - shift
            other = refined(other, np.linalg.norm(centres - [2.1, 1.4], axis=1) < 1.0).mesh
        found.append(other)
    assert len(found[0].cells) > 3 * mesh.n_cells
    assert all(np.array_equal(other.cells, found[0].cells) for other in found)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("dim", [2, 3])
def test_refined_meshes_conform(dim: int, order: str) -> None:
    mesh = ORDERS[order](straight(dim))
    marked = near(mesh, 0.5)
    result = refined(mesh, marked)
    fine = result.mesh
    children = np.bincount(result.parents, minlength=mesh.n_cells)
    assert (children[marked] == 2**dim).all()
    assert (children == 1).any()
    assert fine.volume == pytest.approx(2.0, rel=1e-13)
    # A node that hangs leaves faces of one cell inside.
    assert len(boundary_faces(fine.cells, dim)[0]) == sum(map(len, fine.surfaces.values()))
    for name, facets in mesh.surfaces.items():
        areas = [vector_areas(it.points, it.surfaces[name]).sum(axis=0) for it in (mesh, fine)]
        np.testing.assert_allclose(areas[1], areas[0], atol=1e-13)
        assert len(fine.surfaces[name]) >= len(facets)
    for name, cells in mesh.regions.items():
        assert np.isin(result.parents[fine.regions[name]], cells).all()
    vertices = np.unique(mesh.cells[:, : dim + 1])
    np.testing.assert_array_equal(fine.points[: len(vertices)], mesh.points[vertices])


@pytest.mark.parametrize("order", ORDERS)
def test_fields_are_carried_by_positions_in_parents(order: str) -> None:
    """In nested spaces a field of the coarse mesh is one of the fine mesh."""
    mesh = ORDERS[order](straight(3))
    result = refined(mesh, [0, 7])
    kind = CELL_TYPES[mesh.cell_type]
    values = shape_values(kind, result.positions.reshape(-1, 3)).reshape(*result.mesh.cells.shape, -1)

    def field(points: np.ndarray) -> np.ndarray:
        return (points @ [1.0, -2.0, 3.0]) ** (2 if order == "quadratic" else 1)

    carried = np.einsum("ckn,cn->ck", values, field(mesh.points)[mesh.cells[result.parents]])
    np.testing.assert_allclose(carried, field(result.mesh.points)[result.mesh.cells], atol=1e-13)


@pytest.mark.parametrize("dim", [2, 3])
def test_cells_keep_their_quality_however_often_they_are_halved(dim: int) -> None:
    mesh, worst = straight(dim), []
    for level in range(7 if dim == 2 else 5):
        mesh = refined(mesh, near(mesh, 0.4 * 0.65**level)).mesh
        worst.append(scaled_jacobian(mesh.points, mesh.cells).min())
    assert min(worst[2:]) == pytest.approx(worst[1], rel=1e-9)
    sizes = np.linalg.norm(np.ptp(mesh.points[mesh.cells], axis=1), axis=1)
    assert sizes.max() > 20 * sizes.min()


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("dim", [2, 3])
def test_new_nodes_lie_on_true_shapes(dim: int, order: str) -> None:
    mesh = ORDERS[order](domed(dim))
    fine = refined(mesh, near(mesh, 0.7)).mesh
    top = f"{'xyz'[dim - 1]}1"
    nodes = np.unique(fine.surfaces[top])
    assert len(nodes) > len(np.unique(mesh.surfaces[top]))
    radii = np.linalg.norm(fine.points[nodes] - [*(dim - 1) * [0.5], -4.0], axis=1)
    np.testing.assert_allclose(radii, 5.0, rtol=1e-14)
    assert fine.shapes == mesh.shapes


@pytest.mark.parametrize(("order", "power"), [("linear", 2), ("quadratic", 4)])
def test_a_disc_refined_everywhere_nears_the_circle(order: str, power: int) -> None:
    mesh, errors = ORDERS[order](round_one(True)), []
    for _ in range(3):
        errors.append(abs(4 * np.pi - mesh.volume))
        mesh = refined(mesh, np.arange(mesh.n_cells)).mesh
    assert np.log2(errors[-2] / errors[-1]) == pytest.approx(power, abs=0.15)


def test_curved_facets_without_a_shape_stay_as_they_are() -> None:
    """The map of a quadratic cell is quadratic in its parts, too."""
    curved = quadratic(round_one(True)).with_shapes({})
    fine = refined(curved, np.arange(0, curved.n_cells, 3)).mesh
    assert fine.n_cells > curved.n_cells
    assert fine.volume == pytest.approx(curved.volume, rel=1e-13)
    straight_one = refined(round_one(False), [0]).mesh
    assert straight_one.volume == pytest.approx(round_one(False).volume, rel=1e-13)


@pytest.mark.parametrize("order", ORDERS)
def test_an_even_stress_is_even_on_a_refined_mesh(order: str) -> None:
    mesh = ORDERS[order](straight(3))
    body = Body(refined(mesh, near(mesh, 0.6)).mesh, IsotropicElasticity(100.0, 0.3))
    held = {"x0": (0.0, None, None), "y0": (None, 0.0, None), "z0": (None, None, 0.0)}
    supports = [Support("bar", side, value) for side, value in held.items()]
    state = solve_scene(
        Scene({"bar": body}, supports, [Traction("bar", "x1", (1.0, 0.0, 0.0))]), MPI.COMM_SELF
    )
    exact = body.mesh.points * [0.01, -0.003, -0.003]
    np.testing.assert_allclose(state.gather_displacement("bar"), exact, atol=1e-11)


def test_ranks_refine_alike(mpirun: Callable[..., str]) -> None:
    script = """
        import sys, zlib
        from fenics_contact.gallery import block
        from fenics_contact.mesh import refined
        mesh = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (3, 2, 2), "tetrahedron")
        fine = refined(mesh, [3, 8, 40]).mesh
        sys.stdout.write(f"{zlib.crc32(fine.cells.tobytes() + fine.points.tobytes())}\\n")
    """
    numbers = {*mpirun(script, 2).split(), *mpirun(script, 1).split()}
    assert len(numbers) == 1


def test_what_cannot_be_refined_is_refused() -> None:
    mesh = straight(2)
    with pytest.raises(InvalidInputError, match="refined all together, got 1 of 4 cells: mark all, or"):
        refined(quadratic(rectangle((0, 0), (1, 1), (2, 2))), [0])
    for marks in ([], [mesh.n_cells], [-1], [0.5], np.zeros(mesh.n_cells, dtype=bool), [[0]]):
        with pytest.raises(InvalidInputError, match="at least one of the cells 0 to 29, or bools"):
            refined(mesh, marks)
    cracked = BodyMesh(mesh.points, mesh.cells, mesh.surfaces, coincident_nodes=True)
    with pytest.raises(InvalidInputError, match="without coincident nodes"):
        refined(cracked, [0])
