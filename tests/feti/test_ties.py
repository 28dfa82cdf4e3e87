"""Tied surfaces, edges that they share with contact, and corners."""

from __future__ import annotations

import json
import logging
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    ContactProblem,
    Coulomb,
    FixedPoint,
    Pressure,
    RigidPlane,
    RigidSurface,
    Scene,
    State,
    Support,
    Surface,
    Tie,
    Traction,
    box_partition,
    solve_scene,
)
from fenics_contact._pairing.advice import ADVICE
from fenics_contact._pairing.search import find_tied_points
from fenics_contact._scene.pair_geometry import master_share
from fenics_contact.errors import InfeasibleError, InvalidInputError
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, NeoHooke, OrthotropicElasticity, PlaneStress
from fenics_contact.mesh import boundary_faces
from fenics_contact.qp import FaceNewton, Smalse
from fenics_contact.study import Parameters
from fenics_contact.study.scenes import hertz
from tests.feti.corner_cases import corner, planes
from tests.feti.corner_cases import solved as solved_corner
from tests.feti.half_tied import FREE, MATERIAL, TIED, TOP, half_tied, solved

STEEL = IsotropicElasticity(1000.0, 0.3)
FACES = Surface("upper", "z0"), Surface("lower", "z1")
PUSH = (0.3, 0.1, -1.0)


def tower(counts: tuple[int, int, int] = (4, 3, 2), **parts: object) -> Scene:
    """Two blocks upon each other, the lower one clamped, the upper one pushed."""
    lower, upper = block((0, 0, 0), (2, 1, 1), (4, 3, 2)), block((0, 0, 1), (2, 1, 2), counts)
    scene = Scene(
        {"lower": Body(lower, STEEL), "upper": Body(upper, STEEL)},
        [Support("lower", "z0")],
        [Traction("upper", "z1", PUSH)],
    )
    return replace(scene, **parts)


def cuts(scene: Scene) -> dict[str, np.ndarray]:
    return {name: box_partition(body.mesh, (2, 1, 1)) for name, body in scene.bodies.items()}


@pytest.mark.parametrize("discretisation", ["node", "mortar"])
def test_tied_matching_meshes_are_one_mesh(discretisation: str) -> None:
    scene = tower(ties=[Tie(*FACES, discretisation=discretisation)])
    tied = solve_scene(scene, MPI.COMM_SELF, partitions=cuts(scene), tolerance=1e-10)
    whole = block((0, 0, 0), (2, 1, 2), (4, 3, 4))
    one = Scene({"all": Body(whole, STEEL)}, [Support("all", "z0")], [Traction("all", "z1", PUSH)])
    state = solve_scene(
        one, MPI.COMM_SELF, partitions={"all": box_partition(whole, (2, 1, 1))}, tolerance=1e-10
    )
    expected = state.gather_displacement("all")
    for name, body in scene.bodies.items():
        found = tied.gather_displacement(name)
        place = [int(np.argmin(np.linalg.norm(whole.points - point, axis=1))) for point in body.mesh.points]
        np.testing.assert_allclose(found, expected[place], atol=1e-8 * np.abs(expected).max())


def test_a_tied_body_needs_no_other_hold_and_an_untied_one_is_refused() -> None:
    scene = tower((5, 4, 2), ties=[Tie(*FACES)])
    state = solve_scene(scene, MPI.COMM_SELF, partitions=cuts(scene), tolerance=1e-10)
    base = np.unique(scene.bodies["lower"].mesh.surfaces["z0"])
    assert state.counts["equality_multipliers"] > 0
    assert np.abs(state.gather_displacement("lower")[base]).max() < 1e-12
    with pytest.raises(InfeasibleError, match="body 'upper' can move away under the load"):
        solve_scene(replace(scene, ties=[]), MPI.COMM_SELF, partitions=cuts(scene), tolerance=1e-10)


