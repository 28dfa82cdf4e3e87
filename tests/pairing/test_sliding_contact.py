"""Contact on surfaces that slide: points, means, slip and derivatives, on any number of ranks."""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, ContactPair, MovingObstacle, RigidCylinder, RigidPlane, Scene, Surface
from fenics_contact._pairing.points import movable
from fenics_contact._pairing.search import find_contact_points
from fenics_contact._pairing.sliding.closest import ClosestPoints
from fenics_contact._pairing.sliding.contact import SlidingContact
from fenics_contact._pairing.sliding.meeting import Moved
from fenics_contact._pairing.sliding.patches import SmoothPatches
from fenics_contact._pairing.sliding.points import SlidingPoints
from fenics_contact._pairing.sliding.slip import LastPoints, MaterialPoints
from fenics_contact._pairing.sliding.stiffness import spread
from fenics_contact._pairing.sliding.surfaces import OnItself, OnOwnBody
from fenics_contact._surfaces.facets import faceted_surface
from fenics_contact._surfaces.projection import Projection
from fenics_contact.errors import InvalidInputError
from tests.pairing.sliding_scenes import (
    KINDS,
    arched,
    derivative_error,
    free,
    half_on_arch,
    on_arch,
    on_patches,
    ring,
    rotation,
    same_points,
    shaken,
    sliding,
)

RADIUS = 1.5
#: Largest jump of the normal at an edge, in radians, where facets turn by 0.17.
JUMPS = {"hexahedron": 1e-8, "tetrahedron": 1e-5, "quadrilateral": 1e-8, "triangle": 1e-8}


#: A surface that is its own master, and its parts.
ROOF_AND_FLOOR = (("inner", "inner"), ("roof", "floor"), ("floor", "roof"))

#: Angles, so far apart that any direction in space turns its sign between some of them.
TURNS = (0.0, 0.6, 1.9, 3.3, 4.7)


def squashed_and_turned(kind: str, sides: tuple[str, str], angle: float) -> SlidingPoints:
    """The points of a ring squashed to a fifth, which had been turned before."""
    scene = ring(kind, sides)
    turn, body = rotation(scene.dim, angle), scene.bodies["ring"]
    mesh = replace(body.mesh, points=body.mesh.points @ turn.T)
    factors = np.ones(scene.dim)
    factors[0], factors[-1] = 1.2, 0.2
    turned = replace(scene, bodies={"ring": replace(body, mesh=mesh)})
    return sliding(turned).at(scene.points * factors @ turn.T)


def slid_over(kind: str, cells: int, geometry: str = "best") -> tuple[Projection, np.ndarray]:
    """Slide a node along an arched master: closest points, and the true normals of the cylinder."""
    meeting = on_patches(sliding(on_arch(kind, master_cells=cells, geometry=geometry)))
    scene = on_arch(kind, master_cells=cells)
    points, patches = scene.points[meeting.master.nodes], meeting.patches
    path = np.linspace(-0.5, 0.5, 1001)
    way = np.zeros((len(path), scene.dim))
    way[:, 0] = path
    way[:, 1:-1] = 0.11 + 0.07 * path[:, None]
    normals = np.zeros_like(way)
    normals[:, 0], normals[:, -1] = np.sin(path / RADIUS), np.cos(path / RADIUS)
    search = ClosestPoints(patches, points, patches.coefficients(points))
    none = np.full(len(path), -1), np.zeros((len(path), scene.dim - 1))
    found = search.find(arched(way), -normals, *none)
    assert np.array_equal(found.point, np.arange(len(path)))
    return found, normals


@pytest.mark.parametrize("kind", KINDS)
def test_a_node_that_slides_over_an_arch_meets_no_edges(kind: str) -> None:
    errors = []
    for cells in (8, 16):
        found, normals = slid_over(kind, cells)
        across = np.diff(found.facet) != 0
        assert np.count_nonzero(across) >= 3
        turns = np.linalg.norm(np.diff(found.normal, axis=0), axis=1) - 1e-3 / RADIUS
        if cells == 8:
            assert turns[across].max() < JUMPS[kind]
            assert np.abs(found.gap).max() < 5e-6
        errors.append(np.linalg.norm(found.normal - normals, axis=1).max())
    assert errors[0] > 4 * errors[1]
    facets, _ = slid_over(kind, 8, "faceted")
    across = np.diff(facets.facet) != 0
    assert np.linalg.norm(np.diff(facets.normal, axis=0), axis=1)[across].max() > 0.15
    assert np.abs(facets.gap).max() > 5e-3


