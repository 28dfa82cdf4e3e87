"""Whole discs, balls and cylinders, solid and hollow: true surfaces, good cells, names for every side."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    Scene,
    Surface,
    solve_scene,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import ball, cylinder, disc
from fenics_contact.materials import PlaneStress
from fenics_contact.mesh import boundary_faces, quadratic, scaled_jacobian

HOLE = 1.2
#: Body, its exact volume for hole 0 and HOLE, and the sides of its round surface.
BODIES: dict[str, tuple[Callable[..., BodyMesh], tuple[float, float], str]] = {
    "disc": (lambda n, **k: disc(2.0, n, **k), (4 * np.pi, (4 - HOLE**2) * np.pi), "xy"),
    "ball": (lambda n, **k: ball(2.0, n, **k), (32 / 3 * np.pi, 4 / 3 * (8 - HOLE**3) * np.pi), "xyz"),
    "cylinder": (lambda n, **k: cylinder(2.0, 3.0, n, 2, **k), (12 * np.pi, 3 * (4 - HOLE**2) * np.pi), "xy"),
}


@pytest.fixture(params=BODIES)
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.mark.parametrize("hole", [0.0, HOLE])
def test_surfaces_lie_on_their_shapes_and_face_outwards(name: str, hole: float) -> None:
    build, _, axes = BODIES[name]
    mesh, dim = build(5, hole=hole), len(axes)
    sides = {f"{axis}{end}" for axis in axes for end in "01"}
    ends = {"bottom", "top"} if name == "cylinder" else set()
    assert set(mesh.surfaces) == sides | ends | {"outer"} | ({"inner"} if hole else set())
    assert set(mesh.shapes) == set(mesh.surfaces) - ends
    for surface, radius in (("outer", 2.0), ("inner", hole)):
        if surface in mesh.surfaces:
            places = mesh.points[np.unique(mesh.surfaces[surface])][:, :dim]
            np.testing.assert_allclose(np.linalg.norm(places, axis=1), radius, rtol=1e-14)
    boundary, _ = boundary_faces(mesh.cells, mesh.dim)
    named = np.concatenate([mesh.surfaces[each] for each in mesh.surfaces if each not in sides])
    assert {tuple(facet) for facet in np.sort(named, axis=1)} == {tuple(f) for f in np.sort(boundary, axis=1)}
    assert len(named) == len(boundary)
    parts = np.concatenate([mesh.surfaces[side] for side in sorted(sides)])
    assert sorted(map(sorted, parts)) == sorted(map(sorted, mesh.surfaces["outer"]))
    for side in sides:
        middle = mesh.points[mesh.surfaces[side]].mean(axis=1)[:, :dim]
        axis, sign = axes.index(side[0]), 1 if side[1] == "1" else -1
        assert (sign * middle[:, axis] > np.abs(np.delete(middle, axis, axis=1)).max(axis=1)).all()


@pytest.mark.parametrize("hole", [0.0, HOLE])
def test_quadratic_cells_have_the_volume_of_the_body(name: str, hole: float) -> None:
    build, exact, _ = BODIES[name]
    volumes = [quadratic(build(n, hole=hole)).volume for n in (3, 6)]
    near, nearer = np.abs(np.array(volumes) / exact[bool(hole)] - 1)
    assert near < 1e-3
    assert nearer < near / 10


@pytest.mark.parametrize("options", [{}, {"grading": 2.0}, {"hole": 0.2}, {"hole": 1.9}, {"layers": 7}])
def test_cells_are_well_shaped(name: str, options: dict[str, float]) -> None:
    mesh = BODIES[name][0](5, **options)
    assert scaled_jacobian(mesh.points, mesh.cells).min() > 0.7


def test_cells_of_rings_are_as_thick_as_long_and_graded_ones_small_at_the_poles() -> None:
    ring = disc(2.0, 5, hole=1.6)
    edges = ring.points[ring.cells] - np.roll(ring.points[ring.cells], 1, axis=1)
    length = np.linalg.norm(edges, axis=2)
    assert (length.max(axis=1) / length.min(axis=1)).max() < 1.7
    plain, graded = (disc(2.0, 6, grading=g) for g in (0.0, 2.0))
    for side in ("x0", "x1", "y0", "y1"):
        rows = [mesh.points[mesh.surfaces[side]] for mesh in (plain, graded)]
        even, sizes = (np.linalg.norm(row[:, 1] - row[:, 0], axis=1) for row in rows)
        np.testing.assert_allclose(even, even[0], rtol=1e-12)
        middle = rows[1].mean(axis=1)
        nearest = np.argmin(np.abs(middle[:, 1 if side[0] == "x" else 0]))
        assert sizes[nearest] == pytest.approx(sizes.min())
        assert sizes.max() > 4 * sizes.min()


@pytest.mark.parametrize("discretisation", ["node", "mortar"])
def test_a_disc_pressed_into_a_ring_has_the_pressure_of_lame(discretisation: str) -> None:
    """Odd numbers of cells that do not match: gaps are those of the circles, and nothing else holds them."""
    overlap, young = 1e-3, 1000.0
    material = PlaneStress(young, 0.3)
    scene = Scene(
        {"shaft": Body(disc(1.0, 5), material), "hub": Body(disc(2.0, 7, hole=1.0), material)},
        contacts=[
            ContactPair(
                Surface("shaft", "outer"),
                Surface("hub", "inner"),
                discretisation=discretisation,
                interference=overlap,
            )
        ],
    )
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-8)
    contact, expected = state.contact, young * overlap * (4.0 - 1.0) / (2.0 * 1.0 * 4.0)
    assert np.abs(contact.points.distance).max() < 1e-9, "circles of one radius are apart by nothing"
    assert contact.normal_force.sum() == pytest.approx(2 * np.pi * expected, rel=2e-3)
    if discretisation == "mortar":
        np.testing.assert_allclose(contact.pressure, expected, rtol=2e-3)


@pytest.mark.parametrize(("radius", "hole"), [(0.0, 0.0), (1.0, 1.0), (1.0, -0.5), (float("inf"), 0.0)])
def test_a_hole_must_leave_something(radius: float, hole: float) -> None:
    for build in (disc, ball):
        with pytest.raises(InvalidInputError, match=r"0 <= hole < radius is needed, got|finite"):
            build(radius, 3, hole=hole)
    with pytest.raises(InvalidInputError, match="length must be positive, got -1"):
        cylinder(1.0, -1.0, 3, 2)