def test_a_sliding_tie_holds_the_normal_direction_alone() -> None:
    glides = tower((5, 4, 2), ties=[Tie(*FACES, sliding=True)])
    with pytest.raises(InfeasibleError, match=r"body 'upper' can move away .* translation"):
        solve_scene(glides, MPI.COMM_SELF, partitions=cuts(glides), tolerance=1e-10)
    # Pulled apart, which contact would let go.
    guides = [Support("upper", "x0", (0.0, None, None)), Support("upper", "y0", (None, 0.0, None))]
    pulled = replace(
        glides, supports=[*glides.supports, *guides], loads=[Traction("upper", "z1", (0.0, 0.0, 1.0))]
    )
    state = solve_scene(pulled, MPI.COMM_SELF, partitions=cuts(pulled), tolerance=1e-10)
    low = np.unique(pulled.bodies["upper"].mesh.surfaces["z0"])
    high = np.unique(pulled.bodies["lower"].mesh.surfaces["z1"])
    above, below = state.gather_displacement("upper")[low], state.gather_displacement("lower")[high]
    assert above[:, 2].mean() == pytest.approx(below[:, 2].mean(), rel=1e-2)
    widths = [np.ptp(field[:, 0]) for field in (above, below)]
    assert min(widths) > 0.0


@pytest.mark.parametrize("discretisation", ["node", "mortar"])
@pytest.mark.parametrize("sliding", [True, False])
def test_only_a_tie_that_does_not_slide_drags_what_it_is_tied_to(sliding: bool, discretisation: str) -> None:
    """The upper block is moved along x as a whole; what it does to the lower one is all that deforms."""
    moved = [Support("lower", "z0"), Support("upper", "z1", (0.1, 0.0, 0.0))]
    ties = [Tie(*FACES, sliding=sliding, discretisation=discretisation)]
    scene = tower((5, 3, 3), supports=moved, loads=[], ties=ties)
    strain = solve_scene(scene, MPI.COMM_SELF, partitions=cuts(scene), tolerance=1e-10).energies.strain
    assert strain < 1e-12 if sliding else strain > 1e-2


def test_a_tie_beside_contact_leaves_the_contact_law_alone() -> None:
    """A tied tower that stands on a floor with friction bears the whole push there."""
    floor = ContactPair(Surface("lower", "z0"), RigidPlane((0, 0, 0), (0, 0, 1)), Coulomb(0.5))
    scene = tower((5, 4, 2), supports=[], ties=[Tie(*FACES)], contacts=[floor])
    state = solve_scene(scene, MPI.COMM_SELF, partitions=cuts(scene), tolerance=1e-10)
    np.testing.assert_allclose(state.contact.force.sum(axis=0), -2.0 * np.array(PUSH), rtol=1e-6)
    assert state.torn.ties.count == 30
    assert state.torn.n_equality == state.torn.n_gluing + 90


def test_supported_components_of_tied_nodes_are_left_to_the_support() -> None:
    roller = [Support("lower", "z0"), Support("upper", "x0", (0.0, None, None))]
    scene = tower((5, 4, 2), ties=[Tie(*FACES)], supports=roller)
    state = solve_scene(scene, MPI.COMM_SELF, partitions=cuts(scene), tolerance=1e-10)
    held = np.unique(scene.bodies["upper"].mesh.surfaces["x0"])
    assert np.abs(state.gather_displacement("upper")[held, 0]).max() < 1e-12
    assert state.torn.n_equality == state.torn.n_gluing + 90 - 5


