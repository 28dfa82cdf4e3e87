"""Single nodes that are held and loaded: the nodal forces of a traction do what the traction does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyMesh,
    PointForce,
    Roller,
    Scene,
    Support,
    Traction,
    Ufl,
    box_partition,
    solve_scene,
)
from fenics_contact._surfaces.facets import share_areas
from fenics_contact.design.forms import EVERY_NODE
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, NeoHooke
from fenics_contact.mesh import quadratic, refined

STEEL = IsotropicElasticity(1000.0, 0.3)


def pinned(mesh: BodyMesh) -> BodyMesh:
    """Name the three corners that hold a block without stress, and some nodes of its far end."""
    at = {tuple(point): node for node, point in enumerate(np.round(mesh.points, 9).tolist())}
    corners = {"origin": [at[0, 0, 0]], "along y": [at[0, 1, 0]], "along z": [at[0, 0, 1]]}
    return replace(mesh, node_sets={**corners, "end": np.unique(mesh.surfaces["x1"])})


BAR = pinned(block((0, 0, 0), (3, 1, 1), (3, 2, 2)))
STATICALLY = [
    Support("bar", "origin", (0.0, 0.0, 0.0)),
    Support("bar", "along y", (0.0, None, 0.0)),
    Support("bar", "along z", (0.0, None, None)),
]


@pytest.mark.parametrize("boxes", [(1, 1, 1), (3, 2, 1)])
def test_nodal_forces_of_a_traction_pull_as_the_traction_and_corners_hold_without_stress(
    boxes: tuple[int, int, int],
) -> None:
    share = dict(zip(map(tuple, BAR.points.tolist()), share_areas(BAR, "x1"), strict=True))

    def forces(points: np.ndarray) -> np.ndarray:
        return np.outer([share[tuple(point)] for point in points.tolist()], [2.0, 0.0, 0.0])

    scene = Scene({"bar": Body(BAR, STEEL)}, STATICALLY, [PointForce("bar", "end", forces)])
    cut = {"bar": box_partition(BAR, boxes)}
    # Three corners hold a whole bar; the traction on the other end pulls it against them.
    scene = replace(scene, loads=[*scene.loads, Traction("bar", "x0", (-2.0, 0.0, 0.0))])
    state = solve_scene(scene, MPI.COMM_SELF, partitions=cut, tolerance=1e-12)
    exact = BAR.points * [2e-3, -0.6e-3, -0.6e-3]
    np.testing.assert_allclose(state.gather_displacement("bar"), exact, atol=1e-12)
    for entry in state.reactions():
        np.testing.assert_allclose(entry.force, 0.0, atol=1e-9)


def test_a_force_on_each_of_several_nodes_is_balanced_by_the_reactions() -> None:
    scene = Scene(
        {"bar": Body(BAR, STEEL)}, [Support("bar", "x0")], [PointForce("bar", "end", (1.0, 2.0, 3.0))]
    )
    state = solve_scene(scene, MPI.COMM_SELF, partitions={"bar": box_partition(BAR, (2, 2, 2))})
    np.testing.assert_allclose(state.reactions()[0].force, [-9.0, -18.0, -27.0], rtol=1e-8)
    np.testing.assert_allclose(state.balance().loads.force, [9.0, 18.0, 27.0], rtol=1e-12)
    assert [effect.name.value for effect in scene.effects()][-1] == "force at nodes"


def test_nodes_that_two_supports_hold_share_their_reaction() -> None:
    supports = [Support("bar", "x0"), Support("bar", "along y", (0.0, 0.0, 0.0))]
    scene = Scene({"bar": Body(BAR, STEEL)}, supports, [Traction("bar", "x1", (1.0, 0.0, 0.0))])
    face, corner = solve_scene(scene, MPI.COMM_SELF).reactions()
    assert corner.force[0] < -1e-3
    assert face.force[0] + corner.force[0] == pytest.approx(-1.0, rel=1e-8)


def test_a_force_per_revolution_stretches_a_ring_as_a_traction_does() -> None:
    mesh = rectangle((10.0, 0.0), (11.0, 2.0), (2, 2))
    mesh = replace(mesh, node_sets={"low": [0], "outer": np.unique(mesh.surfaces["x1"])})
    body = Body(mesh, STEEL, axisymmetric=True)
    even = [Traction("ring", "x1", (5.0, 0.0))]
    share = 2 * np.pi * 11.0 * np.array([0.5, 1.0, 0.5]) * 5.0
    nodal = [
        PointForce(
            "ring", "outer", lambda x: np.column_stack([np.interp(x[:, 1], [0, 1, 2], share), 0 * x[:, 1]])
        )
    ]
    held = [Support("ring", "low", (None, 0.0))]
    by_surface, by_nodes = (
        solve_scene(Scene({"ring": body}, held, loads), MPI.COMM_SELF).gather_displacement("ring")
        for loads in (even, nodal)
    )
    np.testing.assert_allclose(by_nodes, by_surface, rtol=1e-9)
    assert by_surface[:, 0].min() > 0.1


def test_node_sets_stay_at_their_places_on_finer_and_quadratic_meshes() -> None:
    fine = refined(pinned(block((0, 0, 0), (3, 1, 1), (3, 2, 2), "tetrahedron")), [0, 5]).mesh
    for mesh in (fine, quadratic(BAR)):
        assert set(mesh.node_sets) == set(BAR.node_sets)
        assert mesh.n_nodes > BAR.n_nodes
        for name, nodes in BAR.node_sets.items():
            here, there = mesh.points[mesh.node_sets[name]], BAR.points[nodes]
            np.testing.assert_allclose(here[np.lexsort(here.T)], there[np.lexsort(there.T)], atol=1e-12)


def test_what_is_no_set_of_nodes_or_force_on_one_is_refused() -> None:
    with pytest.raises(
        InvalidInputError, match=r"node set 'a' must hold one or more .* got an array of shape"
    ):
        replace(BAR, node_sets={"a": [1, 1]})
    with pytest.raises(InvalidInputError, match=r"'x0' must .* its own name, got the name of a"):
        replace(BAR, node_sets={"x0": [1]})
    with pytest.raises(InvalidInputError, match=r"node set 'a' must number nodes 0 to 35, got 99 to 99"):
        replace(BAR, node_sets={"a": [99]})
    with pytest.raises(
        InvalidInputError, match=r"PointForce.value must be numbers or a function of points, got"
    ):
        PointForce("bar", "end", Ufl(lambda x: x))


def test_derivatives_by_the_shape_keep_forces_at_nodes_as_they_are() -> None:
    from fenics_contact.design.load_derivatives import moving_loads

    scene = Scene({"bar": Body(BAR, STEEL)}, [Support("bar", "x0")], [PointForce("bar", "end", lambda x: x)])
    state = solve_scene(scene, MPI.COMM_SELF)
    with pytest.raises(InvalidInputError, match=r"need forces at nodes as numbers, got a function"):
        moving_loads(state.torn, EVERY_NODE)


def test_nodes_slide_along_directions_that_a_function_gives() -> None:
    """Nodes of an end are held across a slope, others along z: only what is held has a reaction."""
    mesh = replace(BAR, node_sets={**BAR.node_sets, "root": np.unique(BAR.surfaces["x0"])})
    rollers = [Roller("bar", "root", 0.01, lambda x: np.tile([1.0, 1.0, 0.0], (len(x), 1)))]
    supports = [Support("bar", "end", (0.0, 0.0, 0.0)), *rollers]
    state = solve_scene(Scene({"bar": Body(mesh, STEEL)}, supports), MPI.COMM_SELF, tolerance=1e-12)
    moved = state.gather_displacement("bar")[mesh.node_sets["root"]]
    np.testing.assert_allclose(moved[:, :2].sum(axis=1), 0.01 * np.sqrt(2), atol=1e-12)
    force = state.reactions()["bar root"].force
    assert force[0] == pytest.approx(force[1], rel=1e-6)
    assert force[0] > 0.1
    assert abs(force[2]) < 1e-9


@pytest.mark.parametrize(
    ("roller", "message"),
    [
        (
            Roller("bar", "end"),
            r"a roller on nodes needs a direction, node set 'end' of body 'bar' has no norm",
        ),
        (
            Roller("bar", "end", 0.0, lambda x: 0.0 * x),
            r"must not be zero, got zeros at \(3, 0, 0\): leave out",
        ),
    ],
)
def test_a_roller_on_nodes_without_direction_is_refused(roller: Roller, message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        solve_scene(Scene({"bar": Body(BAR, STEEL)}, [roller]), MPI.COMM_SELF)


def test_bodies_that_deform_much_slide_along_vectors_alone() -> None:
    roller = Roller("bar", "end", 0.0, lambda x: x)
    with pytest.raises(InvalidInputError, match=r"that of 'end' of body 'bar' is a function: give a vector"):
        Scene({"bar": Body(BAR, NeoHooke(1.0, 0.3))}, [roller])
