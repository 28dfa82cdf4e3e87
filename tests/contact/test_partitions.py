"""An irregular mesh gives one answer, however it is cut into subdomains."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from mpi4py import MPI

from benchmarks.graph_partition import graph_partition
from fenics_contact import (
    Body,
    BodyForce,
    BodyMesh,
    ContactPair,
    Coulomb,
    Scene,
    State,
    Status,
    Support,
    Surface,
    Traction,
    solve_scene,
)
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.qp import FaceNewton
from fenics_contact.readers import from_gmsh_model
from tests.contact.checks import assert_solved
from tests.mesh_io.msh_files import name, own_gmsh, within

TOLERANCE = 1e-9
COUNTS = (1, 4, 17, 64)


@cache
def holed_block() -> BodyMesh:
    """A block of 2 x 1 x 1 on the plane z = 0 with a bore through its middle, in tetrahedra of all sizes."""
    with own_gmsh() as gmsh:
        model = gmsh.model
        whole = model.occ.addBox(0, 0, 0, 2, 1, 1)
        bore = model.occ.addCylinder(0.8, -0.1, 0.55, 0, 1.2, 0, 0.25)
        model.occ.cut([(3, whole)], [(3, bore)])
        model.occ.synchronize()
        name(gmsh, 3, [whole], "holed")
        name(gmsh, 2, within(gmsh, 2, (0, 0, 0), (2, 1, 0)), "bottom")
        name(gmsh, 2, within(gmsh, 2, (0, 0, 1), (2, 1, 1)), "top")
        gmsh.option.setNumber("Mesh.MeshSizeMin", 0.12)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.25)
        gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 12)
        model.mesh.generate(3)
        return from_gmsh_model()["holed"]


def scene() -> Scene:
    """The holed block pressed and pushed on a softer one that bulges, and held by friction alone."""
    base = block((-0.2, -0.1, -1.0), (2.2, 1.1, 0.0), (7, 5, 4))
    points = base.points.copy()
    points[:, 2] -= 0.02 * (points[:, 0] - 1.0) ** 2 * (points[:, 2] + 1.0)
    bodies = {
        "base": Body(base.moved(points), IsotropicElasticity(100.0, 0.3)),
        "holed": Body(holed_block(), IsotropicElasticity(300.0, 0.2)),
    }
    loads = [Traction("holed", "top", (0.45, 0.1, -2.0)), BodyForce("holed", (0.0, 0.0, -0.2))]
    pair = ContactPair(Surface("holed", "bottom"), Surface("base", "z1"), Coulomb(0.3))
    return Scene(bodies, [Support("base", "z0")], loads, [pair])


@cache
def solved(count: int) -> State:
    cut = {body: graph_partition(each.mesh, count, body) for body, each in scene().bodies.items()}
    return solve_scene(scene(), MPI.COMM_SELF, partitions=cut, solver=FaceNewton(tolerance=TOLERANCE))


def test_the_mesh_is_irregular_and_the_contact_mixed() -> None:
    mesh, state = holed_block(), solved(1)
    assert mesh.cell_type == "tetrahedron"
    assert mesh.n_cells > 1000
    assert mesh.grid is None
    assert mesh.volume == pytest.approx(2.0 - np.pi * 0.25**2, rel=0.01)
    assert all(state.contact.count(status) > 3 for status in Status)
    total = state.contact.force.sum(axis=0)
    np.testing.assert_allclose(total[:2], (-0.9, -0.2), rtol=1e-6)
    assert total[2] == pytest.approx(4.0 + 0.2 * mesh.volume, rel=1e-6)


@pytest.mark.parametrize("count", COUNTS)
def test_every_partition_is_solved_to_its_tolerance(count: int) -> None:
    state = solved(count)
    assert state.counts["subdomains"] == 2 * count
    assert_solved(state, TOLERANCE)


@pytest.mark.parametrize("count", COUNTS[1:])
def test_energy_forces_and_displacements_do_not_depend_on_the_partition(count: int) -> None:
    whole, torn = solved(1), solved(count)
    assert torn.energies.total_potential == pytest.approx(whole.energies.total_potential, rel=1e-6)
    assert torn.energies.friction == pytest.approx(whole.energies.friction, rel=1e-6)
    np.testing.assert_array_equal(torn.contact.status, whole.contact.status)
    size = np.abs(whole.contact.force).max()
    np.testing.assert_allclose(torn.contact.force, whole.contact.force, rtol=0, atol=1e-6 * size)
    np.testing.assert_allclose(
        torn.contact.gap, whole.contact.gap, rtol=0, atol=1e-6 * np.abs(whole.contact.gap).max()
    )
    for body in whole.scene.bodies:
        expected = whole.gather_displacement(body)
        np.testing.assert_allclose(
            torn.gather_displacement(body), expected, rtol=0, atol=1e-6 * np.abs(expected).max()
        )
