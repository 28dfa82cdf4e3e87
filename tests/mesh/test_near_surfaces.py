"""Facets that face another body are found, and no others."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from fenics_contact import BodyMesh
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import LinkShape, block, rectangle, two_links
from fenics_contact.mesh import quadratic
from fenics_contact.mesh.near_surfaces import near_surfaces
from tests.mesh_io.mesh_files import area


def centres(mesh: BodyMesh, surface: str) -> np.ndarray:
    """Return the centres of facets, (n, dim)."""
    return np.asarray(mesh.points[mesh.surfaces[surface][:, :4]].mean(axis=1))


@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
def test_blocks_on_each_other_are_near_where_they_face_each_other(cell: str) -> None:
    meshes = {
        "table": block((0, 0, 0), (4, 2, 1), (8, 4, 2), cell),
        "tool": block((1, 0, 1.01), (2, 2, 2), (3, 5, 3), cell),
        "far": block((1, 0, 2.5), (2, 2, 3), (2, 2, 2), cell),
    }
    found, pairs = near_surfaces(meshes, 0.05)
    assert pairs == [("table", "tool")]
    assert area(found["tool"], "near table") == [0.0, 0.0, -2.0]
    table = centres(found["table"], "near tool")
    assert area(found["table"], "near tool")[2] == pytest.approx(2.0, abs=1.01)
    np.testing.assert_allclose(table[:, 2], 1.0)
    assert table[:, 0].min() > 0.4
    assert table[:, 0].max() < 2.6
    assert set(found["far"].surfaces) == set(meshes["far"].surfaces)
    assert "near tool" not in meshes["table"].surfaces
    assert near_surfaces(meshes, 0.005)[1] == []


def test_a_small_body_beside_the_centre_of_a_large_facet_is_near_it() -> None:
    meshes = {
        "plate": block((0, 0, 0), (4, 4, 1), (1, 1, 1)),
        "pin": block((0.1, 0.1, 1), (0.5, 0.5, 2), (2, 2, 2)),
    }
    found, pairs = near_surfaces(meshes, 0.01)
    assert pairs == [("plate", "pin")]
    assert area(found["plate"], "near pin") == [0.0, 0.0, 16.0]
    assert area(found["pin"], "near plate") == [0.0, 0.0, -0.16]


def test_plane_and_quadratic_bodies_are_looked_at_by_their_corners() -> None:
    plane = {"low": rectangle((0, 0), (2, 1), (4, 2)), "high": rectangle((0, 1), (2, 2), (3, 2), "triangle")}
    found, pairs = near_surfaces(plane, 1e-6)
    assert pairs == [("low", "high")]
    assert area(found["low"], "near high") == [0.0, 2.0]
    bent = {
        name: quadratic(block((0, 0, z), (1, 1, z + 1), (2, 2, 1))) for name, z in (("low", 0), ("high", 1))
    }
    found, _ = near_surfaces(bent, 1e-6)
    assert found["high"].surfaces["near low"].shape == (4, 9)


def test_links_of_a_chain_are_near_in_their_crowns() -> None:
    links = two_links(LinkShape(n_around=24, n_a=4, n_b=8))
    found, pairs = near_surfaces({"one": links.first.mesh, "two": links.second.mesh}, 0.5)
    assert pairs == [("one", "two")]
    for name, other in (("one", "two"), ("two", "one")):
        mesh, near = found[name], f"near {other}"
        apart, _ = cKDTree(found[other].points).query(mesh.points)
        size = np.linalg.norm(np.ptp(mesh.points[mesh.surfaces[near]], axis=1), axis=1).max()
        inside = np.unique(mesh.surfaces[near])
        assert np.argmin(apart) in inside
        assert 4 < len(inside) < mesh.n_nodes / 8
        assert apart[inside].max() < 0.5 + 1.5 * size


def test_what_cannot_be_searched_is_refused() -> None:
    meshes = {"low": block((0, 0, 0), (1, 1, 1), (1, 1, 1)), "high": block((0, 0, 1), (1, 1, 2), (1, 1, 1))}
    with pytest.raises(InvalidInputError, match="distance must be positive and finite, got 0: give"):
        near_surfaces(meshes, 0)
    with pytest.raises(InvalidInputError, match="body 'low' must have no surface 'near high' yet"):
        near_surfaces(near_surfaces(meshes, 0.1)[0], 0.1)