def test_beyond_the_centre_of_a_hollow_there_is_no_closest_point() -> None:
    """The foot there is the farthest point of the arc, not the closest."""
    angle = np.linspace(-1.0, 1.0, 16)  # the search starts in the middle of a facet, at the foot
    points = np.column_stack([np.sin(angle), -np.cos(angle)])
    arc = faceted_surface(points, np.column_stack([np.arange(15), np.arange(1, 16)])[:, ::-1])
    patches = SmoothPatches.of(arc)
    search = ClosestPoints(patches, points, patches.coefficients(points))
    for height, count in ((-0.5, 1), (-0.1, 1), (0.1, 0), (0.5, 0)):
        target = np.array([[0.0, height]])
        found = search.find(target, np.array([[0.0, -1.0]]), np.full(1, -1), np.zeros((1, 1)))
        assert len(found.point) == count
        assert found.gap == pytest.approx(np.full(count, 1.0 + height), abs=1e-3)


def test_a_crease_stays_a_crease() -> None:
    """A roof keeps its ridge: the normals on its two sides are those of the sides."""
    points = np.array([[float(x), abs(float(x) - 4.0) * -0.9] for x in range(9)])
    roof = faceted_surface(points, np.column_stack([np.arange(1, 9), np.arange(8)]))
    patches = SmoothPatches.of(roof)
    assert np.abs(patches.coefficients(roof.points)[:, 2:]).max() < 1e-12


@pytest.mark.parametrize("kind", KINDS)
def test_rigid_motions_change_nothing(kind: str) -> None:
    scene = on_arch(kind)
    contact, x = sliding(scene), shaken(scene)
    now = contact.at(x)
    for axis in range(3 if scene.dim == 3 else 1):
        turn = rotation(scene.dim, np.pi / 2, axis)
        then = contact.at(x @ turn.T + 0.3, now)
        assert same_points(now, then)
        assert then.points.gap == pytest.approx(now.points.gap, abs=1e-13)
        assert then.points.normal == pytest.approx(now.points.normal @ turn.T, abs=1e-12)


def test_the_gaps_are_those_of_small_displacements_before_anything_moves() -> None:
    scene = on_arch("hexahedron")
    first = find_contact_points(scene, free(scene))
    now = sliding(scene).at(scene.points)
    assert np.array_equal(now.points.slave, first.slave)
    assert now.points.gap == pytest.approx(first.gap, abs=1e-5)
    assert now.points.gap == pytest.approx(0.03, abs=1e-5)
    assert np.array_equal(now.points.area, first.area)


def test_a_node_keeps_its_facet_until_it_is_well_beyond_the_edge() -> None:
    scene = on_arch("quadrilateral")
    contact = sliding(scene)
    now, x, changes = contact.at(scene.points), scene.points.copy(), 0
    high = slice(0, scene.bodies["high"].mesh.n_nodes)
    edges = []
    for step in range(80):
        x[high, 0] += 0.005 * (1 if step < 40 else -1)
        then = contact.at(x, now)
        flipped = then.points.facet != now.carry(now.points.facet, now)
        edges.append(np.abs(then.points.local[~flipped]).max())
        changes, now = changes + np.count_nonzero(flipped), then
    assert 4 <= changes <= 12
    assert max(edges) <= 1.0 + 1e-6
    # On the edge itself, a hair to either side changes nothing.
    node = int(np.argmax(np.abs(now.points.local[:, 0])))
    way = now.points.tangents[node, 0] * np.sign(now.points.local[node, 0])
    x[now.points.slave[node]] += way * 1e-9 * np.array([1.0, 1.0])
    assert contact.at(x, now).points.facet[node] == now.points.facet[node]