@pytest.mark.parametrize("slave", [0, 1])
def test_a_master_that_only_a_held_slave_holds_is_told(slave: int, caplog: pytest.LogCaptureFixture) -> None:
    """The support keeps what it holds of the slave, and nothing holds the master there."""
    sides = FACES if slave == 0 else FACES[::-1]
    held = [Support("upper", "z0", (None, None, 0.0)), Support("lower", "z0", (0.0, 0.0, None))]
    scene = tower(supports=held, ties=[Tie(*sides)])
    fixed = np.concatenate([~np.isnan(scene.prescribed(name)) for name in scene.bodies])
    assert find_tied_points(scene, fixed, advice=ADVICE).count > 0
    warned = ["the master is free there" in record.message for record in caplog.records]
    assert any(warned) == (slave == 0)


def slit_ring(inner: float, outer: float, around: int, through: int) -> BodyMesh:
    """Return a ring that is slit along the x axis."""
    flat = rectangle((-2.0 * np.pi, inner), (0.0, outer), (around, through))
    angle, radius = flat.points.T
    points = np.column_stack([radius * np.cos(angle), -radius * np.sin(angle)])
    sides = {name: flat.surfaces[side] for name, side in (("start", "x1"), ("end", "x0"), ("bore", "y0"))}
    return BodyMesh(points, flat.cells, sides, coincident_nodes=True)


@pytest.mark.parametrize("discretisation", ["node", "mortar"])
def test_a_slit_ring_whose_ends_are_tied_is_a_ring(discretisation: str) -> None:
    """Its inside moves by Lamé's p a / E ((b² + a²) / (b² − a²) + ν); left open it would gape."""
    a, b, pressure = 1.0, 2.0, 0.5
    mesh = slit_ring(a, b, 96, 16)
    around = np.unique(mesh.surfaces["bore"])
    mesh = replace(mesh, node_sets={"above": around[[np.argmax(mesh.points[around, 1])]]})
    size = pressure * a / 1000.0 * ((b**2 + a**2) / (b**2 - a**2) + 0.3)
    held = [Support("ring", "start", (None, 0.0)), Support("ring", "above", (0.0, None))]
    closed = Tie(Surface("ring", "end"), Surface("ring", "start"), discretisation=discretisation)
    material = PlaneStress(1000.0, 0.3)
    scene = Scene({"ring": Body(mesh, material)}, held, [Pressure("ring", "bore", pressure)], ties=[closed])
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-9)
    moved = state.gather_displacement("ring")[around]
    radial = np.einsum("nd,nd->n", moved, mesh.points[around]) / a
    np.testing.assert_allclose(radial, size, rtol=5e-3)


@pytest.mark.parametrize("discretisation", ["node", "mortar"])
def test_a_tie_closes_a_slit_up_to_its_end(discretisation: str) -> None:
    """The node at the end of the slit is on both sides; the block is as if it were in one piece."""
    whole = block((0, 0, 0), (2, 1, 2), (2, 1, 2))
    side = np.flatnonzero((whole.points[:, 0] == 1.0) & (whole.points[:, 2] == 2.0))
    points = np.vstack([whole.points, whole.points[side]])
    right = (whole.points[whole.cells].mean(axis=1) > 1.0)[:, [0, 2]].all(axis=1)
    cells = whole.cells.copy()
    for number, node in enumerate(side):
        cells[np.ix_(right, range(8))] = np.where(cells[right] == node, whole.n_nodes + number, cells[right])
    faces, _ = boundary_faces(cells)
    inner = np.isclose(points[faces].mean(axis=1)[:, 0], 1.0)
    new = (faces >= whole.n_nodes).any(axis=1)
    sides = {"right": faces[inner & new], "left": faces[inner & ~new]}
    sides |= {name: whole.surfaces[name] for name in ("z0", "x1")}
    slit = BodyMesh(points, cells, sides, coincident_nodes=True)
    found = []
    for mesh, ties in ((whole, []), (slit, [Tie(Surface("b", "right"), Surface("b", "left"))])):
        ties = [replace(tie, discretisation=discretisation) for tie in ties]
        top = [Traction("b", "x1", PUSH)]
        scene = Scene({"b": Body(mesh, STEEL)}, [Support("b", "z0")], top, ties=ties)
        found.append(solve_scene(scene, MPI.COMM_SELF, tolerance=1e-10).gather_displacement("b"))
    np.testing.assert_allclose(found[1][: whole.n_nodes], found[0], rtol=1e-7, atol=1e-12)
    np.testing.assert_allclose(found[1][whole.n_nodes :], found[0][side], rtol=1e-7, atol=1e-12)


