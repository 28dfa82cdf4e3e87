"""Mortar contact and ties of quadratic cells whose meshes do not match."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyForce,
    BodyMesh,
    ContactPair,
    Coulomb,
    Scene,
    State,
    Support,
    Surface,
    Tie,
    Traction,
    read_cad,
    solve_scene,
)
from fenics_contact.gallery import rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.mesh import quadratic
from fenics_contact.mesh.cell_types import CELL_TYPES, quadrature, shape_values
from fenics_contact.qp import FaceNewton
from fenics_contact.readers import gmsh_model
from fenics_contact.results import ContactResult
from tests.equilibrium.press_fits import BORE, INTERFERENCE, NU, RIM, SEAT, YOUNG, lame, press_fit
from tests.pairing.pressed_boxes import PRESSURE, boxes, chosen, pressed, unevenly

SOLVER = FaceNewton(tolerance=1e-11)
#: Facets with 3 and 6, 4 and 9 nodes.
FACES = [("tetrahedron", 1), ("tetrahedron", 2), ("hexahedron", 1), ("hexahedron", 2)]
PAIRS = [pair for pair in product(FACES, FACES) if max(pair[0][1], pair[1][1]) == 2]


def solved(scene: Scene) -> State:
    return solve_scene(scene, MPI.COMM_SELF, solver=SOLVER)


def mixed(
    upper: tuple[str, int], lower: tuple[str, int], cells: tuple[int, int] = (2, 3)
) -> dict[str, BodyMesh]:
    """A cube, or square, on another one, each of cells of its own."""
    return {
        "a": boxes(upper[0], *cells, order=upper[1])["a"],
        "b": boxes(lower[0], *cells, order=lower[1])["b"],
    }


@pytest.mark.parametrize(("slave", "master"), PAIRS)
def test_a_uniform_pressure_passes_between_all_pairs_of_surfaces(
    slave: tuple[str, int], master: tuple[str, int]
) -> None:
    state = solved(chosen(pressed(mixed(slave, master))))
    assert state.scene.contacts[0].reason == "mortar, as the meshes do not match"
    contact = state.contact
    assert np.all(contact.area > 0.0)
    np.testing.assert_allclose(contact.pressure, PRESSURE, rtol=1e-10)


@pytest.mark.parametrize("slave", ["a", "b"])
@pytest.mark.parametrize("orders", [(1, 2), (2, 1), (2, 2)])
def test_a_uniform_pressure_passes_between_edges(orders: tuple[int, int], slave: str) -> None:
    meshes = mixed(("triangle", orders[0]), ("quadrilateral", orders[1]), (4, 6))
    pressure = solved(chosen(pressed(meshes, slave, stiff=7.0))).contact.pressure
    np.testing.assert_allclose(pressure, PRESSURE, rtol=1e-10)


@pytest.mark.parametrize("cell", ["quadrilateral", "tetrahedron"])
def test_what_a_pressure_varies_by_nodes_it_does_not_by_mortar(cell: str) -> None:
    scene = pressed(boxes(cell, 2, 3))
    ranges = [np.ptp(solved(chosen(scene, how)).contact.pressure) for how in ("node", "best")]
    assert ranges[0] > 0.1 * PRESSURE
    assert ranges[1] < 1e-8 * PRESSURE


def test_quadratic_cells_that_match_are_by_nodes_and_others_are_not() -> None:
    for meshes, wanted in (
        (boxes("quadrilateral", 3, 3), "node, as the meshes match"),
        (boxes("quadrilateral", 3, 4), "mortar, as the meshes do not match"),
        # Nodes lie over nodes, but displacements between them are not the same.
        (mixed(("quadrilateral", 2), ("quadrilateral", 1), (3, 6)), "mortar, as the meshes do not match"),
    ):
        assert chosen(pressed(meshes)).contacts[0].reason == wanted


@pytest.mark.parametrize("cell", ["triangle", "quadrilateral", "tetrahedron", "hexahedron"])
def test_ties_transmit_any_constant_stress(cell: str) -> None:
    """A linear displacement on the boundary of two bodies, tied by means."""
    meshes = boxes(cell, 2, 3)
    dim = meshes["a"].dim
    gradient = 1e-2 * np.array([[1.0, 0.4, -0.3], [0.7, -0.5, 0.2], [-0.6, 0.8, 0.3]])[:dim, :dim]
    scene = pressed(meshes)
    (pair,) = scene.contacts
    ends = {"a": scene.loads[0].surface, "b": scene.supports[-1].surface}
    supports = [
        Support(name, side, tuple((lambda x, k=k: x @ gradient[k]) for k in range(dim)))
        for name, side in ends.items()
    ]
    tie = Tie(pair.slave, pair.master)
    # Sides have the tractions of the stress, with Poisson's ratio 0 that is E ε.
    strain = (gradient + gradient.T) / 2
    loads = [
        Traction(name, side, tuple((1 if side[1] == "1" else -1) * 1e3 * strain["xyz".index(side[0])]))
        for name in "ab"
        for side in [f"{axis}{end}" for axis in "xyz"[: dim - 1] for end in "01"]
    ]
    state = solved(replace(scene, supports=supports, loads=loads, contacts=[], ties=[tie]))
    assert state.scene.ties[0].reason == "mortar, as the meshes do not match"
    for name, mesh in meshes.items():
        np.testing.assert_allclose(state.gather_displacement(name), mesh.points @ gradient.T, atol=1e-11)


def held_strip(
    cells: int, slave: str, exact: Callable[[np.ndarray], np.ndarray], *, linear: bool = False, **more: Any
) -> Scene:
    """Tied squares of triangles on quadrilaterals, three cells on two, whose other sides are prescribed."""
    meshes = {
        "a": rectangle((0, 0), (1, 1), (3 * cells,) * 2, "triangle"),
        "b": rectangle((0, -1), (1, 0), (2 * cells,) * 2),
    }
    if not linear:
        meshes = {name: quadratic(mesh) for name, mesh in meshes.items()}
    values = tuple((lambda x, k=k: exact(x)[:, k]) for k in range(2))
    supports = [Support(n, side, values) for n, y in (("a", "y1"), ("b", "y0")) for side in ("x0", "x1", y)]
    sides = [Surface("a", "y0"), Surface("b", "y1")]
    tie = Tie(*(sides if slave == "a" else sides[::-1]), discretisation="mortar")
    return Scene({n: Body(m, PlaneStrain(1.0, 0.3)) for n, m in meshes.items()}, supports, ties=[tie], **more)


@pytest.mark.parametrize("slave", ["a", "b"])
@pytest.mark.parametrize("linear", [True, False], ids=["linear", "quadratic"])
def test_ends_of_the_slave_that_supports_hold_do_not_disturb_the_patch(slave: str, linear: bool) -> None:
    gradient = np.array([[0.01, 0.004], [0.007, -0.005]])
    scene = held_strip(2, slave, lambda x: x @ gradient, linear=linear)
    state = solved(scene)
    for name, body in scene.bodies.items():
        found = state.gather_displacement(name)
        np.testing.assert_allclose(found, body.mesh.points @ gradient, atol=1e-13)


SHEAR, LAME = 1.0 / 2.6, 0.3 / 1.3 / 0.4


def waves(x: np.ndarray) -> np.ndarray:
    return 0.1 * np.column_stack([np.sin(2 * x[:, 0]) * np.cos(x[:, 1]), np.cos(x[:, 0]) * np.sin(x[:, 1])])


def force_of_waves(x: np.ndarray) -> np.ndarray:
    """−μ Δu − (λ + μ) ∇ div u, with div u = (2 cos 2x + cos x) cos y / 10."""
    one, two = x.T
    by_one, by_two = (
        (-4 * np.sin(2 * one) - np.sin(one)) * np.cos(two),
        -(2 * np.cos(2 * one) + np.cos(one)) * np.sin(two),
    )
    laplacian = waves(x) * [-5.0, -2.0]
    return np.asarray(-SHEAR * laplacian - 0.1 * (LAME + SHEAR) * np.column_stack([by_one, by_two]))


@pytest.mark.parametrize("slave", ["a", "b"])
def test_displacements_of_linear_cells_converge_with_second_order_at_all_nodes(slave: str) -> None:
    """Without the dual functions of ends that supports hold, those next to them had first order."""
    errors = []
    for cells in (2, 4, 8):
        loads = [BodyForce(name, force_of_waves) for name in "ab"]
        scene = held_strip(cells, slave, waves, linear=True, loads=loads)
        state = solved(scene)
        miss = [state.gather_displacement(n) - waves(body.mesh.points) for n, body in scene.bodies.items()]
        errors.append(max(np.abs(each).max() for each in miss))
    assert np.all(np.log2(np.array(errors[:-1]) / errors[1:]) > 1.8), errors


@pytest.mark.parametrize(("slave", "order"), [("a", 2.9), ("b", 2.7)])
def test_displacements_converge_with_third_order(slave: str, order: float) -> None:
    """To u = (sin 2x cos y, cos x sin y) / 10 with its body force, in L2; the coarse slave costs a little."""
    errors = []
    for cells in (2, 4, 8):
        loads = [BodyForce(name, force_of_waves) for name in "ab"]
        scene = held_strip(cells, slave, waves, loads=loads)
        state, square = solved(scene), 0.0
        for name, body in scene.bodies.items():
            mesh, found = body.mesh, state.gather_displacement(name)
            places, weights = quadrature(CELL_TYPES[mesh.cell_type], 8)
            values = shape_values(CELL_TYPES[mesh.cell_type], places)
            at, moved = (np.einsum("qk,nkd->nqd", values, each[mesh.cells]) for each in (mesh.points, found))
            miss = moved - waves(at.reshape(-1, 2)).reshape(at.shape)
            square += (weights @ (miss**2).sum(axis=2).T).sum() / weights.sum() / len(mesh.cells)
        errors.append(np.sqrt(square))
    assert np.all(np.log2(np.array(errors[:-1]) / errors[1:]) > order), errors


def test_blocks_that_are_pressed_and_pushed_evenly_stick_evenly() -> None:
    """Pushed at the top and at the bottom; sides have the shear stress that balances the moment."""
    scene = chosen(pressed(boxes("tetrahedron", 2, 3)))
    (pair,), shear = scene.contacts, 10.0
    pushed = [("a", "z1", (shear, 0.0, 0.0)), ("a", "x1", (0.0, 0.0, shear)), ("a", "x0", (0.0, 0.0, -shear))]
    pushed += [("b", "x1", (0.0, 0.0, shear)), ("b", "x0", (0.0, 0.0, -shear))]
    held = [Support("b", "z0"), *(Support(name, "y0", (None, 0.0, None)) for name in "ab")]
    loads = [*scene.loads, *(Traction(*load) for load in pushed)]
    pair = replace(pair, friction=Coulomb(0.5))
    contact = solved(replace(scene, supports=held, loads=loads, contacts=[pair])).contact
    rubbed = np.linalg.norm(contact.friction_force, axis=1) / contact.area
    np.testing.assert_allclose(rubbed, shear, rtol=1e-9)
    np.testing.assert_allclose(contact.pressure, PRESSURE, rtol=1e-9)


def fitted(cells: int, slave: str, order: int = 2) -> ContactResult:
    """A ring on a hollow shaft with three facets on two, of so many cells around a quarter."""
    scene = press_fit(8 * cells, cells, outside=12 * cells, part=0.25, interference=INTERFERENCE)
    (pair,) = scene.contacts
    assert isinstance(pair.master, Surface)
    if slave == "shaft":
        pair = replace(pair, slave=pair.master, master=pair.slave)
    bodies = scene.bodies
    if order == 2:
        bodies = {n: replace(body, mesh=quadratic(body.mesh)) for n, body in bodies.items()}
    return solved(replace(scene, bodies=bodies, contacts=[replace(pair, discretisation="mortar")])).contact


def miss(contact: ContactResult) -> float:
    """Error of Lamé's pressure, in L2."""
    error = contact.pressure / lame() - 1.0
    return float(np.sqrt(contact.area @ error**2 / contact.area.sum()))