def test_a_node_between_two_facets_does_not_change_sides_for_ever() -> None:
    scene = on_arch("quadrilateral")
    contact, x = sliding(scene), scene.points.copy()
    meeting = on_patches(contact)
    ridge = meeting.master.nodes[np.argmax(x[meeting.master.nodes, 1])]
    slave = meeting.nodes[2]
    sides: dict[bool, set[int]] = {True: set(), False: set()}
    now = None
    for side in (1, -1, 1, -1):
        x[slave] = x[ridge] + [side * 2e-8, 0.01]
        now = contact.at(x, now)
        for held, points in ((True, now.points), (False, contact.at(x).points)):
            sides[held].add(int(points.facet[points.slave == slave][0]))
    assert len(sides[True]) == 1
    assert len(sides[False]) == 2


def test_nodes_leave_the_rim_and_come_back() -> None:
    scene = on_arch("hexahedron")
    contact, x = sliding(scene), scene.points.copy()
    high = slice(0, scene.bodies["high"].mesh.n_nodes)
    all_there = contact.at(x)
    x[high, 1] += 0.5
    partly = contact.at(x, all_there)
    assert 0 < partly.points.count < all_there.points.count
    assert set(partly.key) < set(all_there.key)
    carried = partly.carry(np.arange(all_there.points.count) + 1.0, all_there)
    assert np.array_equal(carried - 1.0, np.searchsorted(all_there.key, partly.key))
    x[high, 1] += 5.0
    gone = contact.at(x, partly)
    assert gone.points.count == 0
    assert gone.stiffness(np.zeros(0)).assembled().nnz == 0
    x[high, 1] -= 5.5
    back = contact.at(x, gone)
    assert same_points(back, all_there)


@pytest.mark.parametrize("kind", ["hexahedron", "tetrahedron"])
def test_nodes_on_a_plane_of_symmetry_do_not_slip_across_it(kind: str) -> None:
    scene = half_on_arch(kind)
    fixed = np.concatenate([scene.fixed(name) for name in scene.body_names])
    contact = SlidingContact.of(scene, fixed)
    x = scene.points * [1.0, 1.1, 1.0]
    x[: scene.bodies["high"].mesh.n_nodes, 1] += 0.07
    now = contact.at(x).points
    cut = np.abs(x[now.slave, 0]) < 1e-12
    assert np.count_nonzero(cut) >= 4
    assert np.array_equal(now.symmetric, np.column_stack([cut, 0 * cut, 0 * cut]).astype(bool))
    assert np.abs(now.normal[cut, 0]).max() < 0.01
    assert movable(now, fixed)[cut, 0].sum() == 0
    assert (np.abs(now.tangents[cut, 1]) @ [1.0, 0.0, 0.0]).max() < 0.01


def test_nodes_beyond_the_reach_need_no_point() -> None:
    scene = on_arch("hexahedron")
    x = scene.points.copy()
    high = slice(0, scene.bodies["high"].mesh.n_nodes)
    x[high, 2] += 0.1 * x[high, 0]
    near, every = sliding(scene, reach=0.03).at(x), sliding(scene).at(x)
    assert 0 < near.points.count < every.points.count
    assert np.array_equal(near.key, every.key[every.points.gap <= 0.03])
    x[high, 2] += 3.0
    assert sliding(scene, reach=0.03).at(x, near).points.count == 0


@pytest.mark.parametrize("kind", KINDS)
def test_sides_of_a_body_beyond_the_reach_of_each_other_need_no_point(kind: str) -> None:
    scene = ring(kind, ("top", "bottom"))
    assert sliding(scene, reach=0.03).at(scene.points).points.count == 0


def test_given_gaps_are_kept_while_bodies_slide() -> None:
    scene = on_arch("hexahedron")
    given = replace(scene, contacts=[replace(scene.contacts[0], gap=0.005)])
    measured, moved = sliding(scene).at(shaken(scene)), sliding(given).at(shaken(given))
    assert moved.points.distance == pytest.approx(measured.points.gap, abs=1e-14)
    first = sliding(scene).at(scene.points).points.gap
    assert moved.points.gap == pytest.approx(measured.points.gap - first + 0.005, abs=1e-14)
    assert moved.points.given.all()


