"""The same scene far from the origin, turned, on meshes that are no powers of two: the same answer."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from scipy.spatial.transform import Rotation

from fenics_contact import (
    Body,
    ContactPair,
    Coulomb,
    DistanceObstacle,
    RigidPlane,
    Scene,
    State,
    Support,
    Surface,
    Tie,
    Traction,
    solve_scene,
)
from fenics_contact.feti import TornSystem, build_torn_system, decompose
from fenics_contact.gallery import block
from tests.contact.gallery import SOFT, STIFF, crowned, partitions
from tests.hard.transform import turned

TURN = Rotation.from_euler("xyz", [0.3, -0.7, 1.1]).as_matrix()
SHIFTS = [1e3, 1e5, 1e6, 1e7]
WAY = np.array([1.0, -0.7, 0.4])
#: Error of a coordinate of one, relative to the size of the facets, in units of its last place.
AMPLIFIED = 100 * np.finfo(float).eps


def blocks(cells: int, cell: str = "hexahedron", discretisation: str = "node") -> Scene:
    """A crowned block on a larger one of other cells; nodes lie on edges, on corners and inside of facets."""
    lower = block((0.0, 0.0, -0.7), (2.1, 1.1, 0.0), (cells + 2, cells, 2), cell)
    upper = crowned(block((0.3, 0.0, 0.0), (1.8, 1.1, 0.8), (cells, cells, 2), cell), 0.04)
    return Scene(
        {"lower": Body(lower, STIFF), "upper": Body(upper, SOFT)},
        [Support("lower", "z0")],
        [Traction("upper", "z1", (0.4, 0.1, -2.0))],
        [ContactPair(Surface("upper", "z0"), Surface("lower", "z1"), Coulomb(0.4), discretisation)],
    )


def shifted(scene: Scene, shift: float) -> Scene:
    """Return the scene elsewhere; obstacles are planes."""
    way = shift * WAY
    moved = scene.moved({name: body.mesh.points + way for name, body in scene.bodies.items()})
    pairs = [
        replace(pair, master=replace(pair.master, point=tuple(pair.master.point + way)))
        if isinstance(pair.master, RigidPlane)
        else pair
        for pair in moved.contacts
    ]
    return replace(moved, contacts=pairs)


def torn(scene: Scene) -> TornSystem:
    return build_torn_system(scene, decompose(scene, partitions(scene), MPI.COMM_SELF))


def solved(scene: Scene) -> State:
    return solve_scene(scene, MPI.COMM_SELF, partitions=partitions(scene), tolerance=1e-9)


@pytest.mark.parametrize("discretisation", ["node", "mortar"])
@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
@pytest.mark.parametrize("cells", [3, 5, 7])
def test_no_contact_point_is_lost_far_from_the_origin(cells: int, cell: str, discretisation: str) -> None:
    scene = turned(blocks(cells, cell, discretisation), TURN)
    near = torn(scene).points
    assert near.count == (cells + 1) ** 2
    for shift in SHIFTS:
        far, noise = torn(shifted(scene, shift)).points, AMPLIFIED * shift
        np.testing.assert_array_equal(far.slave, near.slave)
        np.testing.assert_allclose(far.gap, near.gap, atol=noise)
        np.testing.assert_allclose(far.normal, near.normal, atol=10 * noise)
        np.testing.assert_allclose(far.area, near.area, rtol=10 * noise)
        np.testing.assert_allclose(far.master.toarray(), near.master.toarray(), atol=100 * noise)


@pytest.mark.parametrize("discretisation", ["node", "mortar"])
def test_contact_forces_do_not_depend_on_where_the_scene_lies(discretisation: str) -> None:
    scene = turned(blocks(5, discretisation=discretisation), TURN)
    near = solved(scene).contact
    assert (near.normal_force > 0).sum() > 10
    assert (near.friction_force != 0).any()
    for shift in (1e5, 1e7):
        far = solved(shifted(scene, shift)).contact
        error = np.abs(far.force - near.force).max() / np.abs(near.force).max()
        assert error < 1e-6 + 1e3 * AMPLIFIED * shift


def test_forces_balance_the_load_far_from_the_origin_at_the_default_tolerance() -> None:
    scene = turned(blocks(3), TURN)
    for shift in (0.0, 1e7):
        far = shifted(scene, shift)
        state = solve_scene(far, MPI.COMM_SELF, partitions=partitions(far))
        expected = 1.5 * 1.1 * (TURN @ [0.4, 0.1, -2.0])
        np.testing.assert_allclose(-state.contact.force.sum(axis=0), expected, rtol=1e-6)


@pytest.mark.parametrize("cells", [3, 5, 7])
def test_tied_blocks_stay_together_far_from_the_origin(cells: int) -> None:
    scene = blocks(cells)
    scene = turned(replace(scene, contacts=[], ties=[Tie(*_faces(scene))]), TURN)
    near, far = solved(scene), solved(shifted(scene, 1e7))
    assert torn(shifted(scene, 1e7)).ties.count == torn(scene).ties.count > cells
    assert far.energies.strain == pytest.approx(near.energies.strain, rel=1e-6)


def _faces(scene: Scene) -> tuple[Surface, Surface]:
    return scene.contacts[0].slave, scene.contacts[0].master  # type: ignore[return-value]


@pytest.mark.parametrize("given", ["plane", "distance"])
def test_a_rigid_plane_far_from_the_origin_is_met_as_near_it(given: str) -> None:
    mesh = crowned(block((0.0, 0.0, 0.0), (1.7, 1.1, 0.9), (5, 3, 3)), 0.03)
    floor = ContactPair(Surface("block", "z0"), RigidPlane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)), Coulomb(0.3))
    support = Support("block", "z1", (0.01, 0.0, -0.025))
    scene = turned(Scene({"block": Body(mesh, SOFT)}, [support], contacts=[floor]), TURN)
    near = solved(scene).contact
    assert 0 < (near.normal_force > 0).sum() < near.points.count
    far = shifted(scene, 1e7)
    if given == "distance":
        pair = far.contacts[0]
        far = replace(far, contacts=[replace(pair, master=DistanceObstacle(pair.master.distance))])
    found = solved(far).contact
    assert found.points.count == near.points.count
    np.testing.assert_allclose(found.force, near.force, atol=1e-4 * np.abs(near.force).max())


def test_the_balance_of_loads_is_not_lost_in_rounding_far_from_the_origin() -> None:
    """Forces on two opposite sides of a body that nothing holds balance each other wherever it lies."""
    scene = blocks(3)
    pulls = [Traction("upper", "x0", (-1.0, 0.0, 0.0)), Traction("upper", "x1", (1.0, 0.0, 0.0))]
    scene = turned(replace(scene, loads=[*scene.loads, *pulls]), TURN)
    for shift in (0.0, 1e7):
        system = torn(shifted(scene, shift))
        load, sides = np.zeros(3), 0.0
        for part in system.subdomains:
            if part.mesh.body == "upper":
                load += part.load.reshape(-1, 3).sum(axis=0)
                sides += np.abs(part.load).sum()
        assert np.abs(load - 1.5 * 1.1 * (TURN @ [0.4, 0.1, -2.0])).max() < 1e-7 * sides


def test_rigid_motions_are_free_of_energy_far_from_the_origin() -> None:
    for shift in (0.0, 1e7):
        scene = shifted(turned(blocks(3), TURN), shift)
        for part in torn(scene).subdomains:
            K, R = part.stiffness, part.kernel
            assert np.abs(K @ R).max() < 1e-12 * K.diagonal().max()


def test_a_slave_node_whose_projection_is_not_found_is_told(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    from fenics_contact._surfaces import projection

    monkeypatch.setattr(projection, "RESIDUAL", 0.0)  # no answer of Newton's method is good enough
    scene = blocks(3)
    with (
        caplog.at_level(logging.WARNING, "fenics_contact"),
        pytest.raises(ValueError, match="none of the 16"),
    ):
        torn(scene)
    assert "16 of 16 slave nodes face their master, but no point of it was found for them" in caplog.text


@pytest.mark.parametrize("cells", [3, 5, 7])
def test_a_mortar_facet_that_only_touches_the_rim_of_its_master_is_no_contact(cells: int) -> None:
    """Beyond the rim there is nothing to meet, and rounding makes nothing of it."""
    scene = blocks(3, discretisation="mortar")
    wide = block((0.0, 0.0, 0.0), (2 * 2.1, 1.1, 0.8), (2 * cells, 4, 2))
    scene = turned(replace(scene, bodies={**scene.bodies, "upper": Body(wide, SOFT)}), TURN)
    near = torn(scene).points
    assert near.count == 5 * (cells + 1)
    for shift in (*SHIFTS, 1e9):
        np.testing.assert_array_equal(torn(shifted(scene, shift)).points.slave, near.slave)
