"""A corner or an edge that presses, without friction, along the normal of the face that it touches."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    Scene,
    State,
    Support,
    Surface,
    solve_scene,
)
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, Material, NeoHooke, PlaneStrain

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
    material: Material, slave: str, master: str, kind: str, cells: int = 5, angle: float = TURN
) -> State:
    """A bar that stands on one of its corners on a level floor, pressed by 0.05."""
    floor = rectangle((-2, -1), (2, 0), (8 * cells // 5 + 1, 4))
    bar = turned_in_plane(rectangle((0, 0), (1, 2), (cells, 2 * cells)), angle, ("y0", "x0"))
    sides = Surface(*slave.split()), Surface(*master.split())
    pair = ContactPair(*sides, discretisation=kind)  # type: ignore[arg-type]
    supports = [Support("floor", "y0"), Support("bar", "y1", (0.0, -0.05))]
    bodies = {"floor": Body(floor, material), "bar": Body(bar, material)}
    return solve_scene(Scene(bodies, supports, contacts=[pair]), MPI.COMM_SELF)


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
    size = np.linalg.norm(force_on(pressed(material, "bar under", "floor y1", "node", cells)))
    assert size > 5.0
    for slave in ("bar under", "bar y0"):
        state = pressed(material, slave, "floor y1", "mortar", cells)
        require_upright(force_on(state), float(size))


def test_faces_beside_a_corner_press_straight_down_as_well() -> None:
    """Where the mesh is fine, they touch, too: small displacements leave them as steep as they are."""
    sides = "bar under", "floor y1"
    ways = ("node", "mortar")
    by_nodes, by_mortar = (force_on(pressed(MATERIALS["small"], *sides, way, 40)) for way in ways)
    require_upright(by_mortar, float(np.linalg.norm(by_nodes)))


def test_a_face_too_steep_to_face_the_floor_touches_by_its_nodes() -> None:
    size = np.linalg.norm(force_on(pressed(MATERIALS["small"], "bar under", "floor y1", "node")))
    state = pressed(MATERIALS["small"], "bar x0", "floor y1", "best")
    (pair,) = state.scene.contacts
    assert pair.reason == "node, as no facets face each other: corners or edges touch"
    require_upright(force_on(state), float(size))


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
    forces = {}
    for kind in ("node", "mortar"):
        sides = Surface("bar", "under"), Surface("floor", "z1")
        pair = ContactPair(*sides, discretisation=kind)  # type: ignore[arg-type]
        supports = [Support("floor", "z0"), Support("bar", "z1", (0.0, 0.0, -0.05))]
        scene = Scene({"floor": Body(floor, material), "bar": Body(bar, material)}, supports, contacts=[pair])
        forces[kind] = force_on(solve_scene(scene, MPI.COMM_SELF), "floor z0")
    assert np.linalg.norm(forces["node"]) > 1.0
    require_upright(forces["mortar"], float(np.linalg.norm(forces["node"])))


@pytest.mark.parametrize("strain", ["small", "large"])
def test_a_sharp_ring_presses_along_the_axis(strain: str) -> None:
    """A ring that stands on an edge: its forces on a level floor of revolution point along the axis."""
    material = IsotropicElasticity(1000.0, 0.3) if strain == "small" else NeoHooke(1000.0, 0.3)
    floor = rectangle((0, -1), (4, 0), (9, 4))
    ring = turned_in_plane(rectangle((0, 0), (1, 1), (5, 5)), TURN, ("y0", "x0"))
    ring = replace(ring, points=ring.points + np.array([2.0, 0.0]))
    forces = {}
    for kind in ("node", "mortar"):
        sides = Surface("ring", "under"), Surface("floor", "y1")
        pair = ContactPair(*sides, discretisation=kind, geometry="faceted")  # type: ignore[arg-type]
        supports = [Support("floor", "y0"), Support("ring", "y1", (0.0, -0.05))]
        bodies = {
            "floor": Body(floor, material, axisymmetric=True),
            "ring": Body(ring, material, axisymmetric=True),
        }
        contact = solve_scene(Scene(bodies, supports, contacts=[pair]), MPI.COMM_SELF).contact
        forces[kind] = contact.normal_force @ contact.points.normal
    assert forces["node"][1] > 10.0
    require_upright(forces["mortar"], float(forces["node"][1]))