@pytest.mark.parametrize("kind", KINDS)
def test_a_squashed_ring_meets_itself_inside_and_never_through_its_wall(kind: str) -> None:
    scene = ring(kind)
    contact = sliding(scene)
    round_ring = contact.at(scene.points)
    assert round_ring.points.gap.min(initial=np.inf) > 0.5
    flat = scene.points * ([1.2, 0.2] if scene.dim == 2 else [1.2, 1.0, 0.2])
    now = contact.at(flat, round_ring)
    middle = np.abs(flat[now.points.slave, 0]) < 0.4
    assert np.count_nonzero(middle) >= 4
    assert now.points.gap.min() > 0.0
    opposite = 2 * np.abs(flat[now.points.slave[middle], -1])
    assert now.points.gap[middle] == pytest.approx(opposite, rel=0.05)
    assert same_points(contact.at(flat), now)
    pushed = flat.copy()
    top = pushed[:, -1] > 0
    pushed[top, -1] -= 0.38
    through = contact.at(pushed, now)
    crown = np.abs(pushed[through.points.slave, 0]) < 0.1
    assert through.points.gap[crown] == pytest.approx(0.36 - 0.38, abs=0.01)
    again = contact.at(pushed, start=now.material_points())  # from no facets, but known to have met
    assert np.array_equal(again.key, through.key)
    assert again.points.gap == pytest.approx(through.points.gap, rel=1e-6)
    assert not np.any(np.abs(pushed[contact.at(pushed).points.slave, 0]) < 0.1)
    for sides in (("inner", "outer"), ("outer", "inner"), ("crown", "base"), ("base", "crown")):
        assert sliding(ring(kind, sides)).at(flat).points.count == 0


@pytest.mark.parametrize("kind", ["quadrilateral", "hexahedron"])
def test_the_slave_of_two_places_that_meet_is_the_same_however_the_body_lies(kind: str) -> None:
    slaves = [squashed_and_turned(kind, ("inner", "inner"), angle).points.slave for angle in TURNS]
    assert len(slaves[0]) > 4
    assert all(np.array_equal(slaves[0], other) for other in slaves[1:])


@pytest.mark.parametrize("angle", TURNS)
@pytest.mark.parametrize("kind", ["quadrilateral", "hexahedron"])
def test_one_of_two_places_of_a_surface_that_meets_itself_is_the_slave(kind: str, angle: float) -> None:
    whole, *halves = (squashed_and_turned(kind, sides, angle) for sides in ROOF_AND_FLOOR)
    up = ring(kind).points[whole.points.slave, -1] > 0.0
    assert np.count_nonzero(up) in (0, whole.points.count)
    half = halves[0 if up.any() else 1]
    _, here, there = np.intersect1d(whole.points.slave, half.points.slave, return_indices=True)
    assert len(here) > 0.9 * half.points.count
    middle = np.abs(ring(kind).points[half.points.slave[there], 0]) < 0.7
    assert np.count_nonzero(middle) > 4
    assert whole.points.gap[here[middle]] == pytest.approx(half.points.gap[there[middle]], rel=1e-9)


def test_roles_stay_where_a_surface_met_itself_before() -> None:
    scene = ring("quadrilateral", ("inner", "inner"))
    contact, flat = sliding(scene), scene.points * [1.2, 0.2]
    first = contact.at(flat)
    sheared = flat + 0.3 * flat[:, [1, 0]] * [1.0, 0.0]
    beside = contact.at(sheared, first)
    stay = np.isin(first.points.slave, beside.points.slave)
    assert stay.mean() > 0.9
    # Whatever comes new is on the same side, and no slave is the master of another one.
    assert np.ptp(np.sign(scene.points[beside.points.slave, 1])) == 0.0
    master = np.abs(beside.points.master[:, beside.points.slave]).max()
    assert master == 0.0


