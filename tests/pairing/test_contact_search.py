"""Contact points are found where surfaces face each other, and overlapping bodies are refused."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, ContactPair, RigidPlane, Scene, Support, Surface, box_partition
from fenics_contact._pairing.points import ContactPoints, tangent_frames
from fenics_contact.errors import InvalidInputError
from fenics_contact.feti import TornSystem, build_torn_system, decompose
from fenics_contact.gallery import block
from tests.feti.scenes import STEEL

FLOOR = RigidPlane((0, 0, 0), (0, 0, 2))


def torn(scene: Scene, **options: bool) -> TornSystem:
    partitions = {name: np.zeros(body.mesh.n_cells, dtype=int) for name, body in scene.bodies.items()}
    return build_torn_system(scene, decompose(scene, partitions, MPI.COMM_SELF), **options)


def on_floor(height: float, *supports: Support) -> Scene:
    mesh = block((0, 0, height), (1, 1, height + 1), (2, 2, 2))
    return Scene({"cube": Body(mesh, STEEL)}, supports, contacts=[ContactPair(Surface("cube", "z0"), FLOOR)])


def stacked(shift: float, cell: str = "hexahedron") -> Scene:
    lower = Body(block((0, 0, 0), (1, 1, 1), (2, 2, 2)), STEEL)
    upper = Body(block((shift, 0.0, 1.05), (shift + 0.8, 0.7, 2), (3, 2, 2), cell), STEEL)
    return Scene(
        {"lower": lower, "upper": upper},
        contacts=[ContactPair(Surface("upper", "z0"), Surface("lower", "z1"), discretisation="node")],
    )


@pytest.mark.parametrize("height", [0.3, 0.0, -0.01])
def test_the_gap_to_a_plane_is_the_height_over_it(height: float) -> None:
    points = torn(on_floor(height)).points
    assert points.count == 9
    np.testing.assert_allclose(points.gap, height, atol=1e-15)
    np.testing.assert_array_equal(points.normal, np.tile([0.0, 0.0, 1.0], (9, 1)))
    assert points.area.sum() == pytest.approx(1.0)
    assert (points.facet == -1).all()
    assert points.master.nnz == 0


@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
def test_slave_nodes_beyond_the_master_are_no_contact_points(cell: str) -> None:
    for shift, rows in ((0.1, 4), (0.5, 2), (-0.5, 2)):
        points = torn(stacked(shift, cell)).points
        assert points.count == 3 * rows
        np.testing.assert_allclose(points.gap, 0.05)
        np.testing.assert_allclose(points.master.sum(axis=1), 1.0)


def test_a_pair_that_does_not_meet_is_refused() -> None:
    message = (
        "ContactPair 0 needs slave nodes that face the master, but none of the 12 movable nodes of 'z0' meets"
    )
    with pytest.raises(InvalidInputError, match=message):
        torn(stacked(3.0))
    scene = stacked(0.1)
    same_way = ContactPair(Surface("upper", "z1"), Surface("lower", "z1"), discretisation="node")
    with pytest.raises(InvalidInputError, match="none of the 12 movable nodes of 'z1' meets it: check"):
        torn(Scene(scene.bodies, contacts=[same_way]))


def test_a_pair_whose_slave_nodes_are_all_held_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="none of the 0 movable nodes of 'z0' meets it"):
        torn(on_floor(0.1, Support("cube", "z0")))
    scene = stacked(0.1)
    held = Scene(scene.bodies, [Support("upper", "z0")], contacts=scene.contacts)
    with pytest.raises(InvalidInputError, match="none of the 0 movable nodes of 'z0' meets it"):
        torn(held)


def test_held_slave_nodes_are_left_out_and_partly_held_ones_stay() -> None:
    points = torn(on_floor(0.1, Support("cube", "x0"))).points
    assert points.count == 6
    assert torn(on_floor(0.1, Support("cube", "x0", (0.0, None, None)))).points.count == 9


def test_overlapping_bodies_are_refused() -> None:
    message = "9 nodes of 'cube' lie up to 0.2 inside the master, .* facets: move them"
    with pytest.raises(InvalidInputError, match=message):
        torn(on_floor(-0.2))
    sunk = stacked(0.1)
    sunk = sunk.moved({"upper": sunk.bodies["upper"].mesh.points - [0.0, 0.0, 0.35]})
    with pytest.raises(InvalidInputError, match=r"12 nodes of 'upper' lie up to 0\.3 inside the master"):
        torn(sunk)


def test_overlap_that_faceting_explains_is_let_through_and_any_overlap_on_request() -> None:
    points = torn(on_floor(-0.01)).points
    assert (points.gap < 0).all()
    deep = torn(on_floor(-0.2), overlap=True).points
    np.testing.assert_allclose(deep.gap, -0.2)


def test_points_do_not_depend_on_the_partition() -> None:
    scene = stacked(0.1)
    found: list[ContactPoints] = []
    for boxes in ((1, 1, 1), (2, 2, 2)):
        cuts = {name: box_partition(body.mesh, boxes) for name, body in scene.bodies.items()}
        found.append(build_torn_system(scene, decompose(scene, cuts, MPI.COMM_SELF)).points)
    assert (found[0].master != found[1].master).nnz == 0
    for name in ("slave", "gap", "normal", "tangents", "area"):
        np.testing.assert_array_equal(getattr(found[0], name), getattr(found[1], name))


def test_tangents_do_not_turn_when_a_normal_changes_by_rounding() -> None:
    normal = np.array([[1.0, 1.0, 1.0]]) / np.sqrt(3)
    nudged = normal + np.random.default_rng(0).uniform(-1e-12, 1e-12, (50, 3))
    frames = tangent_frames(nudged / np.linalg.norm(nudged, axis=1)[:, None])
    np.testing.assert_allclose(frames, np.tile(tangent_frames(normal), (50, 1, 1)), atol=1e-10)
