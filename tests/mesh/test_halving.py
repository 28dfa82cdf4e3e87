"""Marked quadrilaterals and hexahedra are halved: nodes beside larger cells hang, and bodies do not gape."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from fenics_contact import gallery
from fenics_contact._surfaces.facets import heights, shape_functions
from fenics_contact._surfaces.projection import interpolated_normal
from fenics_contact._surfaces.true_surface import true_surface
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, rectangle
from fenics_contact.mesh import bisection_partition, quadratic, refined, scaled_jacobian
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.cell_types import CELL_TYPES, shape_values
from fenics_contact.mesh.cuts import cut_between
from fenics_contact.mesh.faces import boundary_faces, neighbours, vector_areas
from fenics_contact.mesh.near_surfaces import near_surfaces
from fenics_contact.mesh.partition import check_face_connected, kept_together, siblings
from fenics_contact.shapes import Sphere


def straight(dim: int) -> BodyMesh:
    """Return a box with two regions and odd numbers of cells."""
    if dim == 2:
        mesh = rectangle((0.0, 0.0), (2.0, 1.0), (5, 3))
    else:
        mesh = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (5, 3, 3))
    left = mesh.points[mesh.cells].mean(axis=1)[:, 0] < 0.9
    parts = {"left": np.flatnonzero(left), "right": np.flatnonzero(~left)}
    return BodyMesh(mesh.points, mesh.cells, mesh.surfaces, None, parts)


def domed() -> BodyMesh:
    """Return a box with a top that lies on a ball, and knows it."""
    mesh = straight(3)
    points = mesh.points.copy()
    points[:, 2] *= np.sqrt(25.0 - ((points[:, :2] - 0.5) ** 2).sum(axis=1)) - 4.0
    return BodyMesh(points, mesh.cells, mesh.surfaces, shapes={"z1": Sphere((0.5, 0.5, -4.0), 5.0)})


def near(mesh: BodyMesh, reach: float) -> np.ndarray:
    """Mark the cells near a point on the right side."""
    centres = mesh.points[mesh.cells].mean(axis=1)
    return np.asarray(np.linalg.norm(centres - [2.0, 0.3, 0.4][: mesh.dim], axis=1) < reach)


def graded(mesh: BodyMesh, levels: int = 3) -> BodyMesh:
    """Halve cells around that point again and again."""
    for level in range(levels):
        mesh = refined(mesh, near(mesh, 0.6 * 0.5**level)).mesh
    return mesh


@pytest.fixture(scope="module", params=[2, 3])
def fine(request: pytest.FixtureRequest) -> BodyMesh:
    """A box with cells of four sizes."""
    return graded(straight(request.param))


def test_cells_are_halved_in_every_direction(fine: BodyMesh) -> None:
    mesh = straight(fine.dim)
    marked = near(mesh, 0.6)
    result = refined(mesh, marked)
    np.testing.assert_array_equal(np.bincount(result.parents), np.where(marked, 2**mesh.dim, 1))
    assert (np.diff(result.parents) >= 0).all()
    np.testing.assert_array_equal(result.mesh.points[: mesh.n_nodes], mesh.points)
    for name, cells in mesh.regions.items():
        assert np.isin(result.parents[result.mesh.regions[name]], cells).all()


def test_faces_between_small_and_large_cells_lie_inside(fine: BodyMesh) -> None:
    coarse = straight(fine.dim)
    assert fine.hanging
    assert len(np.unique(fine.hanging.levels)) == 4
    assert fine.volume == pytest.approx(coarse.volume, rel=1e-13)
    outside, _ = boundary_faces(fine.cells, fine.dim, fine.hanging)
    assert len(outside) == sum(map(len, fine.surfaces.values()))
    assert len(boundary_faces(fine.cells, fine.dim)[0]) > len(outside)
    for name in coarse.surfaces:
        areas = [vector_areas(it.points, it.surfaces[name]).sum(axis=0) for it in (coarse, fine)]
        np.testing.assert_allclose(areas[1], areas[0], atol=1e-13)


def test_hanging_nodes_are_those_inside_edges_and_faces_of_cells(fine: BodyMesh) -> None:
    """Found from coordinates: the middle of an edge or a face of some cell is a node."""
    hanging, kind = fine.hanging, CELL_TYPES[fine.cell_type]
    assert hanging
    ends = np.array([[v, far] for v, around in enumerate(kind.edges) for far in around])
    middles = [fine.points[fine.cells[:, part]].mean(axis=2) for part in (ends, kind.faces)]
    away, node = cKDTree(fine.points).query(np.concatenate([m.reshape(-1, fine.dim) for m in middles]))
    np.testing.assert_array_equal(np.unique(node[away < 1e-9]), hanging.nodes)
    assert not np.isin(hanging.masters, hanging.nodes).any()
    np.testing.assert_allclose(
        fine.points[hanging.masters].mean(axis=1), fine.points[hanging.nodes], atol=1e-15
    )


def test_cells_that_share_a_point_differ_by_one_level(fine: BodyMesh) -> None:
    hanging = fine.hanging
    assert hanging
    size = 0.4 * 0.5**hanging.levels
    for cell in range(0, fine.n_cells, 3):
        low, high = fine.points[fine.cells[cell]].min(axis=0), fine.points[fine.cells[cell]].max(axis=0)
        corners = fine.points[fine.cells]
        meets = ((corners.min(axis=1) <= high + 1e-9) & (corners.max(axis=1) >= low - 1e-9)).all(axis=1)
        assert np.abs(hanging.levels[meets] - hanging.levels[cell]).max() <= 1
        np.testing.assert_allclose((high - low)[0], size[cell])


def test_what_is_refined_everywhere_hangs_nowhere() -> None:
    mesh = straight(3)
    once = refined(mesh, near(mesh, 0.6)).mesh
    assert once.hanging
    rest = refined(once, np.flatnonzero(once.hanging.levels == 0)).mesh
    assert not rest.hanging
    assert (rest.n_cells, rest.n_nodes) == (8 * mesh.n_cells, 11 * 7 * 7)


def test_fields_are_carried_by_positions_in_parents(fine: BodyMesh) -> None:
    result = refined(fine, near(fine, 0.2))
    kind = CELL_TYPES[fine.cell_type]
    values = shape_values(kind, result.positions.reshape(-1, fine.dim)).reshape(*result.mesh.cells.shape, -1)
    carried = np.einsum("ckn,cni->cki", values, fine.points[fine.cells[result.parents]])
    np.testing.assert_allclose(carried, result.mesh.points[result.mesh.cells], atol=1e-14)


def test_new_nodes_lie_on_true_shapes_and_hanging_ones_on_facets() -> None:
    mesh = domed()
    once = refined(mesh, mesh.points[mesh.cells].mean(axis=1)[:, 0] > 1.0).mesh
    assert once.hanging
    whole = refined(once, np.flatnonzero(once.hanging.levels == 0)).mesh

    def off(mesh: BodyMesh) -> np.ndarray:
        nodes = np.unique(mesh.surfaces["z1"])
        away = np.abs(np.linalg.norm(mesh.points[nodes] - [0.5, 0.5, -4.0], axis=1) - 5.0)
        return nodes[away > 1e-12]

    on_top = np.intersect1d(once.hanging.nodes, once.surfaces["z1"])
    assert len(on_top) == 3
    np.testing.assert_array_equal(off(once), on_top)
    # They move onto the shape as soon as they hang no more.
    assert len(off(whole)) == 0
    assert once.shapes == whole.shapes == mesh.shapes
    assert (once.off_shapes["z1"] < 1e-9).all()


def test_cells_beside_curved_surfaces_keep_their_form() -> None:
    """Of a coarse link the rim of the surface with a shape lies in the middle of a smooth boundary."""
    link = gallery.two_links(gallery.LinkShape(n_around=18, n_a=4, n_b=6, grading=1.0)).first.mesh
    for marks in (np.arange(link.n_cells), np.flatnonzero(link.points[link.cells].mean(axis=1)[:, 1] < -3.0)):
        fine = refined(link, marks).mesh
        assert scaled_jacobian(fine.points, fine.cells).min() > 0.1
    # Plane sides stay plane.
    mesh = domed()
    fine = refined(mesh, np.arange(0, mesh.n_cells, 2)).mesh
    for side, (axis, place) in {"x0": (0, 0.0), "y1": (1, 1.0), "z0": (2, 0.0)}.items():
        nodes = np.unique(fine.surfaces[side])
        np.testing.assert_allclose(fine.points[nodes][:, axis], place, atol=1e-12)


def test_the_surface_in_contact_is_the_shape_also_at_hanging_nodes() -> None:
    mesh = domed()
    fine = refined(mesh, mesh.points[mesh.cells].mean(axis=1)[:, 0] > 1.0).mesh
    surface = true_surface(fine, "z1", "best")
    local = np.random.default_rng(0).uniform(-1.0, 1.0, (10 * len(surface.facets), 2))
    facet = np.repeat(np.arange(len(surface.facets)), 10)
    values, _ = shape_functions(local, 4)
    places = np.einsum("nk,nkd->nd", values, surface.points[surface.facets[facet]])
    normals, _ = interpolated_normal(values, surface.normals[surface.facets[facet]])
    over = places + heights(surface, facet, local).value[:, None] * normals
    hangs = np.isin(surface.nodes[surface.facets[facet]], fine.hanging.nodes).any(axis=1)

    def off(points: np.ndarray) -> float:
        return float(np.abs(np.linalg.norm(points - [0.5, 0.5, -4.0], axis=1) - 5.0).max())

    assert off(places[hangs]) > 1e-3
    assert off(over[hangs]) < 1e-8
    assert off(over) < 1e-8
    step = 1e-6 * np.eye(2)
    for axis in (0, 1):
        change = heights(surface, facet, local + step[axis]).value - heights(surface, facet, local).value
        np.testing.assert_allclose(change / 1e-6, heights(surface, facet, local).by_local[:, axis], atol=1e-7)


def test_hanging_nodes_follow_when_a_mesh_is_moved(fine: BodyMesh) -> None:
    hanging = fine.hanging
    assert hanging
    bent = fine.points + 0.05 * np.sin(3.0 * fine.points[:, ::-1])
    for moved in (fine.moved(bent), fine.reshaped(bent), replace(fine, surfaces={}).moved(bent)):
        middle = moved.points[hanging.masters].mean(axis=1)
        np.testing.assert_allclose(moved.points[hanging.nodes], middle, atol=1e-15)
    turn = np.eye(fine.dim)[::-1] * ([1, -1] if fine.dim == 2 else [-1, -1, -1])
    assert fine.placed(turn, np.ones(fine.dim), 2.0).volume == pytest.approx(2**fine.dim * fine.volume)
    assert "hanging nodes" in repr(fine)


@pytest.mark.parametrize("parts", [2, 7])
def test_siblings_at_hanging_nodes_lie_in_one_subdomain(fine: BodyMesh, parts: int) -> None:
    """Where a subdomain has a hanging node, it has all its masters."""
    hanging = fine.hanging
    assert hanging
    stripes = (fine.points[fine.cells].mean(axis=1) @ np.arange(1, fine.dim + 1) * 3).astype(int)
    stripes = np.unique(stripes, return_inverse=True)[1]
    for partition in (bisection_partition(fine, parts), kept_together(fine, stripes)):
        check_face_connected(fine, partition)
        for number in range(partition.max() + 1):
            own = np.unique(fine.cells[partition == number])
            assert np.isin(hanging.masters[np.isin(hanging.nodes, own)], own).all()
    assert bisection_partition(fine, parts).max() == parts - 1
    # No more cells than those that came from one.
    assert np.bincount(siblings(fine)).max() <= 2**fine.dim
    assert kept_together(fine, np.zeros(fine.n_cells, dtype=int)).max() == 0


def test_large_and_small_cells_are_neighbours(fine: BodyMesh) -> None:
    pairs = neighbours(fine.cells, fine.dim, fine.hanging)
    assert fine.hanging
    across = pairs[np.ptp(fine.hanging.levels[pairs], axis=1) == 1]
    assert len(across) > 2 ** (fine.dim - 1)
    areas = vector_areas(fine.points, boundary_faces(fine.cells, fine.dim, fine.hanging)[0])
    np.testing.assert_allclose(areas.sum(axis=0), 0.0, atol=1e-13)


def test_only_outer_faces_face_another_body() -> None:
    mesh = straight(3)
    low = refined(mesh, near(mesh, 0.7)).mesh
    high = mesh.moved(mesh.points + np.array([0.0, 0.0, 1.05]))
    meshes, pairs = near_surfaces({"low": low, "high": high}, 0.1)
    assert pairs == [("low", "high")]
    assert np.allclose(low.points[meshes["low"].surfaces["near high"]][..., 2], 1.0)


def broken(mesh: BodyMesh, change: Callable[[dict[str, np.ndarray]], None]) -> BodyMesh:
    hanging = mesh.hanging
    assert hanging
    values = {name: getattr(hanging, name).copy() for name in ("nodes", "masters", "levels")}
    change(values)
    return replace(mesh, hanging=type(hanging)(**values))


def test_wrong_hanging_nodes_are_refused(fine: BodyMesh) -> None:
    def unordered(values: dict[str, np.ndarray]) -> None:
        values["nodes"] = values["nodes"][::-1]

    def elsewhere(values: dict[str, np.ndarray]) -> None:
        values["masters"][0] = values["masters"][-1]

    def chained(values: dict[str, np.ndarray]) -> None:
        values["masters"][0, 0] = values["nodes"][1]

    for change, words in (
        (unordered, "ascending nodes, masters of shape"),
        (elsewhere, "must lie at the mean of their masters, 1 of"),
        (chained, "nodes of the mesh that do not hang"),
    ):
        with pytest.raises(InvalidInputError, match=words):
            broken(fine, change)


def test_what_cannot_deal_with_hanging_nodes_refuses_them(fine: BodyMesh) -> None:
    with pytest.raises(InvalidInputError, match="quadratic needs a mesh without hanging nodes, got"):
        quadratic(fine)
    with pytest.raises(InvalidInputError, match="a section needs a mesh without hanging nodes"):
        cut_between(fine, "there", np.array([0]), np.array([1]))


def test_a_surface_with_a_support_needs_whole_facets_of_large_cells() -> None:
    fine = graded(straight(3), 1)
    assert fine.hanging
    facets = fine.surfaces["x1"]
    nodes = fine.nodes_to_hold("x1")
    assert len(nodes) < len(np.unique(facets))
    with_one = facets[np.isin(facets, fine.hanging.nodes).any(axis=1)][:1]
    part = replace(fine, surfaces={"part": with_one})
    with pytest.raises(InvalidInputError, match="take all facets on the faces of larger cells"):
        part.nodes_to_hold("part")