def test_a_node_is_no_slave_where_it_is_the_master_of_one() -> None:
    # Three slaves of the roof on the left, more of the floor on the right, whose ways count.
    scene = ring("quadrilateral", ("inner", "inner"))
    meeting, flat = sliding(scene).meetings[0], scene.points * [1.2, 0.2]
    assert isinstance(meeting, OnItself)
    none = np.full(len(meeting.candidates), -1), np.zeros((len(meeting.candidates), 1))
    before = LastPoints.none(scene.dim), MaterialPoints.none(*flat.shape)
    moved = Moved(scene, flat, 0.0, *before, frozenset(), np.inf, MPI.COMM_SELF)
    both = OnOwnBody.closest(meeting, moved, none, none[0] >= 0)
    x, y = scene.points[meeting.nodes[both.point]].T
    left = (y > 0.0) & (x < -0.3) & (x > -0.6)
    right = (y < 0.0) & (x > 0.2)
    assert 1 < np.count_nonzero(left) < np.count_nonzero(right)
    last = none[0].copy()
    last[both.point[left | right]] = both.facet[left | right]
    slaves = meeting.roles.are_slaves(both, last)
    below = (y < 0.0) & (x < -0.3) & (x > -0.6)
    assert slaves[left | right].all()
    assert np.count_nonzero(below) > 1
    assert not slaves[below].any()
    beside = (y < 0.0) & (x > 0.0) & (x < 0.2)
    assert np.count_nonzero(beside) > 0
    assert slaves[beside].all()


def on_obstacle(obstacle: RigidPlane | RigidCylinder | MovingObstacle) -> Scene:
    body = on_arch("hexahedron").bodies["high"]
    return Scene(
        {"high": Body(body.mesh, body.material)}, contacts=[ContactPair(Surface("high", "z0"), obstacle)]
    )


def test_a_moving_obstacle_is_met_where_it_is() -> None:
    plane = RigidPlane((0, 0, -1.0), (0, 0, 1))
    rising = MovingObstacle(plane, lambda time: (rotation(3, 0.3 * time), (0.0, 0.0, time)))
    scene = on_obstacle(rising)
    contact = sliding(scene)
    before, after = contact.at(scene.points), contact.at(scene.points, time=0.5)
    assert before.points.gap == pytest.approx(scene.points[before.points.slave, 2] + 1.0)
    normal = rotation(3, 0.15) @ [0.0, 0.0, 1.0]
    assert after.points.normal == pytest.approx(np.tile(normal, (after.points.count, 1)))
    top = np.array([0, 0, 0.5]) - normal
    assert after.points.gap == pytest.approx((scene.points[after.points.slave] - top) @ normal)
    first = find_contact_points(scene, free(scene))
    assert first.gap == pytest.approx(before.points.gap)


@pytest.mark.parametrize(
    ("path", "message"),
    [
        (lambda time: (2 * np.eye(3), np.zeros(3)), "a rotation matrix of shape"),
        (lambda time: (-np.eye(3), np.zeros(3)), "determinant one"),
        (lambda time: (None, (0.0, np.nan, 0.0)), "3|dim finite numbers"),
        (lambda time: (np.eye(2), np.zeros(3)), "a rotation matrix of shape"),
    ],
)
def test_a_path_that_is_no_rigid_motion_is_refused(path: object, message: str) -> None:
    obstacle = MovingObstacle(RigidPlane((0, 0, -1.0), (0, 0, 1)), path)  # type: ignore[arg-type]
    with pytest.raises(InvalidInputError, match=message):
        obstacle.at(1.0)


def test_an_obstacle_moves_along_one_path() -> None:
    still = MovingObstacle(RigidPlane((0, 0, -1.0), (0, 0, 1)), lambda time: (None, (0.0, 0.0, time)))
    with pytest.raises(InvalidInputError, match="must not move"):
        MovingObstacle(still, still.path)


def test_coordinates_that_are_none_are_refused() -> None:
    scene = on_arch("hexahedron")
    with pytest.raises(InvalidInputError, match="finite numbers of shape"):
        sliding(scene).at(scene.points[:-1])
    with pytest.raises(InvalidInputError, match="got NaN or infinity"):
        sliding(scene).at(np.where(scene.points == scene.points.max(), np.nan, scene.points))


# Mortar contact where bodies lie now: derivatives of gaps and forces, slip, and turned scenes.
STEP = 1e-6
QUADRATIC = ["quadratic tetrahedron", "quadratic quadrilateral"]


@cache
def by_mortar(kind: str) -> tuple[SlidingContact, np.ndarray]:
    cell, order = (kind.removeprefix("quadratic "), 2) if kind in QUADRATIC else (kind, 1)
    few = {} if order == 1 else {"order": 2, "master_cells": 3, "slave_cells": 2 if "tet" in kind else 5}
    scene = on_arch(cell, **few)
    scene = replace(scene, contacts=[replace(scene.contacts[0], discretisation="mortar")])
    return sliding(scene), shaken(scene)


