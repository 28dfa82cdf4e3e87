"""Quadratic displacements: of higher order than linear ones, with pressures and pictures that are right."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyForce,
    BodyMesh,
    ContactPair,
    Coulomb,
    RigidPlane,
    Scene,
    State,
    Support,
    Surface,
    Tie,
    TotalForce,
    Traction,
    solve_scene,
    write_vtu,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, half_cylinder, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.mesh import bisection_partition, quadratic
from fenics_contact.pictures import plot_contact_pressure, plot_decomposition, plot_stress
from fenics_contact.qp import FaceNewton
from tests.contact import hertz

SOLVER = FaceNewton(tolerance=1e-10)
CELLS = ["hexahedron27", "tetrahedron10", "quadrilateral9", "triangle6"]


def meshes(n: int) -> dict[str, BodyMesh]:
    return {
        "hexahedron27": quadratic(block((0, 0, 0), (2, 1, 1), (2 * n, n, n))),
        "tetrahedron10": quadratic(block((0, 0, 0), (2, 1, 1), (2 * n, n, n), cell="tetrahedron")),
        "quadrilateral9": quadratic(rectangle((0, 0), (2, 1), (2 * n, n))),
        "triangle6": quadratic(rectangle((0, 0), (2, 1), (2 * n, n), cell="triangle")),
    }


def material(mesh: BodyMesh) -> IsotropicElasticity | PlaneStrain:
    return IsotropicElasticity(100.0, 0.3) if mesh.dim == 3 else PlaneStrain(100.0, 0.3)


def solved(scene: Scene, parts: int) -> State:
    cut = {name: bisection_partition(body.mesh, parts) for name, body in scene.bodies.items()}
    return solve_scene(scene, MPI.COMM_SELF, partitions=cut, solver=SOLVER)


@pytest.mark.parametrize("cell", CELLS)
def test_a_quadratic_displacement_is_found_exactly(cell: str) -> None:
    """u = (x², x y, …) on the boundary, and the body force that makes it an equilibrium."""
    mesh = meshes(2)[cell]
    d, shear, lame = mesh.dim, 100.0 / 2.6, 100.0 * 0.3 / 1.3 / 0.4

    def exact(points: np.ndarray) -> np.ndarray:
        return 1e-2 * points[:, :1] * points

    # ε = sym(e₁ ⊗ x) + x₁ I, tr ε = (d + 1) x₁; div σ is constant.
    force = np.zeros(d)
    force[0] = -1e-2 * (shear * (d + 3) + lame * (d + 1))
    supports = [
        Support("body", side, tuple((lambda x, k=k: exact(x)[:, k]) for k in range(d)))
        for side in mesh.surfaces
    ]
    state = solved(
        Scene({"body": Body(mesh, material(mesh))}, supports, [BodyForce("body", tuple(force))]), parts=3
    )
    assert state.counts["subdomains"] == 3
    np.testing.assert_allclose(state.gather_displacement("body"), exact(mesh.points), atol=1e-11)


@pytest.mark.parametrize("cell", CELLS)
def test_a_uniform_pressure_is_uniform_on_quadratic_facets(cell: str) -> None:
    """The pressure is the nodal force by the nodal area, and forces of a pressure are not even."""
    mesh = meshes(2)[cell]
    d = mesh.dim
    up, low, high = (0.0,) * (d - 1) + (1.0,), "yz"[d - 2] + "0", "yz"[d - 2] + "1"
    sides = [Support("body", "x0", (0.0,) + (None,) * (d - 1))]
    if d == 3:
        sides.append(Support("body", "y0", (None, 0.0, None)))
    scene = Scene(
        {"body": Body(mesh, material(mesh))},
        sides,
        [Traction("body", high, tuple(-3.0 * np.array(up)))],
        [ContactPair(Surface("body", low), RigidPlane((0.0,) * d, up), Coulomb(0.0))],
    )
    contact = solved(scene, parts=2).contact
    assert contact.normal_force.max() > 1.9 * contact.normal_force.min()
    np.testing.assert_allclose(contact.pressure, 3.0, rtol=1e-8)


def test_energies_converge_twice_as_fast_as_those_of_linear_cells() -> None:
    """A smooth load on a block that supports hold without corners: energy errors h² against h⁴."""

    def energy(mesh: BodyMesh) -> float:
        supports = [Support("body", side, (0.0, 0.0)) for side in ("x0", "x1", "y0", "y1")]
        load = BodyForce("body", lambda x: np.sin(np.pi * x / 2) * (1.0, 0.0))
        return solved(Scene({"body": Body(mesh, material(mesh))}, supports, [load]), 2).energies.strain

    linear = [energy(rectangle((0, 0), (2, 1), (2 * n, n))) for n in (4, 8)]
    higher = [energy(quadratic(rectangle((0, 0), (2, 1), (2 * n, n)))) for n in (4, 8, 16)]
    exact = higher[2] + (higher[2] - higher[1]) / 15
    rates = [np.log2((exact - coarse) / (exact - fine)) for coarse, fine in (linear, higher[:2])]
    assert rates[0] == pytest.approx(2.0, abs=0.2)
    assert rates[1] > 3.0, "corners take a little off the four of a smooth solution"


def test_curved_quadratic_cells_find_the_contact_of_hertz_on_a_coarse_mesh() -> None:
    grading = 5.0
    theory = hertz.cylinder(hertz.edge(grading))
    guides = {"x0": (0.0, None, None), "y0": (None, 0.0, None), "y1": (None, 0.0, None)}
    linear = half_cylinder(1.0, hertz.LENGTH, 8, grading=grading)
    found = {}
    for name, mesh in (
        ("linear", linear),
        ("flat", quadratic(linear.with_shapes({}))),
        ("curved", quadratic(linear)),
    ):
        state = hertz.pressed(mesh, guides, theory.force * hertz.LENGTH / 2)
        found[name] = np.abs(hertz.errors(state, theory, (0,), 1 / 4))
    assert np.all(found["curved"] < 0.01)
    assert found["linear"][1] > 0.05
    assert found["flat"][0] > 0.1, "straight facets would do as well"


def test_files_and_pictures_show_quadratic_cells(tmp_path: Path) -> None:
    for name, mesh in meshes(1).items():
        d = mesh.dim
        up, low, high = (0.0,) * (d - 1) + (1.0,), "yz"[d - 2] + "0", "yz"[d - 2] + "1"
        scene = Scene(
            {"body": Body(mesh, material(mesh))},
            [Support("body", "x0", (0.0,) * d)],
            [Traction("body", high, tuple(-np.array(up)))],
            [ContactPair(Surface("body", low), RigidPlane((0.0,) * d, up))],
        )
        state = solved(scene, parts=2)
        write_vtu(state, tmp_path, name)
        (block_,) = meshio.read(tmp_path / f"{name}_body.vtu").cells
        assert block_.data.shape == mesh.cells.shape
        parts = state.torn.decomposition.partitions
        for picture in (
            plot_stress(state, tmp_path / f"{name}.png", width=500),
            plot_contact_pressure(state, tmp_path / f"{name}_pressure.png"),
            plot_decomposition(scene, parts, tmp_path / f"{name}_parts.png", width=500),
        ):
            assert Path(picture).stat().st_size > 2000


def test_mean_gaps_between_quadratic_facets_are_refused() -> None:
    low, high = rectangle((0, -1), (1, 0), (1, 1)), rectangle((0, 0), (1, 1), (2, 2))
    bodies = {"low": Body(quadratic(low), PlaneStrain(1.0, 0.3)), "high": Body(high, PlaneStrain(1.0, 0.3))}
    surfaces = Surface("high", "y0"), Surface("low", "y1")
    by_means = {"discretisation": "mortar"}
    for part in ({"contacts": [ContactPair(*surfaces, **by_means)]}, {"ties": [Tie(*surfaces, **by_means)]}):
        with pytest.raises(InvalidInputError, match=r"discretisation='mortar' needs linear cells .* 'y1': 2"):
            Scene(bodies, [Support("low", "y0", (0.0, 0.0))], **part)
    load = [TotalForce("high", "y1", (0.0, -1.0))]
    guides = [Support("low", "y0", (0.0, 0.0)), Support("high", "x0", (0.0, None))]
    state = solved(Scene(bodies, guides, load, [ContactPair(*surfaces)]), parts=1)
    assert state.contact.normal_force.sum() == pytest.approx(1.0)
