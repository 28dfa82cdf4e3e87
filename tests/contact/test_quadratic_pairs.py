"""Two bodies of quadratic cells by nodes: the master moves as its quadratic facets do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyForce,
    BodyMesh,
    ContactPair,
    Pressure,
    Scene,
    Support,
    Surface,
    Tie,
    solve_scene,
)
from fenics_contact._surfaces.true_surface import Geometry
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, NeoHooke, PlaneStrain
from fenics_contact.mesh import quadratic
from fenics_contact.qp import FaceNewton

#: Young's modulus, and Lamé's constants for Poisson's ratio 0.3.
YOUNG, SHEAR, LAME = 100.0, 100.0 / 2.6, 100.0 * 0.3 / 1.3 / 0.4
CELLS = ["tetrahedron", "hexahedron", "triangle", "quadrilateral"]


def stacked(cell: str, below: int, above: int) -> dict[str, BodyMesh]:
    """Two unit cubes or squares of so many quadratic cells a side, one on the other."""
    build, plane = (rectangle, 1) if cell in {"triangle", "quadrilateral"} else (block, 2)
    places = {"lower": (-1.0, 0.0, below), "upper": (0.0, 1.0, above)}
    return {
        name: quadratic(build((0.0,) * plane + (z0,), (1.0,) * plane + (z1,), (n,) * (plane + 1), cell=cell))
        for name, (z0, z1, n) in places.items()
    }


def bodies(meshes: dict[str, BodyMesh], poisson: float) -> dict[str, Body]:
    law = IsotropicElasticity if meshes["lower"].dim == 3 else PlaneStrain
    return {name: Body(mesh, law(YOUNG, poisson)) for name, mesh in meshes.items()}


def faces(dim: int) -> tuple[Surface, Surface]:
    """Names of the faces where upper and lower body meet."""
    return Surface("upper", "yz"[dim - 2] + "0"), Surface("lower", "yz"[dim - 2] + "1")


@pytest.mark.parametrize("cell", CELLS)
def test_a_quadratic_displacement_passes_a_tie_between_meshes_that_do_not_match(cell: str) -> None:
    """u = (x², x y, x z) / 100 on the boundary of two bodies, and its body force; the meshes are nested."""
    meshes = stacked(cell, 1, 2)
    dim = meshes["lower"].dim

    def exact(points: np.ndarray) -> np.ndarray:
        return np.asarray(1e-2 * points[:, :1] * points)

    force = (-1e-2 * (2 * SHEAR + (dim + 1) * (LAME + SHEAR)), *[0.0] * (dim - 1))
    upper, lower = faces(dim)
    supports = [
        Support(body.body, side, tuple((lambda x, k=k: exact(x)[:, k]) for k in range(dim)))
        for body in (upper, lower)
        for side in meshes[body.body].surfaces
        if side != body.name
    ]
    scene = Scene(
        bodies(meshes, 0.3),
        supports,
        [BodyForce(name, force) for name in meshes],
        ties=[Tie(upper, lower, discretisation="node")],
    )
    state = solve_scene(scene, MPI.COMM_SELF, solver=FaceNewton(tolerance=1e-11))
    places = meshes["upper"].points
    inside = np.all((places[:, :-1] > 0) & (places[:, :-1] < 1), axis=1) & (places[:, -1] == 0)
    assert np.count_nonzero(inside) > (4 if dim == 3 else 2)
    for name, mesh in meshes.items():
        np.testing.assert_allclose(state.gather_displacement(name), exact(mesh.points), atol=1e-9)


@pytest.mark.parametrize("cell", CELLS)
def test_forces_on_the_master_are_those_of_its_shape_functions(cell: str) -> None:
    """A uniform pressure stays so on matching meshes; on others it varies, but no node opens.

    With weights of linear pieces, on three cells over two of hexahedra it went from 0 to 1.56.
    """
    for below, above, largest in ((2, 2, 1e-7), (2, 3, 0.33)):
        meshes = stacked(cell, below, above)
        dim = meshes["lower"].dim
        upper, lower = faces(dim)
        rollers = [
            Support(name, "xy"[d] + "0", tuple(0.0 if k == d else None for k in range(dim)))
            for name in meshes
            for d in range(dim - 1)
        ]
        floor = Support("lower", lower.name[0] + "0", (None,) * (dim - 1) + (0.0,))
        scene = Scene(
            bodies(meshes, 0.0),
            [*rollers, floor],
            [Pressure("upper", upper.name[0] + "1", 1.0)],
            [ContactPair(upper, lower, discretisation="node")],
        )
        contact = solve_scene(scene, MPI.COMM_SELF, solver=FaceNewton(tolerance=1e-10)).contact
        assert contact.normal_force.sum() == pytest.approx(1.0)
        assert np.abs(contact.pressure - 1.0).max() < largest
        assert len(contact.pressure) > 4


def squeezed(cell: str, law: type, geometry: Geometry) -> np.ndarray:
    """Pressures between flat plates, three cells on two, of which hardly anything moves."""
    plane = cell in {"triangle", "quadrilateral"}
    build, flat = (rectangle, 1) if plane else (block, 2)
    parts = {
        name: quadratic(
            build((0.0,) * flat + (z0,), (1.0,) * flat + (z0 + 0.6,), (n,) * flat + (1,), cell=cell)
        )
        for name, z0, n in (("lower", -0.6, 2), ("upper", 0.0, 3))
    }
    upper, lower = faces(flat + 1)
    still = (None,) * flat
    supports = [
        Support(name, "xy"[d] + "0", tuple(0.0 if k == d else None for k in range(flat + 1)))
        for name in parts
        for d in range(flat)
    ]
    supports += [Support("lower", lower.name[0] + "0", (*still, 0.0))]
    supports += [Support("upper", upper.name[0] + "1", (*still, -1e-6))]
    pair = ContactPair(upper, lower, geometry=geometry, discretisation="node")
    held = {name: Body(mesh, law(1.0, 0.3)) for name, mesh in parts.items()}
    scene = Scene(held, supports, contacts=[pair])
    return solve_scene(scene, MPI.COMM_SELF, tolerance=1e-9).contact.pressure


@pytest.mark.parametrize("cell", CELLS)
def test_surfaces_that_slide_and_small_strains_agree_where_hardly_anything_moves(cell: str) -> None:
    """On the facets themselves but for 1e-6 of strain; smooth surfaces are as near to a uniform pressure."""
    small = IsotropicElasticity if cell in {"tetrahedron", "hexahedron"} else PlaneStrain
    facets, slid, smooth = (
        squeezed(cell, law, geometry)
        for law, geometry in ((small, "faceted"), (NeoHooke, "faceted"), (NeoHooke, "best"))
    )
    np.testing.assert_allclose(slid, facets, rtol=1e-4)
    assert np.abs(smooth / smooth.mean() - 1.0).max() < 1.2 * np.abs(facets / facets.mean() - 1.0).max()
    assert np.abs(smooth - facets).max() > 1e-3 * facets.mean(), "smooth surfaces have edges"


@pytest.mark.parametrize("cell", CELLS)
def test_a_master_of_quadratic_cells_that_nothing_faces_is_named(cell: str) -> None:
    meshes = stacked(cell, 1, 2)
    upper, lower = faces(meshes["lower"].dim)
    aside = replace(meshes["upper"], points=meshes["upper"].points + 5.0 * np.eye(meshes["lower"].dim)[0])
    scene = Scene(
        bodies({**meshes, "upper": aside}, 0.3), [Support("lower", lower.name.replace("1", "0"))],
        contacts=[ContactPair(upper, lower)],
    )  # fmt: skip
    with pytest.raises(InvalidInputError, match="needs slave nodes that face the master"):
        solve_scene(scene, MPI.COMM_SELF)