@cache
def beside(kind: str) -> tuple[SlidingPoints, SlidingPoints, SlidingPoints, np.ndarray]:
    """Return the points, those a step away in a random direction on both sides, and the direction."""
    contact, x = by_mortar(kind)
    way = np.random.default_rng(1).standard_normal(x.shape)
    now, plus, minus = (contact.at(x + sign * STEP * way) for sign in (0, 1, -1))
    assert np.array_equal(now.key, plus.key)
    assert now.points.count >= 6
    return now, plus, minus, way.ravel()


def forces(now: SlidingPoints) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(2)
    count, dim = now.points.normal.shape
    return np.asarray(random.uniform(0.3, 1.0, count)), random.uniform(-1.0, 1.0, (count, dim - 1))


error = partial(derivative_error, STEP)


@pytest.mark.parametrize("kind", [*KINDS, *QUADRATIC])
def test_rows_and_what_they_lack_are_the_derivative_of_the_gap(kind: str) -> None:
    now, plus, minus, way = beside(kind)
    rows = spread(now.points.normal, now.points.jump)
    lacking = now.mean_tangents(*forces(now), now.material_points())
    assert error((rows + lacking.gap) @ way, plus.points.gap, minus.points.gap) < 1e-7
    assert error(rows @ way, plus.points.gap, minus.points.gap) > 1e-3


@pytest.mark.parametrize("kind", [*KINDS, *QUADRATIC])
def test_stiffness_is_the_derivative_of_the_forces(kind: str) -> None:
    now, plus, minus, way = beside(kind)
    normal, friction = forces(now)
    found = now.mean_tangents(normal, friction, now.material_points()).stiffness

    def force(at: SlidingPoints) -> np.ndarray:
        total = np.einsum("na,nad->nd", friction, at.points.tangents) - normal[:, None] * at.points.normal
        return (at.points.jump.T @ total).ravel()

    assert error(found.left @ (found.right.T @ way), force(plus), force(minus)) < 1e-7


@pytest.mark.parametrize("kind", [*KINDS, *QUADRATIC])
def test_rows_of_slip_are_its_derivative(kind: str) -> None:
    contact, x = by_mortar(kind)
    before = x.copy()
    before[: contact.scene.bodies["high"].mesh.n_nodes, 0] -= 0.1
    start = contact.at(before).material_points()
    now, plus, minus, way = beside(kind)
    found = (now.slip_rows(start) @ way).reshape(-1, contact.scene.dim - 1)
    assert error(found, plus.slip(start), minus.slip(start)) < 1e-7
    points, width = now.points, contact.scene.dim - 1
    rows = [spread(points.tangents[:, a], points.jump) @ way for a in range(width)]
    lacking = now.mean_tangents(*forces(now), start).slip @ way
    assert np.column_stack(rows).ravel() + lacking == pytest.approx(found.ravel(), abs=1e-12)


@pytest.mark.parametrize("kind", [*KINDS, *QUADRATIC])
def test_turned_scenes_have_the_turned_answer(kind: str) -> None:
    contact, x = by_mortar(kind)
    later = x.copy()
    later[: contact.scene.bodies["high"].mesh.n_nodes, 0] += 0.06
    start, now = contact.at(x).material_points(), contact.at(later)
    wanted = np.einsum("na,nad->nd", now.slip(start), now.points.tangents)
    assert np.linalg.norm(wanted, axis=1) == pytest.approx(0.06, rel=0.3)
    turn = rotation(contact.scene.dim, 1.1)
    turned = contact.at(later @ turn.T - 0.2)
    assert np.array_equal(turned.key, now.key)
    assert turned.points.gap == pytest.approx(now.points.gap, abs=1e-12)
    found = np.einsum("na,nad->nd", turned.slip(start), turned.points.tangents)
    assert found == pytest.approx(wanted @ turn.T, abs=1e-12)


# Slip of nodes that slide over facets, measured from places that the master carries along.
def in_space(now: SlidingPoints, slip: np.ndarray) -> np.ndarray:
    """Return slip as vectors."""
    return np.asarray(np.einsum("na,nad->nd", slip, now.points.tangents))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("when", ["before", "between", "after"])