def test_a_surface_cannot_be_tied_to_itself() -> None:
    with pytest.raises(InvalidInputError, match="Tie needs two surfaces"):
        Tie(Surface("ring", "a"), Surface("ring", "a"))


def test_an_unknown_discretisation_is_refused() -> None:
    with pytest.raises(
        InvalidInputError, match=r"Tie.discretisation must be 'best' or 'node' or 'mortar', got 'x'"
    ):
        Tie(Surface("a", "s"), Surface("b", "s"), discretisation="x")  # type: ignore[arg-type]


def test_tied_surfaces_that_do_not_meet_are_refused() -> None:
    scene = tower()
    away = scene.moved({"upper": scene.bodies["upper"].mesh.points + np.array([5.0, 0.0, 0.0])})
    message = (
        "Tie 0 needs slave nodes that face the master, but none of the 20 movable nodes of 'z0' meets it"
    )
    with pytest.raises(InvalidInputError, match=message):
        solve_scene(replace(away, ties=[Tie(*FACES)]), MPI.COMM_SELF, partitions=cuts(away), tolerance=1e-10)


@pytest.mark.parametrize("edge", [1.5, 1.1])
def test_ties_by_nodes_beyond_the_masters_edge_are_told(
    edge: float, caplog: pytest.LogCaptureFixture
) -> None:
    """The last facet of the slave hangs over the edge: what the master transmits there is lost."""
    wide, narrow = block((0, 0, 1), (3, 1, 2), (6, 1, 1)), block((0, 0, 0), (edge, 1, 1), (4, 1, 2))
    bodies = {"wide": Body(wide, STEEL), "narrow": Body(narrow, STEEL)}
    over, under = Surface("wide", "z0"), Surface("narrow", "z1")

    def told(tie: Tie) -> list[str]:
        caplog.clear()
        free = np.zeros((wide.n_nodes + narrow.n_nodes, 3), dtype=bool)
        find_tied_points(Scene(bodies, ties=[tie]), free, advice=ADVICE)
        return [record.getMessage() for record in caplog.records]

    words = told(Tie(over, under, discretisation="node"))
    if edge == 1.5:  # edges of facets lie upon each other
        assert words == []
    else:
        (warning,) = words
        assert warning.startswith("the tie of wide z0 on narrow z1 is by nodes, and the master ends within")
        assert "only some of their nodes are tied, 12 % of the master's surface lies under them" in warning
    assert told(Tie(under, over, discretisation="node")) == []
    assert told(Tie(over, under)) == []


# Mortar between true surfaces: gaps that linear displacements of both bodies can close.
def pressed(size: int) -> Scene:
    return hertz.build(Parameters(size, discretisation="mortar"), MPI.COMM_SELF).scene


def missed(scene: Scene) -> float:
    """Relative error of the pressure in the middle, beside Hertz."""
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-6)
    middle = np.argmin(np.linalg.norm(state.contact_places[:, :2], axis=1))
    return float(state.contact.pressure[middle] / hertz.PEAK - 1)


@pytest.mark.parametrize("size", [2, 4])
def test_mirrored_bodies_are_as_exact_as_between_their_facets(size: int) -> None:
    scene = pressed(size)
    faceted = replace(scene, contacts=[replace(pair, geometry="faceted") for pair in scene.contacts])
    found = missed(scene)
    assert abs(found) < 0.005
    assert found == pytest.approx(missed(faceted), abs=1e-4)


