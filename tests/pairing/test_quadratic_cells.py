"""Quadratic cells in contact."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
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
    Pressure,
    RigidPlane,
    Scene,
    State,
    Support,
    Surface,
    Tie,
    TotalForce,
    Traction,
    contact_area,
    solve_scene,
    write_vtu,
)
from fenics_contact._surfaces.facets import filled_at_corners
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, half_cylinder, rectangle
from fenics_contact.materials import IsotropicElasticity, NeoHooke, PlaneStrain
from fenics_contact.mesh import bisection_partition, quadratic
from fenics_contact.pictures import plot_contact_pressure, plot_decomposition, plot_stress
from fenics_contact.qp import FaceNewton
from fenics_contact.study.scenes.hertz import POISSON, RADIUS, round_block
from fenics_contact.study.scenes.hertz import YOUNG as QUADRATIC_TETRAHEDRA_YOUNG
from tests.equilibrium import hertz

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


# Two bodies of quadratic cells by nodes: the master moves as its quadratic facets do.

#: Young's modulus, and Lamé's constants for Poisson's ratio 0.3.
YOUNG, SHEAR, LAME = 100.0, 100.0 / 2.6, 100.0 * 0.3 / 1.3 / 0.4
PAIRED_CELLS = ["tetrahedron", "hexahedron", "triangle", "quadrilateral"]


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


@pytest.mark.parametrize("cell", PAIRED_CELLS)
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


@pytest.mark.parametrize("cell", PAIRED_CELLS)
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


def squeezed(cell: str, law: type, geometry: str) -> np.ndarray:
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


@pytest.mark.parametrize("cell", PAIRED_CELLS)
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


@pytest.mark.parametrize("cell", PAIRED_CELLS)
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


# Quadratic tetrahedra, whose facets bear on the midpoints of edges, find what quadratic hexahedra find.
ACCURATE = FaceNewton(tolerance=1e-8)
FORCE = 4 * (QUADRATIC_TETRAHEDRA_YOUNG / (1 - POISSON**2)) / (3 * RADIUS)
PEAK = 3 * FORCE / (2 * np.pi)


@cache
def ball_on_floor(cell: str, curved: bool = True) -> State:
    """A quarter of a round block on a rigid floor; the radius of the contact is 1, three quadratic cells."""
    mesh = round_block(1.0, 1.0, 3 if curved else 6, cell)
    mesh = quadratic(mesh) if curved else mesh
    guides: dict[str, tuple[float | None, ...]] = {side: (0.0, None, None) for side in ("x0", "x1")}
    guides |= {side: (None, 0.0, None) for side in ("y0", "y1")}
    scene = Scene(
        {"ball": Body(mesh, IsotropicElasticity(QUADRATIC_TETRAHEDRA_YOUNG, POISSON))},
        [Support("ball", side, value) for side, value in guides.items()],
        [TotalForce("ball", "z1", (0.0, 0.0, -FORCE / 4))],
        [ContactPair(Surface("ball", "z0"), RigidPlane((0, 0, 0), (0, 0, 1)))],
    )
    return solve_scene(scene, MPI.COMM_SELF, solver=ACCURATE)


def found(state: State) -> dict[str, float]:
    """Peak p0 of the law p² = p0² (1 − r²/a²) fitted to the pressures, radius and approach."""
    contact, mesh = state.contact, state.scene.bodies["ball"].mesh
    square = (mesh.points[contact.points.slave][:, :2] ** 2).sum(axis=1)
    weight = np.sqrt(contact.points.area) * ((contact.status > 0) & (square < 0.64))
    rows = np.column_stack([np.ones_like(square), -square]) * weight[:, None]
    fitted = np.linalg.lstsq(rows, contact.pressure**2 * weight, rcond=None)[0]
    moment = contact.normal_force @ square / contact.normal_force.sum()
    top = np.unique(mesh.surfaces["z1"])
    return {
        "peak": float(np.sqrt(fitted[0])) / PEAK,
        "radius": float(np.sqrt(2.5 * moment)),
        "approach": -float(state.gather_displacement("ball")[top, 2].mean()),
    }


def test_tetrahedra_and_hexahedra_agree_on_the_contact_of_hertz() -> None:
    tetrahedra, hexahedra = found(ball_on_floor("tetrahedron")), found(ball_on_floor("hexahedron"))
    for key, value in tetrahedra.items():
        assert value == pytest.approx(hexahedra[key], rel=0.02), key
    assert tetrahedra["peak"] == pytest.approx(1.0, abs=0.02)
    assert tetrahedra["radius"] == pytest.approx(1.0, abs=0.01)
    linear = found(ball_on_floor("tetrahedron", curved=False))
    assert abs(linear["approach"] / hexahedra["approach"] - 1) > 0.02, "linear ones would do as well"


def test_the_largest_pressure_and_the_area_are_those_of_hertz() -> None:
    state = ball_on_floor("tetrahedron")
    assert state.contact.pressure.max() == pytest.approx(PEAK, rel=0.03)
    assert 4 * contact_area(state) == pytest.approx(np.pi, rel=0.04)
    mesh, points = state.scene.bodies["ball"].mesh, state.contact.points.slave
    corners = np.unique(mesh.surfaces["z0"][:, :3])
    assert not np.isin(corners, points).any()
    pressure = state.gather_fields("ball").points["contact_pressure"]
    radius = np.linalg.norm(mesh.points[corners][:, :2], axis=1)
    hertz = PEAK * np.sqrt(np.maximum(1 - radius**2, 0))
    np.testing.assert_allclose(pressure[corners], hertz, atol=0.35 * PEAK)
    assert np.all(pressure[corners][radius < 0.8] > 0.5 * hertz[radius < 0.8])
    assert np.all(pressure[corners][radius > 1.5] == 0.0)


def test_values_at_corners_are_those_of_quadratic_fields() -> None:
    """Around the centre of a regular hexagon: six triangles."""
    angle = np.arange(6) * np.pi / 3
    outer = np.column_stack([np.cos(angle), np.sin(angle)])
    following = np.roll(outer, -1, axis=0)
    points = np.concatenate([[[0.0, 0.0]], outer, outer / 2, (outer + following) / 2])
    k = np.arange(6)
    facets = np.column_stack([0 * k, 1 + k, 1 + (k + 1) % 6, 7 + k, 13 + k, 7 + (k + 1) % 6])
    values = np.stack([2.0 - (points**2).sum(axis=1), 1.0 + points[:, 0] * points[:, 1]], axis=1)
    given = values.copy()
    given[:7] = np.nan
    np.testing.assert_allclose(filled_at_corners(facets, given)[0], values[0])
    np.testing.assert_array_equal(filled_at_corners(facets, given)[7:], values[7:])
    np.testing.assert_array_equal(filled_at_corners(facets[:, :3], given), given)


def test_a_pushed_block_rubs_and_its_supports_bear_the_rest() -> None:
    """Friction on all contact points, and reactions on the corners of facets too."""
    mesh = quadratic(block((0, 0, 0), (2, 1, 1), (4, 2, 2), cell="tetrahedron"))
    scene = Scene(
        {"pad": Body(mesh, IsotropicElasticity(100.0, 0.3))},
        [Support("pad", "x1", (0.2, None, None)), Support("pad", "y0", (None, 0.0, None))],
        [TotalForce("pad", "z1", (0.0, 0.0, -6.0))],
        [ContactPair(Surface("pad", "z0"), RigidPlane((0, 0, 0), (0, 0, 1)), Coulomb(0.25))],
    )
    state = solve_scene(scene, MPI.COMM_SELF, solver=ACCURATE)
    assert state.contact.normal_force.sum() == pytest.approx(6.0)
    assert scene.plan().multipliers["normal"] == state.contact.points.count
    pull, rubbed = state.reactions()[0].force[0], state.contact.force.sum(axis=0)[0]
    assert pull == pytest.approx(-rubbed, rel=1e-6), "corners of the support's facets bear too"
    assert pull == pytest.approx(0.25 * 6.0, rel=1e-3)
