"""Half balls and half cylinders are round, touch the origin, and have good cells there."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_contact import BodyMesh
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import half_cylinder, hemisphere
from fenics_contact.mesh import boundary_faces, scaled_jacobian
from fenics_contact.mesh.faces import vector_areas

BODIES = {
    "quarter": (lambda n: hemisphere(2.0, n), 4.0 * np.pi / 3.0),
    "half": (lambda n: hemisphere(2.0, n, symmetry="x"), 8.0 * np.pi / 3.0),
    "whole": (lambda n: hemisphere(2.0, n, symmetry=""), 16.0 * np.pi / 3.0),
    "half cylinder": (lambda n: half_cylinder(2.0, 1.5, n, 2), 1.5 * np.pi),
    "whole cylinder": (lambda n: half_cylinder(2.0, 1.5, n, 2, symmetry=""), 3.0 * np.pi),
}


def radii(mesh: BodyMesh, facets: np.ndarray) -> np.ndarray:
    """Distances of the facets' nodes from the centre (or the axis: y counts only for a ball)."""
    points = mesh.points[np.unique(facets)] - [0.0, 0.0, 2.0]
    return np.linalg.norm(points[:, [0, 2]] if "y1" in mesh.surfaces else points, axis=1)


@pytest.mark.parametrize("name", BODIES)
def test_the_curved_surfaces_lie_on_the_sphere_or_cylinder(name: str) -> None:
    mesh = BODIES[name][0](6)
    for surface in ("contact", "side"):
        assert radii(mesh, mesh.surfaces[surface]) == pytest.approx(2.0)


@pytest.mark.parametrize("name", BODIES)
def test_the_named_surfaces_are_the_whole_boundary(name: str) -> None:
    mesh = BODIES[name][0](6)
    facets, _ = boundary_faces(mesh.cells)
    named = np.concatenate(list(mesh.surfaces.values()))
    assert np.unique(np.sort(named, axis=1), axis=0).shape == named.shape == facets.shape
    assert vector_areas(mesh.points, facets).sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-12)


@pytest.mark.parametrize("name", BODIES)
def test_it_rests_on_the_plane_at_the_origin(name: str) -> None:
    mesh = BODIES[name][0](6)
    assert (mesh.points[:, 2].min(), mesh.points[:, 2].max()) == (0.0, 2.0)
    lowest = mesh.points[mesh.points[:, 2] == 0.0]
    assert np.all(lowest[:, 0] == 0.0)
    assert lowest.shape[0] == (3 if "y1" in mesh.surfaces else 1)
    assert np.isin(np.flatnonzero(mesh.points[:, 2] == 0.0), mesh.surfaces["contact"]).all()


@pytest.mark.parametrize(
    ("name", "planes"),
    [
        ("quarter", {"x0": 0, "y0": 1}),
        ("half", {"x0": 0}),
        ("whole", {}),
        ("half cylinder", {"x0": 0, "y0": 1, "y1": 1}),
        ("whole cylinder", {"y0": 1, "y1": 1}),
    ],
)
def test_flat_sides_are_flat_and_named_where_there_are_any(name: str, planes: dict[str, int]) -> None:
    mesh = BODIES[name][0](4)
    assert set(mesh.surfaces) == {"contact", "side", "top", *planes}
    for plane, direction in planes.items():
        position = 1.5 if plane == "y1" else 0.0
        assert np.all(mesh.points[np.unique(mesh.surfaces[plane]), direction] == position)
    assert np.all(mesh.points[np.unique(mesh.surfaces["top"]), 2] == 2.0)


@pytest.mark.parametrize("name", BODIES)
def test_the_volume_converges_with_order_two(name: str) -> None:
    build, smooth = BODIES[name]
    coarse, fine = (1.0 - build(n).volume / smooth for n in (6, 12))
    assert fine > 0.0
    assert np.log2(coarse / fine) == pytest.approx(2.0, abs=0.25)


@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize("n", [2, 3, 8])
def test_cells_are_well_shaped(name: str, n: int) -> None:
    mesh = BODIES[name][0](n)
    assert scaled_jacobian(mesh.points, mesh.cells).min() > 0.5


def test_cells_shrink_towards_the_pole_alike_in_all_directions() -> None:
    mesh = hemisphere(2.0, 16, grading=4.0)
    pole = np.flatnonzero(np.all(mesh.points == 0.0, axis=1))
    corners = mesh.points[mesh.cells[np.any(mesh.cells == pole, axis=1)][0]]
    size = corners.max(axis=0) - corners.min(axis=0)
    assert size.max() < 0.02
    assert size.max() < 2.5 * size.min()


def test_a_finer_mesh_contains_the_nodes_of_the_coarser_one() -> None:
    coarse, fine = (hemisphere(1.0, n).surfaces["contact"] for n in (4, 8))
    coarse_points = hemisphere(1.0, 4).points[np.unique(coarse)]
    fine_points = hemisphere(1.0, 8).points[np.unique(fine)]
    distance = np.linalg.norm(coarse_points[:, None] - fine_points[None], axis=2).min(axis=1)
    assert distance.size == 25
    assert distance.max() < 1e-14


def test_the_grading_can_be_left_out() -> None:
    mesh = half_cylinder(1.0, 1.0, 4, grading=0.0)
    angle = np.arcsin(np.unique(mesh.points[np.unique(mesh.surfaces["contact"]), 0]))
    assert np.diff(angle) == pytest.approx(np.full(4, np.pi / 16))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"radius": 0.0}, "radius must be positive, got 0.0"),
        ({"n": 1}, "n must be an integer of at least 2, got 1"),
        ({"grading": -1.0}, "grading must be from 0 to 8, got -1.0"),
        ({"symmetry": "y"}, "symmetry must be one of .*, got 'y'"),
    ],
)
def test_what_cannot_be_meshed_is_refused(change: dict[str, object], message: str) -> None:
    for build, arguments in ((hemisphere, {}), (half_cylinder, {"length": 1.0})):
        with pytest.raises(InvalidInputError, match=message):
            build(**({"radius": 1.0, "n": 4} | arguments | change))  # type: ignore[operator]


def test_a_cylinder_without_length_is_refused() -> None:
    with pytest.raises(InvalidInputError, match=r"length must be positive, got 0\.0"):
        half_cylinder(1.0, 0.0, 4)
    with pytest.raises(InvalidInputError, match="n_length must be an integer of at least 1, got 0"):
        half_cylinder(1.0, 1.0, 4, 0)