def test_the_share_is_that_of_the_compliance() -> None:
    scene = pressed(2)
    (pair,) = scene.contacts
    assert master_share(scene, pair) == pytest.approx(0.5)
    lower = Body(scene.bodies["lower"].mesh, IsotropicElasticity(3 * hertz.YOUNG, hertz.POISSON))
    stiffer = replace(scene, bodies={**scene.bodies, "lower": lower})
    assert master_share(stiffer, pair) == pytest.approx(0.25)
    wood = OrthotropicElasticity((12e3, 800.0, 500.0), (0.4, 0.35, 0.3), (700.0, 600.0, 60.0))
    grown = replace(scene, bodies={**scene.bodies, "lower": Body(lower.mesh, wood)})
    assert master_share(grown, pair) == 0.5


# Edges between two contact pairs, or two ties: their nodes are points of one of them alone.
PARTS = ((1, 1), (2, 3), (6, 5))


def two_pairs(discretisation: str = "node", first: float = 0.4, columns: int = 5) -> Scene:
    """A block that is pressed on a strip, dragged, and rubs otherwise on its left half."""
    scene = half_tied(columns, discretisation, sliding=False)
    drag = RigidSurface("up", "y1", (0.7, 1.5), force=(2.1e-3, -1e-2), moment=-4e-4)
    pairs = [
        ContactPair(FREE, TOP, Coulomb(first), discretisation),
        ContactPair(TIED, TOP, Coulomb(0.1), discretisation),
    ]
    return replace(scene, ties=[], contacts=pairs, supports=[scene.supports[0], drag])


def of_rubber(discretisation: str = "node") -> Scene:
    scene = two_pairs(discretisation)
    bodies = {name: replace(body, material=NeoHooke(1.0, 0.3)) for name, body in scene.bodies.items()}
    held = [Support("low", "y0"), Support("up", "y1", (0.02, -0.02))]
    return replace(scene, bodies=bodies, supports=held)


@pytest.mark.parametrize("scene", [two_pairs(), two_pairs("mortar"), of_rubber(), of_rubber("mortar")])
def test_an_edge_between_two_contacts_has_one_answer_for_every_partition(scene: Scene) -> None:
    first, *others = (solved(scene, parts) for parts in (PARTS[:2] if scene.is_nonlinear else PARTS))
    expected, force = first.gather_displacement("up"), first.contact.force
    # Moving means over the facets of either side differ: both pairs keep theirs.
    both = scene.is_nonlinear and scene.contacts[0].by_mortar
    assert first.contact.points.count == 7 + both
    assert first.contact.points.area.sum() == pytest.approx(2.0)
    for other in others:
        found = other.gather_displacement("up")
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-7 * np.abs(expected).max())
        np.testing.assert_allclose(other.contact.force, force, rtol=0.0, atol=1e-6 * np.abs(force).max())


def on_edge(state: State) -> int:
    (edge,) = np.flatnonzero(np.isclose(state.contact_places[:, 0], 1.0, atol=0.05))
    return int(edge)


def test_the_edge_rubs_as_the_pair_named_first_and_its_pressure_fits_those_beside() -> None:
    scene = two_pairs()
    for pairs, friction in ((scene.contacts, 0.4), (scene.contacts[::-1], 0.1)):
        contact = (state := solved(replace(scene, contacts=pairs), (1, 1))).contact
        edge = on_edge(state)
        assert contact.slip_bound[edge] == pytest.approx(friction * contact.normal_force[edge])
        assert contact.points.pair[edge] == 0
        order = np.argsort(state.contact_places[:, 0])
        left, middle, right = contact.pressure[order[2:5]]
        assert middle == pytest.approx(0.5 * (left + right), rel=0.05)


def test_nodes_of_two_contacts_are_counted(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO, "fenics_contact"):
        solved(two_pairs(), (1, 1))
    words = "of low tied on up y0 leaves out 1 node, where force and friction are those of low free on up y0"
    assert words in caplog.text


