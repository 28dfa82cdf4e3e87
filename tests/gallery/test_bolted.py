"""Plates with a hole and bolts, cut in half."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_contact import BodyMesh
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import bolt, drilled_plate
from fenics_contact.mesh.faces import vector_areas
from fenics_contact.mesh.partition import check_one_piece

HEIGHTS = [-2.0, 0.0, 2.0]


def area(mesh: BodyMesh, name: str) -> float:
    return float(np.linalg.norm(vector_areas(mesh.points, mesh.surfaces[name]), axis=1).sum())


def boundary_is_named_once(mesh: BodyMesh) -> bool:
    facets = np.concatenate(list(mesh.surfaces.values()))
    total = vector_areas(mesh.points, facets).sum(axis=0)
    return len(np.unique(np.sort(facets, axis=1), axis=0)) == len(facets) and bool(np.allclose(total, 0))


def test_a_drilled_plate_has_the_volume_and_the_sides_of_the_formula() -> None:
    plate = drilled_plate(1.0, 4.0, (-4.0, 10.0), HEIGHTS, 8)
    check_one_piece(plate)
    assert plate.volume == pytest.approx(4 * (14 * 4 - np.pi / 2), rel=1e-3)
    assert boundary_is_named_once(plate)
    sizes = {"x0": 16, "x1": 16, "y1": 56, "y0": 4 * 12, "top": 14 * 4 - np.pi / 2, "hole": 4 * np.pi}
    for name, expected in sizes.items():
        assert area(plate, name) == pytest.approx(expected, rel=3e-3)


def test_nodes_of_the_hole_lie_on_its_circle() -> None:
    plate = drilled_plate(1.0, 4.0, (-6.0, 4.0), HEIGHTS, 3, n_radial=5)
    nodes = plate.points[np.unique(plate.surfaces["hole"])]
    assert np.hypot(*nodes[:, :2].T) == pytest.approx(np.ones(len(nodes)))
    assert len(nodes) == 3 * 13


def test_plates_to_both_sides_match_where_they_overlap() -> None:
    one = drilled_plate(1.0, 4.0, (-4.0, 10.0), HEIGHTS, 3)
    other = drilled_plate(1.0, 4.0, (-12.0, 4.0), HEIGHTS, 3)
    near = [np.round(m.points[np.abs(m.points[:, 0]) < 4 + 1e-9], 9) + 0.0 for m in (one, other)]
    assert len(near[0]) > 50
    assert {tuple(p) for p in near[0]} == {tuple(p) for p in near[1]}


def test_a_bolt_has_the_volume_and_the_bearing_faces_of_the_formula() -> None:
    screw = bolt(1.0, 2.0, (-3.0, 3.0), 1.5, 8, n_radial=3)
    check_one_piece(screw)
    assert screw.volume == pytest.approx(np.pi / 2 * (6 + 2 * 4 * 1.5), rel=3e-3)
    assert boundary_is_named_once(screw)
    ring, disc = np.pi / 2 * 3, np.pi / 2 * 4
    sizes = {
        "head": ring,
        "nut": ring,
        "top": disc,
        "bottom": disc,
        "shank": np.pi * 6,
        "side": 2 * np.pi * 3,
    }
    for name, expected in {**sizes, "y0": 2 * 6 + 2 * 4 * 1.5}.items():
        assert area(screw, name) == pytest.approx(expected, rel=5e-3)
    for name, z in {"head": 3.0, "nut": -3.0, "top": 4.5, "bottom": -4.5}.items():
        assert screw.points[screw.surfaces[name]][..., 2] == pytest.approx(z)


def test_the_regions_of_a_bolt_are_what_is_clamped_and_its_ends() -> None:
    screw = bolt(1.0, 2.0, (-3.0, 3.0), 1.5, 2, layers=(3, 1))
    z = screw.points[screw.cells][..., 2].mean(axis=1)
    assert np.abs(z[screw.regions["shank"]]).max() < 3.0
    assert np.abs(z[screw.regions["ends"]]).min() > 3.0


@pytest.mark.parametrize("sizes", [(4.0, 4.0, (-4.0, 4.0)), (1.0, 4.0, (-3.0, 4.0)), (0.0, 4.0, (-4.0, 4.0))])
def test_a_plate_whose_sizes_do_not_fit_is_refused(sizes: tuple[float, float, tuple[float, float]]) -> None:
    with pytest.raises(
        InvalidInputError, match="a drilled plate needs 0 < hole < half_width and ends beyond"
    ):
        drilled_plate(*sizes, HEIGHTS, 2)


@pytest.mark.parametrize(
    "sizes", [(2.0, 2.0, (-3, 3), 1.0), (1.0, 2.0, (3, -3), 1.0), (1.0, 2.0, (-3, 3), 0.0)]
)
def test_a_bolt_whose_sizes_do_not_fit_is_refused(
    sizes: tuple[float, float, tuple[float, float], float],
) -> None:
    with pytest.raises(InvalidInputError, match="a bolt needs 0 < shank < head, an ascending grip and"):
        bolt(*sizes, 2)


def test_counts_that_are_no_positive_integers_are_refused() -> None:
    with pytest.raises(InvalidInputError, match="n_radial must be an integer of at least 1, got 0"):
        drilled_plate(1.0, 4.0, (-4.0, 4.0), HEIGHTS, 2, n_radial=0)
    with pytest.raises(InvalidInputError, match=r"layers\[1\] must be an integer of at least 1, got 0"):
        bolt(1.0, 2.0, (-3.0, 3.0), 1.0, 2, layers=(2, 0))