@pytest.mark.parametrize("slave", ["hub", "shaft"])
def test_pressures_of_a_press_fit_converge_with_second_order(slave: str) -> None:
    errors = [miss(fitted(cells, slave)) for cells in (2, 4)]
    assert np.log2(errors[0] / errors[1]) > 1.7
    assert errors[1] < 0.002
    assert errors[0] < miss(fitted(2, slave, order=1)) / 3.0


def test_a_press_fit_of_a_step_file_has_its_pressure_at_every_node(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Quarters of 10-node tetrahedra, 8 cells across the seat of the shaft, 10 of the hub's; 6 mm long."""
    with gmsh_model("fit") as gmsh:
        occ = gmsh.model.occ
        for inner, outer in ((BORE, SEAT), (SEAT, RIM)):
            parts = [occ.addCylinder(0, 0, 0, 0, 0, 6.0, r, angle=np.pi / 2) for r in (outer, inner)]
            occ.cut(*([(3, part)] for part in parts))
        occ.synchronize()
        gmsh.write(str(tmp_path / "fit.step"))
    capfd.readouterr()
    sizes = {"1": 6.0, "2": 4.5}
    round_, supports = {}, []
    meshes = read_cad(tmp_path / "fit.step", order=2, sizes=sizes)
    for name, mesh in meshes.items():
        for side, facets in mesh.surfaces.items():
            places = mesh.points[facets.ravel()]
            flat = np.ptp(places, axis=0) < 1e-9
            if flat.any():
                supports.append(Support(name, side, tuple(0.0 if across else None for across in flat)))
            elif np.allclose(np.linalg.norm(places[:, :2], axis=1), SEAT):
                round_[name] = Surface(name, side)
    steel = IsotropicElasticity(YOUNG, NU)
    pair = ContactPair(round_["1"], round_["2"], interference=INTERFERENCE)
    state = solved(Scene({n: Body(m, steel) for n, m in meshes.items()}, supports, contacts=[pair]))
    assert state.scene.contacts[0].reason == "mortar, as the meshes do not match"
    np.testing.assert_allclose(state.contact.pressure, lame(), rtol=0.03)


@pytest.mark.parametrize("ranks", [2, 4])
def test_ranks_have_the_same_pressures(ranks: int, mpirun: Callable[..., str]) -> None:
    code = """
        from mpi4py import MPI
        from fenics_contact import solve_scene
        from fenics_contact.qp import FaceNewton
        from tests.pairing.pressed_boxes import unevenly
        contact = solve_scene(unevenly(), MPI.COMM_WORLD, solver=FaceNewton(tolerance=1e-11)).contact
        if MPI.COMM_WORLD.rank == 0:
            print(*(float(p).hex() for p in contact.pressure))
    """
    alone = solved(unevenly()).contact
    assert alone.pressure.max() > PRESSURE
    assert alone.normal_force.sum() == pytest.approx(PRESSURE)
    found = [float.fromhex(p) for p in mpirun(code, ranks).split()]
    np.testing.assert_allclose(found, alone.pressure, rtol=1e-8, atol=1e-6)
