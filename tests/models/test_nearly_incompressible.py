"""Nearly incompressible bodies: mean dilatations of cells, and Cook's membrane without locking."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, BodyMesh, ContactProblem, Scene, Support, box_partition
from fenics_contact._fem.mechanics import MaterialStep
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import rectangle
from fenics_contact.materials import (
    IsotropicElasticity,
    J2Plasticity,
    Material,
    MooneyRivlin,
    NeoHooke,
    Ogden,
)
from fenics_contact.mesh import quadratic
from tests.models.bodies import box, in_halves
from tests.models.deformed import derivative_errors, equilibrium, patch_of, skew_patch, smooth_field

SHEAR, BULK = 80.1938, 400_942.0
#: Cook's membrane, force 100: vertical displacement of the upper right corner, after E. A. de Souza Neto et
#: al., Design of simple low order finite elements for large strain analysis of nearly incompressible solids,
#: Int. J. Solids Struct. 33 (1996) 3277-3296. The F-bar elements of that paper, 30 on an edge, give 6.89.
TIP = 6.9


LONG = (pytest.mark.slow, pytest.mark.claim)


@pytest.mark.parametrize(
    "cell",
    [
        "quadrilateral",
        "triangle6",
        "quadrilateral9",
        pytest.param("hexahedron", marks=LONG),
        pytest.param("tetrahedron10", marks=LONG),
        pytest.param("hexahedron27", marks=LONG),
    ],
)
def test_forces_and_tangents_of_mean_dilatations_are_derivatives(cell: str) -> None:
    patch = patch_of(Body(skew_patch(cell), MooneyRivlin(1.0, 0.5, 1e3, mean_dilatation=True)))
    u = smooth_field(patch.points, 0.2)
    in_force, in_stiffness = derivative_errors(patch, u)
    assert in_force < 1e-8
    assert in_stiffness < 1e-8
    found = patch.at(u).stiffness
    assert np.abs(found - found.T).max() < 1e-13 * np.abs(found).max()


QUADRATIC = ("triangle6", "quadrilateral9", "tetrahedron10", "hexahedron27")
BY_CELLS = {
    "neo-Hooke": NeoHooke(1.0, 0.49, mean_dilatation=True),
    "Mooney-Rivlin": MooneyRivlin(0.2, 0.05, 50.0, mean_dilatation=True),
    "Ogden": Ogden((0.6,), (1.8,), 50.0, mean_dilatation=True),
    "J2": J2Plasticity(1.0, 0.3, 1e-3, 1e-3, mean_dilatation=True),
}
OBLIQUE = np.array([[1.0, 0.2, 0.1], [0.1, 0.9, -0.1], [0.05, 0.1, 1.1]])


def one_cell(cell: str) -> BodyMesh:
    """One oblique cell."""
    linear = cell.rstrip("0123456789")
    mesh = box(linear, (1, 1, 1))
    A = OBLIQUE[: mesh.dim, : mesh.dim]
    nodes, first = np.unique(mesh.cells[0], return_inverse=True)
    alone = BodyMesh(mesh.points[nodes] @ A.T, first.reshape(1, -1))
    return alone if linear == cell else quadratic(alone)


@pytest.mark.parametrize("cell", ["quadrilateral", "hexahedron", *QUADRATIC])
@pytest.mark.parametrize(
    "material", ["neo-Hooke", "Mooney-Rivlin", "J2", pytest.param("Ogden", marks=pytest.mark.slow)]
)
def test_only_rigid_motions_of_a_cell_are_without_energy(cell: str, material: str) -> None:
    patch = patch_of(Body(one_cell(cell), BY_CELLS[material]))
    stiffness = patch.at(np.zeros(patch.points.shape)).stiffness.toarray()
    stiff = np.linalg.eigvalsh((stiffness + stiffness.T) / 2)
    rigid = 3 if patch.points.shape[1] == 2 else 6
    assert np.abs(stiff[:rigid]).max() < 1e-12 * stiff[-1]
    assert stiff[rigid] > 1e-6 * stiff[-1]


def test_the_dilatation_of_a_hexahedron27_is_linear_and_feels_what_is_conformal() -> None:
    patch = patch_of(Body(one_cell("hexahedron27"), BY_CELLS["Mooney-Rivlin"]))
    x, b = patch.points - patch.points.mean(axis=0), 1e-4 * np.array([0.3, -0.5, 0.8])
    u = 2 * (x @ b)[:, None] * x - (x**2).sum(axis=1)[:, None] * b
    edges = np.diag([2.0, 1.0, 1.0]) @ OBLIQUE.T  # one a row
    moments = np.linalg.det(edges) / 12 * edges.T @ edges
    assert patch.at(u).energy == pytest.approx(50.0 / 2 * 36 * b @ moments @ b, rel=2e-3)


def test_in_a_homogeneous_deformation_the_mean_dilatation_is_the_dilatation() -> None:
    mesh, rubber = skew_patch("hexahedron"), (10.0, 0.499)
    mean, plain = (patch_of(Body(mesh, NeoHooke(*rubber, mean_dilatation=on))) for on in (True, False))
    u = mean.deformed(np.array([[1.2, 0.1, 0.0], [0.0, 0.9, 0.2], [0.1, 0.0, 1.05]]))
    assert mean.at(u).energy == pytest.approx(plain.at(u).energy, rel=1e-12)
    np.testing.assert_allclose(mean.at(u).force, plain.at(u).force, atol=1e-10)
    smooth = smooth_field(mean.points, 0.2)
    assert mean.at(smooth).energy < 0.99 * plain.at(smooth).energy


def test_mean_dilatations_act_where_their_material_is() -> None:
    mesh = in_halves(skew_patch("hexahedron"))
    rubber, hooke = NeoHooke(10.0, 0.49, mean_dilatation=True), IsotropicElasticity(5.0, 0.2)
    mixed, whole = patch_of(Body(mesh, {"left": hooke, "right": rubber})), patch_of(Body(mesh, rubber))
    in_force, in_stiffness = derivative_errors(mixed, smooth_field(mixed.points, 0.2))
    assert max(in_force, in_stiffness) < 1e-8
    right = mixed.points[:, 0] > 1.6
    u = np.where(right[:, None], smooth_field(mixed.points, 0.2), 0.0)
    forces = [patch.at(u).force.reshape(-1, 3)[right] for patch in (mixed, whole)]
    np.testing.assert_allclose(*forces, atol=1e-12)


@pytest.mark.parametrize("cell", ["triangle", "tetrahedron"])
def test_linear_simplices_are_refused(cell: str) -> None:
    message = (
        r"mean_dilatation of MooneyRivlin needs cells .* got a mesh of \w+.*: use hexahedra .* quadratic"
    )
    with pytest.raises(InvalidInputError, match=message):
        Body(skew_patch(cell), MooneyRivlin(1.0, 0.0, 1e3, mean_dilatation=True))
    Body(skew_patch(cell), MooneyRivlin(1.0, 0.0, 1e3))


def cook(cell: str, count: int) -> BodyMesh:
    """Cook's membrane: corners (0, 0), (48, 44), (48, 60), (0, 44)."""
    mesh = rectangle((0, 0), (1, 1), (count, count), cell.rstrip("69"))
    x, y = mesh.points.T
    points = np.stack([48 * x, 44 * x + y * (44 - 28 * x)], axis=1)
    return mesh.moved(points) if cell.rstrip("69") == cell else quadratic(mesh.moved(points))