def test_slip_is_the_same_when_everything_turns_by_a_right_angle(kind: str, when: str) -> None:
    scene = on_arch(kind)
    contact, x = sliding(scene), shaken(scene)
    later = x.copy()
    later[: scene.bodies["high"].mesh.n_nodes, 0] += 0.06
    start = contact.at(x).material_points()
    now = contact.at(later)
    wanted = in_space(now, now.slip(start))
    common = np.isin(now.key, start.key)
    assert np.linalg.norm(wanted[common], axis=1) == pytest.approx(0.06, rel=0.2)
    for axis in range(3 if scene.dim == 3 else 1):
        turn = rotation(scene.dim, np.pi / 2, axis)
        if when == "before":
            start = contact.at(x @ turn.T).material_points()
        turned = contact.at(
            later if when == "before" else later @ turn.T - 0.2, now if when == "after" else None
        )
        assert np.array_equal(turned.key, now.key)
        expected = wanted if when == "before" else wanted @ turn.T
        assert in_space(turned, turned.slip(start)) == pytest.approx(expected, abs=1e-12)


def test_slip_over_several_facets_is_the_way() -> None:
    """On a plane master, by two thirds of a slave's length, in one step or in many."""
    from fenics_contact.gallery import block
    from fenics_contact.materials import IsotropicElasticity

    material = IsotropicElasticity(10.0, 0.3)
    low = block((0.0, 0.0, -0.5), (3.0, 1.0, 0.0), (9, 3, 1))
    high = block((0.3, 0.2, 0.0), (1.1, 0.8, 0.4), (4, 3, 1))
    scene = Scene(
        {"high": Body(high, material), "low": Body(low, material)},
        contacts=[ContactPair(Surface("high", "z0"), Surface("low", "z1"), discretisation="node")],
    )
    contact, x, way = sliding(scene), scene.points.copy(), np.array([1.5, 0.13, 0.0])
    now = contact.at(x)
    start, facets, total = now.material_points(), now.points.facet, np.zeros((now.points.count, 3))
    for _ in range(10):
        before = now.material_points()
        x[: high.n_nodes] += way / 10
        now = contact.at(x, now)
        total += in_space(now, now.slip(before))
    assert (now.points.facet != facets).all()
    assert in_space(now, now.slip(start)) == pytest.approx(np.tile(way, (now.points.count, 1)), abs=1e-12)
    assert total == pytest.approx(np.tile(way, (now.points.count, 1)), abs=1e-12)


def test_what_sticks_to_a_stretched_master_does_not_slip() -> None:
    scene = on_arch("tetrahedron")
    contact, x = sliding(scene), scene.points.copy()
    now = contact.at(x)
    start, low = now.material_points(), on_patches(contact).master.nodes
    x[low, 0] *= 1.2
    feet = now.points.master @ x
    x[now.points.slave] = feet + 0.01 * now.points.normal
    then = contact.at(x, now)
    assert np.abs(then.slip(start)).max() < 2e-3
    assert np.linalg.norm(x[now.points.slave] - scene.points[now.points.slave], axis=1).max() > 0.05


def test_nodes_that_come_later_slip_from_where_they_are_found() -> None:
    scene = on_arch("hexahedron")
    contact, x = sliding(scene), scene.points.copy()
    high = slice(0, scene.bodies["high"].mesh.n_nodes)
    x[high, 1] += 0.5
    before = contact.at(x)
    start = before.material_points()
    x[high, 1] -= 0.5
    now = contact.at(x, before)
    new = ~np.isin(now.key, start.key)
    assert np.count_nonzero(new) > 3
    assert np.abs(now.slip(start)[new]).max() < 1e-13
    assert np.abs(now.slip(start)[~new]).max() > 0.4
    start = start.extended(now.material_points())
    assert np.array_equal(start.key, np.union1d(before.key, now.key))
    x[high, 0] += 0.05
    then = contact.at(x, now)
    known = np.isin(then.key, now.key[new])
    assert np.linalg.norm(then.slip(start)[known], axis=1) == pytest.approx(0.05, rel=0.07)