@pytest.mark.parametrize(("turn", "depth", "count"), [(0.0, 1e-9, 7), (0.6, 0.0, 8), (0.0, 1e-3, 8)])
def test_a_corner_and_a_lower_obstacle_keep_their_points(turn: float, depth: float, count: int) -> None:
    """Two floors meet under the block: one plane, a roof of 34°, or one lower than the other."""
    mesh = rectangle((0.0, 0.0), (2.0, 1.0), (6, 3))
    base = mesh.surfaces["y0"]
    left = mesh.points[base].mean(axis=1)[:, 0] < 1.0
    mesh = replace(mesh, surfaces={**mesh.surfaces, "left": base[left], "right": base[~left]})
    planes = RigidPlane((1.0, 0.0), (0.0, 1.0)), RigidPlane((1.0, -depth), (np.sin(turn), np.cos(turn)))
    names = ("left", "right")
    pairs = [ContactPair(Surface("up", n), p) for n, p in zip(names, planes, strict=True)]
    scene = Scene({"up": Body(mesh, MATERIAL)}, [Support("up", "y1", (0.0, -0.01))], contacts=pairs)
    assert solve_scene(scene, MPI.COMM_SELF).contact.points.count == count


def test_the_same_surfaces_under_two_names_are_one_contact() -> None:
    scene = two_pairs()
    low = scene.bodies["low"]
    surfaces = {**low.mesh.surfaces, "again": low.mesh.surfaces["free"]}
    bodies = {**scene.bodies, "low": replace(low, mesh=replace(low.mesh, surfaces=surfaces))}
    turned = ContactPair(Surface("low", "again"), TOP, Coulomb(0.4), "node")
    points = solved(replace(scene, bodies=bodies, contacts=[*scene.contacts, turned]), (1, 1)).contact.points
    assert list(np.bincount(points.pair, minlength=3)) == [4, 3, 0]
    assert points.area.sum() == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("sliding", "kept"),
    [((False, False), [4, 3]), ((True, True), [4, 3]), ((True, False), [3, 4]), ((False, True), [4, 3])],
)
def test_an_edge_between_two_ties_is_tied_once(sliding: tuple[bool, bool], kept: list[int]) -> None:
    scene = two_pairs()
    ties = [
        Tie(s, TOP, sliding=slides, discretisation="node")
        for s, slides in zip((FREE, TIED), sliding, strict=True)
    ]
    held = [Support("low", "y0"), Support("up", "y1", (1e-3, 2e-3))]
    tied = [solved(replace(scene, contacts=[], ties=ties, supports=held), parts) for parts in PARTS]
    expected = tied[0].gather_displacement("up")
    for state in tied:
        assert list(np.bincount(state.torn.ties.pair, minlength=2)) == kept
        np.testing.assert_allclose(
            state.gather_displacement("up"), expected, rtol=0.0, atol=1e-8 * np.abs(expected).max()
        )


# Nodes in several pairs, whose rows contradict each other until one gives way.
def notes(state: State) -> str:
    return "\n".join(str(line) for line in state.solution.history)


@pytest.mark.parametrize(("friction", "push"), [(0.3, 0.002), (1.0, 0.0005), (3.0, 0.002)])
def test_a_wall_pushes_a_block_over_a_floor_that_it_sticks_to(friction: float, push: float) -> None:
    """More than 500 products while rows of the same node stood against each other; the last had no end."""
    state = solved_corner(corner(friction, push), MPI.COMM_SELF, FaceNewton(1e-9))
    assert "rows that contradict each other" in notes(state)
    assert "rescue" not in notes(state)
    assert 10 < state.solution.products < 45