def tip_of(material: Material, cell: str, count: int, steps: int = 10) -> float:
    """Vertical displacement of the upper right corner under the vertical force 100, by Newton's method."""
    patch = patch_of(Body(cook(cell, count), material))
    x, y = patch.points.T
    free = np.repeat(x > 1e-9, 2)
    load = np.zeros(patch.points.shape)
    loaded = np.flatnonzero(x > 48 - 1e-9)
    edge = loaded[np.argsort(y[loaded])]
    weights = np.ones(len(edge))
    if len(edge) == count + 1:
        weights[[0, -1]] = 0.5
    else:  # Simpson's rule on each edge
        weights[1::2], weights[2:-1:2] = 4, 2
    load[edge, 1] = 100 * weights / weights.sum()
    u = np.zeros(patch.mesh.size)
    for step in range(1, steps + 1):
        u = equilibrium(patch, u, free, load.ravel() * step / steps)
    return float(u.reshape(-1, 2)[edge[-1], 1])


RUBBER = MooneyRivlin(SHEAR / 2, 0.0, BULK, mean_dilatation=True)


def test_cooks_membrane_does_not_lock() -> None:
    errors = [abs(tip_of(RUBBER, "quadrilateral", count) / TIP - 1) for count in (4, 8, 16)]
    assert errors[1] < 0.05
    assert errors[2] < 0.015
    assert errors[0] > 2 * errors[1] > 4 * errors[2], "it converges"
    assert tip_of(RUBBER, "triangle6", 8) == pytest.approx(TIP, rel=0.015)
    assert tip_of(MooneyRivlin(SHEAR / 2, 0.0, BULK), "quadrilateral", 8) < 0.4 * TIP, "points of cells lock"


def test_a_torn_body_of_mean_dilatations_is_in_equilibrium_as_a_whole() -> None:
    mesh = rectangle((0, 0), (2, 1), (8, 4))
    rubber = NeoHooke(3.0, 0.499, mean_dilatation=True)
    supports = [Support("body", "x0"), Support("body", "x1", (0.1, 0.05))]
    problem = ContactProblem(
        Scene({"body": Body(mesh, rubber)}, supports),
        MPI.COMM_SELF,
        partitions={"body": box_partition(mesh, (2, 2))},
        tolerance=1e-9,
    )
    found = problem.solve().gather_displacement("body")
    patch = patch_of(Body(mesh, rubber))
    inside = np.abs(patch.points[:, 0] - 1) < 1 - 1e-9
    force = patch.at(found[patch.mesh.nodes]).force.reshape(-1, 2)
    assert np.abs(force[inside]).max() < 1e-6 * np.abs(force).max()
    assert np.abs(patch.at(0.0 * force).stiffness - patch.linear_stiffness()).max() > 1.0, (
        "not that of points"
    )


def test_tangents_of_cells_that_turn_far_in_one_step_are_finite() -> None:
    """To first order a turn by 120° would make the volume negative."""
    patch = patch_of(Body(skew_patch("quadrilateral"), NeoHooke(10.0, 0.499, mean_dilatation=True)))
    c, s = np.cos(2 * np.pi / 3), np.sin(2 * np.pi / 3)
    turned = patch.deformed(np.array([[c, -s], [s, c]])).ravel()
    found = patch.mechanics.at(turned, MaterialStep(origin=np.zeros_like(turned))).stiffness
    np.testing.assert_allclose(found.toarray(), patch.at(turned).stiffness.toarray(), rtol=1e-12)