def test_a_turning_roll_drags_by_the_way_of_its_surface() -> None:
    radius, turn = 2.0, 0.04
    roll = RigidCylinder((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), radius)

    def path(time: float) -> tuple[np.ndarray, np.ndarray]:
        return rotation(3, turn * time), np.array([0.0, 0.0, -radius])

    body = on_arch("hexahedron", radius=radius).bodies["high"]
    pair = ContactPair(Surface("high", "z0"), MovingObstacle(roll, path))
    scene = Scene({"high": Body(body.mesh, body.material)}, contacts=[pair])
    contact = sliding(scene)
    start = contact.at(scene.points).material_points()
    now = contact.at(scene.points, time=1.0)
    slip = in_space(now, now.slip(start))
    assert np.linalg.norm(slip, axis=1) == pytest.approx(radius * turn, rel=1e-3)
    # Seen from the roll the body goes backwards.
    top = np.argmax(now.points.normal[:, 2])
    assert slip[top, 0] == pytest.approx(-radius * turn, rel=1e-2)


def test_friction_forces_turn_with_the_bodies() -> None:
    scene = on_arch("hexahedron")
    contact, x = sliding(scene), shaken(scene)
    now = contact.at(x)
    friction = np.random.default_rng(0).standard_normal((now.points.count, 2))
    turn = rotation(3, 0.7, 1)
    then = contact.at(x @ turn.T, now)
    carried = then.carry_tangential(friction, now)
    assert np.linalg.norm(carried, axis=1) == pytest.approx(np.linalg.norm(friction, axis=1))
    upright = np.abs(now.points.normal[:, 1]) < 0.02
    assert upright.any()
    vectors, before = in_space(then, carried), in_space(now, friction)
    assert vectors[upright] == pytest.approx(before[upright] @ turn.T, abs=0.05)


def test_planes_that_stand_still_carry_nothing_along() -> None:
    body = on_arch("hexahedron").bodies["high"]
    pair = ContactPair(Surface("high", "z0"), RigidPlane((0, 0, -1.0), (0, 0, 1)))
    scene = Scene({"high": Body(body.mesh, body.material)}, contacts=[pair])
    contact = sliding(scene)
    start = contact.at(scene.points).material_points()
    way = np.array([0.3, -0.2, 0.1])
    now = contact.at(scene.points + way)
    assert in_space(now, now.slip(start)) == pytest.approx(np.tile(way * [1, 1, 0], (now.points.count, 1)))


@pytest.mark.parametrize("discretisation", ["node", "mortar"])
@pytest.mark.parametrize("kind", KINDS)
def test_slip_of_earlier_steps_turns_with_bodies_that_turn_together(kind: str, discretisation: str) -> None:
    """About normals, too, and by more than a right angle."""
    scene = on_arch(kind)
    scene = replace(scene, contacts=[replace(scene.contacts[0], discretisation=discretisation)])
    contact, x = sliding(scene), shaken(scene)
    then = contact.at(x)
    slip = np.random.default_rng(5).standard_normal((then.points.count, scene.dim - 1))
    for axis in range(3 if scene.dim == 3 else 1):
        turn = rotation(scene.dim, 2.1, axis)
        now = contact.at(x @ turn.T + 0.4)
        wanted = in_space(then, slip) @ turn.T
        assert in_space(now, now.carry_slip(slip, then)) == pytest.approx(wanted, abs=1e-9)


def test_slip_of_earlier_steps_turns_with_an_obstacle_and_not_with_the_slave() -> None:
    plane, at_rest = RigidPlane((0, 0, 0), (0, 0, 1)), np.zeros(3)
    wheel = MovingObstacle(plane, lambda time: (rotation(3, 2.0 * time, 2), at_rest))
    body = on_arch("hexahedron").bodies["high"]
    for obstacle, angle in ((wheel, 2.0), (plane, 0.0)):
        pair = ContactPair(Surface("high", "z0"), obstacle)
        scene = Scene({"high": Body(body.mesh, body.material)}, contacts=[pair])
        contact = sliding(scene)
        then = contact.at(scene.points)
        now = contact.at(scene.points @ rotation(3, 0.7, 2).T, time=1.0)
        slip = np.tile([0.3, -0.1], (then.points.count, 1))
        wanted = in_space(then, slip) @ rotation(3, angle, 2).T
        assert in_space(now, now.carry_slip(slip, then)) == pytest.approx(wanted, abs=1e-12)