def test_forces_beside_the_wall_are_those_of_another_solver() -> None:
    scene = corner(0.3, 0.002)
    found, other = (
        solved_corner(scene, MPI.COMM_SELF, way) for way in (FaceNewton(1e-9), FixedPoint(Smalse(1e-7)))
    )
    expected = other.contact.normal_force
    assert found.contact.normal_force == pytest.approx(expected, abs=1e-4 * expected.max())
    assert np.abs(found.contact.force).max() > 0.1


@pytest.mark.parametrize("friction", [None, 0.3])
def test_of_two_floors_the_upper_one_bears(friction: float | None) -> None:
    upper, lower = (RigidPlane((0.0, 0.0, z), (0.0, 0.0, 1.0)) for z in (0.0, -0.002))
    once = solved_corner(planes(("z0", upper, friction)), MPI.COMM_SELF, FaceNewton(1e-9))
    both = solved_corner(
        planes(("z0", upper, friction), ("z0", lower, friction)), MPI.COMM_SELF, FaceNewton(1e-9)
    )
    pressing = both.contact.normal_force.reshape(2, -1)
    assert pressing[0] == pytest.approx(once.contact.normal_force, abs=1e-7 * pressing.max())
    assert np.abs(pressing[1]).max() == 0.0
    assert both.solution.products < 40  # more than 250


def test_the_corner_is_the_same_on_two_ranks(mpirun: Any) -> None:
    ranks, products, force = json.loads(mpirun(Path(__file__).with_name("corner_cases.py"), 2))
    alone = solved_corner(corner(1.0, 0.002), MPI.COMM_SELF, FaceNewton(1e-9))
    assert (ranks, products) == (2, alone.solution.products)
    assert np.abs(np.array(force) - alone.contact.force).max() < 1e-9 * np.abs(force).max()


# Bodies of small strain that turn far beside others are told of.
def turned(angle: float) -> Scene:
    """A linear block whose lower side is turned, and a block of rubber that stays."""
    bodies = {
        "soft": Body(block((0, 0, 0), (1, 1, 1), (2, 2, 2)), NeoHooke(1.0, 0.3)),
        "hard": Body(block((2, 0, 0), (3, 1, 1), (2, 2, 2)), IsotropicElasticity(100.0, 0.3)),
    }
    turn = RigidSurface("hard", "z0", (2.5, 0.5, 0.0), (0, 0, 0), (0.6 * angle, 0.0, 0.8 * angle))
    return Scene(bodies, [Support("soft", "z0"), turn])


@pytest.mark.parametrize(("angle", "told"), [(0.01, False), (0.2, True)])
def test_a_linear_body_that_turns_far_is_told_of(
    angle: float, told: bool, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING, logger="fenics_contact"):
        solve_scene(turned(angle), MPI.COMM_SELF)
    assert ("body 'hard' has turned by 0.2 rad; its material is for small rotations" in caplog.text) is told
    assert "soft" not in caplog.text


def test_a_linear_body_alone_is_told_of_once(caplog: pytest.LogCaptureFixture) -> None:
    """In a scene without any large deformations, in one piece and cut."""
    beam = block((0, 0, 0), (6, 1, 1), (6, 1, 1))

    def scene(angle: float) -> Scene:
        turn = RigidSurface("beam", "x1", (6.0, 0.5, 0.5), (0, 0, 0), (0.0, 0.0, angle))
        return Scene({"beam": Body(beam, IsotropicElasticity(100.0, 0.3))}, [Support("beam", "x0"), turn])

    for partition in ({"beam": np.zeros(6, dtype=int)}, {"beam": np.arange(6) // 3}):
        caplog.clear()
        problem = ContactProblem(scene(0.7), MPI.COMM_SELF, partitions=partition)
        with caplog.at_level(logging.WARNING, logger="fenics_contact"):
            for angle in (0.01, 0.7, 0.8):
                problem.solve(scene(angle))
        (words,) = [record.getMessage() for record in caplog.records]
        assert words.startswith("body 'beam' has turned by ")
        assert words.endswith("give it a material for large deformations, such as StVenantKirchhoff")
