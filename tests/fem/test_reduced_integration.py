"""Cells of 20 and 8 nodes by 2 points in each direction, compared with CalculiX 2.20 on the same meshes."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, BodyMesh, PointForce, Scene, Support, solve_scene
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain, StVenantKirchhoff
from fenics_contact.mesh import joined_cells, quadratic, serendipity
from tests.fem.columns import COLUMN, STRIP, bent

STEEL = IsotropicElasticity(1e3, 0.3)


def tip_of(body: Body, load: tuple[float, ...]) -> np.ndarray:
    scene = Scene(
        {"b": body}, [Support("b", "z0" if body.mesh.dim == 3 else "y0")], [PointForce("b", "tip", load)]
    )
    state = solve_scene(scene, MPI.COMM_WORLD, tolerance=1e-10)
    return state.gather_displacement("b")[body.mesh.node_sets["tip"][0]]


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    ("body", "load", "calculix"),
    [
        (Body(COLUMN, STEEL), (1.0, 2.0, -3.0), (0.1599523, 0.1913494, -0.1057309)),
        (Body(COLUMN, STEEL, integration="reduced"), (1.0, 2.0, -3.0), (0.6174659, -0.1591363, -0.3378822)),
        (
            Body(COLUMN, StVenantKirchhoff(1e3, 0.3), integration="reduced"),
            (0.2, 0.4, -0.6),
            (0.06294546, 0.02232276, -0.04965894),
        ),
        (Body(STRIP, PlaneStrain(1e3, 0.3)), (1.0, 2.0), (5.513287e-02, -4.308873e-05)),
        (Body(STRIP, PlaneStrain(1e3, 0.3), integration="reduced"), (1.0, 2.0), (0.05425883, 0.00114209)),
    ],
    ids=["C3D20", "C3D20R", "C3D20R large", "CPE8", "CPE8R"],
)
def test_corner_moves_as_calculix_has_it(body: Body, load, calculix) -> None:
    np.testing.assert_allclose(tip_of(body, load), calculix, rtol=2e-6, atol=1e-8)


@pytest.mark.parametrize(
    ("integration", "calculix"),
    [("full", (-8.814698e-05, 9.948248e-04)), ("reduced", (-2.0476e-04, 1.15544e-03))],
)
def test_bodies_of_revolution_move_as_sectors_of_two_degrees_do(integration, calculix) -> None:
    body = Body(STRIP, STEEL, axisymmetric=True, integration=integration)
    np.testing.assert_allclose(tip_of(body, (1.0, 2.0)), calculix, atol=1e-4 * 1e-3)


def test_linear_displacements_are_exact() -> None:
    gradient = np.array([[1e-3, 2e-4, 0.0], [-3e-4, -4e-4, 5e-4], [2e-4, 0.0, 7e-4]])
    mesh = bent(block((0, 0, 0), (1, 2, 3), (2, 2, 3)))
    ways = [lambda x, row=row: x @ row for row in gradient]
    held = [Support("b", side, tuple(ways)) for side in ("x0", "x1", "y0", "y1", "z0", "z1")]
    scene = Scene({"b": Body(mesh, STEEL, integration="reduced")}, held)
    found = solve_scene(scene, MPI.COMM_WORLD).gather_displacement("b")
    np.testing.assert_allclose(found, mesh.points @ gradient.T, atol=1e-12)


def test_subdomains_do_not_matter() -> None:
    mesh = bent(block((0, 0, 0), (2, 2, 3), (4, 2, 4)))
    scene = Scene(
        {"b": Body(mesh, STEEL, integration="reduced")},
        [Support("b", "z0")],
        [PointForce("b", "tip", (0.1, 0.2, -0.3))],
    )
    cut = {"b": (mesh.points[mesh.cells[:, :8]].mean(axis=1)[:, 0] > 1).astype(np.int64)}
    found = [
        solve_scene(scene, MPI.COMM_WORLD, partitions=each, tolerance=1e-11).gather_displacement("b")
        for each in (None, cut)
    ]
    np.testing.assert_allclose(found[0], found[1], atol=1e-8 * np.abs(found[0]).max())


def test_reduced_integration_needs_cells_of_20_or_8_nodes() -> None:
    with pytest.raises(InvalidInputError, match="reduced integration needs hexahedra of 20"):
        Body(quadratic(rectangle((0, 0), (1, 1), (2, 2))), PlaneStrain(1e3, 0.3), integration="reduced")
    with pytest.raises(InvalidInputError, match="must be 'full', 'reduced', 'stabilised' or 'rows'"):
        Body(STRIP, PlaneStrain(1e3, 0.3), integration="Reduced")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("shape", "nodes", "further"),
    [
        ("prism", [1, 8, 3, 5, 9, 7], [[2, 0.5, 0], [2, 0.5, 1]]),
        ("pyramid", [1, 3, 7, 5, 8], [[2, 0.5, 0.5]]),
        ("triangle", [1, 4, 3], [[2, 0.5]]),
    ],
)
def test_bodies_of_several_shapes_are_integrated_in_full(shape: str, nodes: list[int], further: list) -> None:
    """Two points a direction of a prism depend on the vertex that it lists first: 0.30 to 1.43 for 0.24."""
    dim = len(further[0])
    whole = block((0, 0, 0), (1, 1, 1), (1, 1, 1)) if dim == 3 else rectangle((0, 0), (1, 1), (1, 1))
    order = np.lexsort(whole.points.T)
    place = np.append(order, len(order) + np.arange(len(further)))
    given = {"hexahedron" if dim == 3 else "quadrilateral": whole.cells, shape: place[[nodes]]}
    points = np.vstack([whole.points, further])
    mesh = serendipity(quadratic(BodyMesh(points, joined_cells(given, dim))))
    law = STEEL if dim == 3 else PlaneStrain(1e3, 0.3)
    assert Body(mesh, law).integration == "full"
    with pytest.raises(InvalidInputError, match=rf"8 nodes alone, .* got 1 .*{shape} and 1 .*leave it out"):
        Body(mesh, law, integration="reduced")
