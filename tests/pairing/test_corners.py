"""A corner or an edge that presses, without friction, along the normal of the face that it touches."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from mpi4py import MPI

from fenics_contact import (
    AutomaticContact,
    Body,
    BodyMesh,
    ContactPair,
    ContactProblem,
    Coulomb,
    FluidPressure,
    LinearClosure,
    LoadStep,
    Scene,
    State,
    Support,
    Surface,
    solve_scene,
    solve_steps,
)
from fenics_contact._pairing.mortar.coupling import mortar_coupling
from fenics_contact._pairing.mortar.normals import normals_at
from fenics_contact._scene.choice import EXCHANGED
from fenics_contact._scene.discretisation import keeping_discretisation
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, Material, NeoHooke, PlaneStrain
from fenics_contact.results.resolution import CALL, CornerBetweenNodes, CornerKeptAway, FacetsOutside
from tests.pairing.mortar_surfaces import lattice

pytestmark = pytest.mark.filterwarnings("ignore::UserWarning")

TURN = np.radians(20.0)
MATERIALS = {"small": PlaneStrain(1000.0, 0.3), "large": NeoHooke(1000.0, 0.3)}


def turned_in_plane(mesh: BodyMesh, angle: float, under: tuple[str, ...]) -> BodyMesh:
    """The mesh turned about the corner at the origin, with all its named sides as one surface `under`."""
    c, s = np.cos(angle), np.sin(angle)
    points = mesh.points.copy()
    points[:, 0], points[:, -1] = (
        c * mesh.points[:, 0] - s * mesh.points[:, -1],
        s * mesh.points[:, 0] + c * mesh.points[:, -1],
    )
    surface = np.concatenate([mesh.surfaces[name] for name in under])
    return replace(mesh, points=points, surfaces={**mesh.surfaces, "under": surface})


def pressed(
    material: Material,
    slave: str,
    master: str,
    kind: str,
    cells: int = 5,
    angle: float = TURN,
    offset: float = 0.0,
) -> State:
    """A bar that stands on one of its corners on a level floor, offset along it, pressed by 0.05."""
    floor = rectangle((-2, -1), (2, 0), (8 * cells // 5 + 1, 4))
    floor = floor.moved(floor.points + np.array([offset, 0.0]))
    bar = turned_in_plane(rectangle((0, 0), (1, 2), (cells, 2 * cells)), angle, ("y0", "x0"))
    sides = Surface(*slave.split()), Surface(*master.split())
    pair = ContactPair(*sides, discretisation=kind)  # type: ignore[arg-type]
    supports = [Support("floor", "y0"), Support("bar", "y1", (0.0, -0.05))]
    bodies = {"floor": Body(floor, material), "bar": Body(bar, material)}
    return solve_scene(Scene(bodies, supports, contacts=[pair]), MPI.COMM_SELF)


@cache
def force_by_nodes(strain: str, cells: int = 5, angle: float = TURN, offset: float = 0.0) -> np.ndarray:
    """Return the force on the floor where nodes of the bar press it."""
    return force_on(pressed(MATERIALS[strain], "bar under", "floor y1", "node", cells, angle, offset))


def force_on(state: Any, name: str = "floor y0") -> np.ndarray:
    return np.asarray(state.reactions()[name].force)


def require_upright(force: np.ndarray, size: float) -> None:
    """A floor without friction is pressed straight down, by as much as nodes press it."""
    assert np.degrees(np.arctan2(abs(force[0]), force[-1])) < 1.0
    assert np.linalg.norm(force) == pytest.approx(size, rel=0.02)


@pytest.mark.parametrize("cells", [5, 20])
@pytest.mark.parametrize("strain", MATERIALS)
def test_a_corner_presses_along_the_normal_of_the_floor(strain: str, cells: int) -> None:
    material = MATERIALS[strain]
    size = np.linalg.norm(force_by_nodes(strain, cells))
    assert size > 5.0
    for slave in ("bar under", "bar y0"):
        state = pressed(material, slave, "floor y1", "mortar", cells)
        require_upright(force_on(state), float(size))


@pytest.mark.parametrize("master", ["bar under", "bar y0"])
@pytest.mark.parametrize("strain", MATERIALS)
def test_a_corner_of_the_master_between_nodes_of_the_slave_is_named(
    strain: str, master: str, caplog: pytest.LogCaptureFixture
) -> None:
    state = pressed(MATERIALS[strain], "floor y1", master, "node")
    (doubt,) = (each for each in state.peak_uncertainties if isinstance(each, CornerBetweenNodes))
    np.testing.assert_allclose(doubt.at, (0.0, 0.0), atol=0.06)
    assert 0.005 < doubt.depth <= doubt.moved < 0.06
    (words,) = (each for each in caplog.messages if "lies between nodes" in each)
    assert f"the contact of floor y1 on {master} lies between nodes: a corner of the master, at (" in words
    assert f"lies {doubt.depth:.2g} inside the slave" in words
    assert "exchange slave and master" in words
    assert CALL in words


@pytest.mark.parametrize("kind", ["node", "mortar"])
@pytest.mark.parametrize("strain", MATERIALS)
def test_a_corner_of_the_master_is_never_wrong_in_silence(strain: str, kind: str) -> None:
    """Wherever the nodes of the floor lie, and however steep the bar."""
    wrong = 0
    for angle, offset in ((20.0, 0.0), (45.0, -0.1), (70.0, -0.16)):
        there = {"angle": np.radians(angle), "offset": offset}
        state = pressed(MATERIALS[strain], "floor y1", "bar under", kind, **there)
        right = force_by_nodes(strain, **there)
        error = np.linalg.norm(force_on(state) - right) / np.linalg.norm(right)
        named = any(
            isinstance(each, CornerBetweenNodes | CornerKeptAway) for each in state.peak_uncertainties
        )
        assert error < 0.1 or named
        wrong += error > 0.1
    assert wrong


@pytest.mark.parametrize("strain", MATERIALS)
@pytest.mark.parametrize("cells", [5, 8])
def test_automatic_contact_takes_the_body_with_the_corner_for_the_slave(strain: str, cells: int) -> None:
    """A floor of cells half as wide would be the slave otherwise, and miss the corner or turn its force."""
    material = MATERIALS[strain]
    floor = rectangle((-2, -1), (2, 0), (8 * cells, 4))
    bar = turned_in_plane(rectangle((0, 0), (1, 2), (cells, 2 * cells)), TURN, ("y0", "x0"))
    supports = [Support("floor", "y0"), Support("bar", "y1", (0.0, -0.05))]
    bodies = {"floor": Body(floor, material), "bar": Body(bar, material)}
    state = solve_scene(Scene(bodies, supports, contacts=AutomaticContact()), MPI.COMM_SELF)
    assert [pair.slave.body for pair in state.scene.contacts] == ["bar"]
    by_nodes = ContactPair(Surface("bar", "under"), Surface("floor", "y1"), discretisation="node")
    right = solve_scene(Scene(bodies, supports, contacts=[by_nodes]), MPI.COMM_SELF)
    require_upright(force_on(state), float(np.linalg.norm(force_on(right))))


def floor_as_slave(
    strain: str = "small", bar: str = "bar under", bodies: tuple[str, ...] = ("floor", "bar"), **given: Any
) -> Scene:
    """The bar on its corner, the floor named as slave; some bodies whole supports hold."""
    floor, name = rectangle((-2, -1), (2, 0), (9, 4)), bar.split()[1]
    mesh = turned_in_plane(rectangle((0, 0), (1, 2), (5, 10)), TURN, ("y0", "x0"))
    made = {"floor": Body(floor, MATERIALS[strain]), "bar": Body(mesh, MATERIALS[strain])}
    pair = ContactPair(Surface("floor", "y1"), Surface("bar", name), **given)
    held = [] if "bar" in bodies else [Support("bar", name)]
    supports = [Support("floor", "y0"), Support("bar", "y1", (0.0, -0.05)), *held]
    return Scene(made, supports, contacts=[pair])


@pytest.mark.parametrize("cells", [5, 20])
@pytest.mark.parametrize("strain", MATERIALS)
def test_a_floor_named_as_slave_is_pressed_straight_down(
    strain: str, cells: int, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level("INFO"):
        state = pressed(MATERIALS[strain], "floor y1", "bar under", "best", cells)
    require_upright(force_on(state), float(np.linalg.norm(force_by_nodes(strain, cells))))
    (pair,) = state.scene.contacts
    assert pair.place == "bar under on floor y1"
    assert pair.reason == f"mortar, as the meshes do not match{EXCHANGED}"
    assert [contact.discretisation for contact in state.scene.plan().contacts] == [pair.reason]
    found = [each for each in caplog.messages if "exchanged" in each]
    words = "slave and master of floor y1 on bar under are exchanged, as a corner or an edge of bar under"
    assert found
    assert all(each.startswith(words) for each in found)


def test_a_corner_whose_face_is_steep_takes_the_place_of_the_floor_as_well() -> None:
    """By nodes then, as no facets face each other."""
    state = solve_scene(floor_as_slave(bar="bar x0"), MPI.COMM_SELF)
    (pair,) = state.scene.contacts
    assert pair.place == "bar x0 on floor y1"
    assert pair.reason.startswith("node, as no facets face each other")
    require_upright(force_on(state), float(np.linalg.norm(force_by_nodes("small"))))


@pytest.mark.parametrize(
    "given",
    [
        {"gap": 0.0},
        {"interference": lambda x: 0.0 * x[:, 0]},
        {"adjust": 0.01},
        {"friction": Coulomb(lambda x: 0.1 + 0.0 * x[:, 0])},
        {"friction": Coulomb(0.3, shear_limit=lambda x: 1.0 + 0.0 * x[:, 0])},
        {"fluid": FluidPressure(1.0, "x0")},
        {"discretisation": "mortar"},
        {"discretisation": "node"},
        {"bodies": ("floor",)},
    ],
    ids=lambda given: "".join(given),
)
def test_a_slave_stays_where_something_belongs_to_it_or_is_asked_for(given: dict[str, Any]) -> None:
    (pair,) = floor_as_slave(**given).contacts
    assert pair.slave == Surface("floor", "y1")
    assert EXCHANGED not in pair.reason


def test_pairs_of_both_orders_stay_as_they_are() -> None:
    scene = floor_as_slave(discretisation="node")
    given = ContactPair(Surface("floor", "y1"), Surface("bar", "under"))
    both = [given, replace(given, slave=given.master, master=given.slave)]
    assert [pair.slave.body for pair in replace(scene, contacts=both).contacts] == ["floor", "bar"]


def test_an_exchanged_pair_stays_so_in_load_steps_designs_and_other_meshes() -> None:
    scene = floor_as_slave("large", interference="measured", closure=LinearClosure(1e6))
    (pair,) = scene.contacts
    assert pair.reason.endswith(EXCHANGED)
    named = ContactPair(Surface("floor", "y1"), Surface("bar", "under"))
    rough = [replace(each, friction=Coulomb(0.1)) for each in (pair, named)]
    flat = scene.bodies["bar"].mesh.moved(rectangle((0, 0), (1, 2), (5, 10)).points)
    moved = {**scene.bodies, "bar": replace(scene.bodies["bar"], mesh=flat)}
    others = [
        replace(scene, bodies=moved),
        replace(keeping_discretisation(scene), bodies=moved),
        *(LoadStep("rough", contacts=[each]).applied_to(scene) for each in rough),
    ]
    assert [each.contacts[0].place for each in others] == ["bar under on floor y1"] * 4
    assert [each.contacts[0].reason.endswith(EXCHANGED) for each in others] == [True] * 4


def test_a_corner_of_the_master_that_is_kept_away_is_named(caplog: pytest.LogCaptureFixture) -> None:
    there = {"angle": np.radians(70.0), "offset": -0.16}
    state = pressed(MATERIALS["large"], "floor y1", "bar under", "mortar", **there)
    (doubt,) = (each for each in state.peak_uncertainties if isinstance(each, CornerKeptAway))
    corner = np.array(doubt.at)
    assert abs(corner[0]) < 0.05
    (words,) = (each for each in caplog.messages if "presses where nothing touches" in each)
    assert f"is kept {doubt.depth:.2g} away from the slave" in words
    assert "exchange slave and master" in words
    assert CALL in words


@pytest.mark.parametrize("strain", MATERIALS)
@pytest.mark.parametrize(("slave", "master"), [("bar y0", "floor y1"), ("floor y1", "bar y0")])
def test_edges_of_faces_that_lie_flat_are_no_corners_that_press(strain: str, slave: str, master: str) -> None:
    state = pressed(MATERIALS[strain], slave, master, "mortar", angle=0.0, offset=0.5)
    assert force_on(state)[1] > 10.0
    named = CornerBetweenNodes | CornerKeptAway
    assert not any(isinstance(each, named) for each in state.peak_uncertainties)


def test_faces_beside_a_corner_press_straight_down_as_well() -> None:
    """Where the mesh is fine, they touch, too: small displacements leave them as steep as they are."""
    by_mortar = force_on(pressed(MATERIALS["small"], "bar under", "floor y1", "mortar", 40))
    require_upright(by_mortar, float(np.linalg.norm(force_by_nodes("small", 40))))


def test_a_face_too_steep_to_face_the_floor_touches_by_its_nodes() -> None:
    size = np.linalg.norm(force_by_nodes("small"))
    state = pressed(MATERIALS["small"], "bar x0", "floor y1", "best")
    (pair,) = state.scene.contacts
    assert pair.reason == "node, as no facets face each other: corners or edges touch"
    require_upright(force_on(state), float(size))


@pytest.mark.parametrize(("cells", "passes"), [(16, False), (20, True)])
def test_a_steep_face_alone_is_right_or_the_face_that_passes_is_named(
    cells: int, passes: bool, caplog: pytest.LogCaptureFixture
) -> None:
    """With large strains and cells small enough the other face beside the corner touches, too."""
    size = np.linalg.norm(force_by_nodes("large", cells))
    caplog.clear()
    state = pressed(MATERIALS["large"], "bar x0", "floor y1", "best", cells)
    force = force_on(state)
    named = [FacetsOutside("bar x0 on floor y1", 1)] if passes else []
    assert [each for each in state.peak_uncertainties if isinstance(each, FacetsOutside)] == named
    words = "bodies 'floor' and 'bar' pass into each other at 1 facet, outside the surfaces of their pairs"
    assert any(each.startswith(words) for each in caplog.messages) == passes
    if not passes:
        return require_upright(force, float(size))
    assert np.linalg.norm(force) < 0.98 * size
    assert "outside the surfaces of bar x0 on floor y1 1 facet passes into" in str(state)


@pytest.mark.parametrize("angle", [35.0, 45.0])
def test_both_faces_of_a_corner_may_face_the_floor(angle: float) -> None:
    state = pressed(MATERIALS["small"], "bar under", "floor y1", "mortar", angle=np.radians(angle))
    force = force_on(state)
    assert abs(force[0]) < 1e-10 * force[1]


@pytest.mark.parametrize("cells", ["hexahedron", "tetrahedron"])
def test_an_edge_in_space_presses_along_the_normal_of_the_floor(cells: str) -> None:
    floor = block((-1, -0.5, -1), (1, 1.5, 0), (5, 5, 2), cells)
    bar = turned_in_plane(block((0, 0, 0), (1, 1, 1), (5, 3, 5), cells), TURN, ("z0", "x0"))
    material = IsotropicElasticity(1000.0, 0.3)
    forces, sides = {}, (Surface("bar", "under"), Surface("floor", "z1"))
    for kind, (slave, master) in (("node", sides), ("mortar", sides), ("best", sides[::-1])):
        pair = ContactPair(slave, master, discretisation=kind)  # type: ignore[arg-type]
        supports = [Support("floor", "z0"), Support("bar", "z1", (0.0, 0.0, -0.05))]
        scene = Scene({"floor": Body(floor, material), "bar": Body(bar, material)}, supports, contacts=[pair])
        forces[kind] = force_on(solve_scene(scene, MPI.COMM_SELF), "floor z0")
    assert np.linalg.norm(forces["node"]) > 1.0
    for kind in ("mortar", "best"):
        require_upright(forces[kind], float(np.linalg.norm(forces["node"])))


@pytest.mark.parametrize("strain", ["small", "large"])
def test_a_sharp_ring_presses_along_the_axis(strain: str) -> None:
    """A ring that stands on an edge: its forces on a level floor of revolution point along the axis."""
    material = IsotropicElasticity(1000.0, 0.3) if strain == "small" else NeoHooke(1000.0, 0.3)
    floor = rectangle((0, -1), (4, 0), (9, 4))
    ring = turned_in_plane(rectangle((0, 0), (1, 1), (5, 5)), TURN, ("y0", "x0"))
    ring = replace(ring, points=ring.points + np.array([2.0, 0.0]))
    forces, sides = {}, (Surface("ring", "under"), Surface("floor", "y1"))
    for kind, (slave, master) in (("node", sides), ("mortar", sides), ("best", sides[::-1])):
        pair = ContactPair(slave, master, discretisation=kind, geometry="faceted")  # type: ignore[arg-type]
        supports = [Support("floor", "y0"), Support("ring", "y1", (0.0, -0.05))]
        bodies = {
            "floor": Body(floor, material, axisymmetric=True),
            "ring": Body(ring, material, axisymmetric=True),
        }
        contact = solve_scene(Scene(bodies, supports, contacts=[pair]), MPI.COMM_SELF).contact
        forces[kind] = contact.normal_force @ contact.points.normal
    assert forces["node"][1] > 10.0
    for kind in ("mortar", "best"):
        require_upright(forces[kind], float(forces["node"][1]))


def test_a_tip_slides_along_a_floor_and_over_its_edge_as_by_nodes() -> None:
    """Its last hundredth on the floor included; beyond the edge, at 0.4, nothing presses."""
    floor = rectangle((-2, -1), (0.4, 0), (10, 4))
    bar = turned_in_plane(rectangle((0, 0), (1, 2), (5, 10)), TURN, ("y0", "x0"))
    bodies = {"floor": Body(floor, MATERIALS["large"]), "bar": Body(bar, MATERIALS["large"])}
    steps = [
        LoadStep(f"{x}", supports=[Support("floor", "y0"), Support("bar", "y1", (x, -0.05))])
        for x in (0.3, 0.36, 0.39, 0.5)
    ]
    forces = []
    for kind in ("node", "mortar"):
        pair = ContactPair(Surface("bar", "under"), Surface("floor", "y1"), discretisation=kind)  # type: ignore[arg-type]
        problem = ContactProblem(Scene(bodies, steps[0].supports, contacts=[pair]), MPI.COMM_SELF)
        forces.append([np.linalg.norm(force_on(state)) for state in solve_steps(problem, steps)])
    by_nodes, by_mortar = np.array(forces)
    assert by_nodes[2] > 5.0
    np.testing.assert_allclose(by_mortar, by_nodes, rtol=0.03, atol=1e-6)
    assert by_mortar[-1] < 1e-6


def test_an_edge_of_which_hardly_a_part_faces_the_master_keeps_its_normal() -> None:
    """A disc over the end of a level line: its facets that face the line turn by up to 60 degrees."""
    line = lattice(np.column_stack([np.linspace(0, 1, 11), np.zeros(11)]), "edges", False)
    line = replace(line, sharp=np.where(line.points[:, 0] == 1.0, 0.01, np.inf))
    around = np.linspace(-0.5 * np.pi - 1.2, -0.5 * np.pi + 1.2, 25)
    leaning = []
    for middle in (0.48, 0.5, 0.6):
        places = 0.5 * np.column_stack([np.cos(around), np.sin(around)]) + (middle, 0.5)
        coupling = mortar_coupling(line, lattice(places, "edges", True))
        assert coupling.node[-1] == 10
        leaning.append(np.degrees(np.arccos(-coupling.normal[-1, 1])))
    assert leaning[0] < 1e-3
    assert 1.0 < leaning[1] < leaning[2]
    assert leaning[2] == pytest.approx(53.0, abs=2.0), "as the disc over the end of the line"


def test_edges_on_planes_of_symmetry_have_normals_in_them() -> None:
    """A wall along the plane has none there: its edge keeps its own, the next node has the wall's."""
    line = lattice(np.array([[0.0, 0.0], [1.0, 0.0]]), "edges", False)
    line = replace(line, sharp=np.full(2, 0.1), mirrored=np.array([[True, False], [False, False]]))
    wall = lattice(np.array([[0.0, 0.0], [0.0, 1.0]]), "edges", False)
    normal = normals_at(line, wall, np.arange(2), sp.identity(2, format="csr"), np.ones(2))
    np.testing.assert_allclose(np.abs(wall.normals), [[1.0, 0.0]] * 2, atol=1e-12)
    np.testing.assert_allclose(normal, [-line.normals[0], wall.normals[1]], atol=1e-12)
