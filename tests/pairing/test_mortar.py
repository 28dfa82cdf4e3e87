"""Mortar coupling of flat surfaces is exact: areas, linear fields, transfer of forces, rigid motions."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import ConvexHull, HalfspaceIntersection

from fenics_contact._pairing.mortar.coupling import MortarCoupling, mortar_coupling
from fenics_contact._surfaces.facets import FacetedSurface, faceted_surface
from fenics_contact.errors import InvalidInputError
from tests.pairing.mortar_surfaces import KINDS, SOLID, moved, plate, rotation

kinds = pytest.mark.parametrize(("slave_kind", "master_kind"), KINDS)
solid = pytest.mark.parametrize(("slave_kind", "master_kind"), SOLID)


def check_rows(coupling: MortarCoupling, slave: FacetedSurface, master: FacetedSurface) -> None:
    """Make sure of what holds whatever the surfaces are."""
    count = len(coupling.node)
    assert coupling.weight.shape == (count, len(master.nodes))
    assert coupling.normal.shape == (count, slave.dim)
    assert (np.diff(coupling.node) > 0).all()
    assert (coupling.area > 0).all()
    np.testing.assert_allclose(coupling.weight.sum(axis=1), np.ones((count, 1)), atol=1e-12)
    np.testing.assert_allclose(coupling.normal, -slave.normals[coupling.node])


@kinds
@pytest.mark.parametrize("height", [0.0, 0.05, 7.0, -0.02])
def test_a_covered_slave_sees_the_whole_distance_and_reproduces_linear_fields(
    slave_kind: str, master_kind: str, height: float
) -> None:
    slave = plate(slave_kind, 6, height=height, up=False, skew=1.0)
    master = plate(master_kind, 7, low=-0.2, high=1.3, turn=0.0, skew=0.4)
    coupling = mortar_coupling(slave, master)
    check_rows(coupling, slave, master)
    np.testing.assert_array_equal(coupling.node, np.arange(len(slave.nodes)))
    assert coupling.area.sum() == pytest.approx(1.0, rel=1e-12)
    np.testing.assert_allclose(coupling.gap, height, atol=1e-13)
    met = slave.points.copy()
    met[:, -1] = 0.0
    np.testing.assert_allclose(coupling.weight @ master.points, met, atol=1e-12)


@kinds
def test_covered_area_belongs_to_nodes_as_their_shape_functions_say(
    slave_kind: str, master_kind: str
) -> None:
    slave, master = plate(slave_kind, 5, up=False), plate(master_kind, 4, low=-0.5, high=1.5, turn=0.2)
    np.testing.assert_allclose(mortar_coupling(slave, master).area, slave.areas, rtol=1e-12)


@kinds
def test_constant_tractions_arrive_on_a_master_inside_the_slave(slave_kind: str, master_kind: str) -> None:
    slave = plate(slave_kind, 6, up=False, low=-0.3, high=1.2)
    master = plate(master_kind, 7, turn=0.25)
    coupling = mortar_coupling(slave, master)
    check_rows(coupling, slave, master)
    np.testing.assert_allclose(coupling.area @ coupling.weight, master.areas, atol=1e-12)
    # Linear fields pass also where facets are covered in part.
    np.testing.assert_allclose(coupling.weight @ master.points, slave.points[coupling.node], atol=1e-10)


@kinds
def test_constant_tractions_arrive_on_any_overlap(slave_kind: str, master_kind: str) -> None:
    slave = plate(slave_kind, 6, up=False)
    master = plate(master_kind, 7, low=0.37, high=1.4, turn=0.3)
    there, back = mortar_coupling(slave, master), mortar_coupling(master, slave)
    assert 0 < len(there.node) < len(slave.nodes)
    assert 0 < len(back.node) < len(master.nodes)
    on_master = np.zeros(len(master.nodes))
    on_master[back.node] = back.area
    np.testing.assert_allclose(there.area @ there.weight, on_master, atol=1e-12)
    assert there.area.sum() == pytest.approx(back.area.sum(), rel=1e-12)


def square_overlap(low: float, high: float, turn: float) -> float:
    """Area of [0, 1]² ∩ the turned [low, high]²."""
    c, s, middle = np.cos(turn), np.sin(turn), (low + high) / 2
    axes = np.array([[c, s], [-s, c]])
    sides = np.vstack([axes, -axes])
    planes = [[*side, -side @ [middle, middle] - (high - low) / 2] for side in sides]
    planes += [[1, 0, -1], [-1, 0, 0], [0, 1, -1], [0, -1, 0]]
    return float(
        ConvexHull(HalfspaceIntersection(np.array(planes), np.array([0.8, 0.8])).intersections).volume
    )


@solid
@pytest.mark.parametrize("turn", [0.0, 0.4, 1.1])
def test_areas_add_up_to_the_overlap(slave_kind: str, master_kind: str, turn: float) -> None:
    slave = plate(slave_kind, 6, up=False, skew=1.0)
    master = plate(master_kind, 5, low=0.41, high=1.53, turn=turn, skew=0.3)
    coupling = mortar_coupling(slave, master)
    check_rows(coupling, slave, master)
    assert coupling.area.sum() == pytest.approx(square_overlap(0.41, 1.53, turn), rel=1e-12)


def test_lengths_add_up_to_the_overlap() -> None:
    coupling = mortar_coupling(plate("edges", 6, up=False), plate("edges", 5, low=0.41, high=1.53))
    assert coupling.area.sum() == pytest.approx(0.59, rel=1e-12)


@kinds
def test_rigid_motions_of_both_surfaces_change_nothing(slave_kind: str, master_kind: str) -> None:
    slave = plate(slave_kind, 6, height=0.02, up=False, skew=1.0)
    master = plate(master_kind, 5, low=0.3, high=1.5, turn=0.4)
    turn, shift = rotation(slave.dim), np.arange(slave.dim) + 0.7
    before = mortar_coupling(slave, master)
    after = mortar_coupling(moved(slave, turn, shift), moved(master, turn, shift))
    np.testing.assert_array_equal(after.node, before.node)
    np.testing.assert_allclose(after.area, before.area, rtol=1e-9, atol=1e-14)
    np.testing.assert_allclose(after.weight.toarray(), before.weight.toarray(), atol=1e-9)
    np.testing.assert_allclose(after.gap, before.gap, atol=1e-12)
    np.testing.assert_allclose(after.normal, before.normal @ turn.T, atol=1e-13)


@pytest.mark.parametrize("kind", ["edges", "triangles", "quads"])
def test_matching_meshes_are_coupled_node_by_node(kind: str) -> None:
    master = plate(kind, 5, skew=1.0)
    slave = faceted_surface(master.points, master.facets[:, ::-1])
    coupling = mortar_coupling(slave, master)
    np.testing.assert_allclose(coupling.weight.toarray(), np.eye(len(slave.nodes)), atol=1e-12)
    np.testing.assert_allclose(coupling.gap, 0.0, atol=1e-15)


@kinds
@pytest.mark.parametrize("reason", ["beside", "same way", "empty master", "empty slave"])
def test_surfaces_that_do_not_face_each_other_have_no_multipliers(
    slave_kind: str, master_kind: str, reason: str
) -> None:
    slave, master = plate(slave_kind, 4, up=reason == "same way"), plate(master_kind, 3)
    if reason == "beside":
        master = plate(master_kind, 3, low=1.5, high=2.5)
    if reason == "empty master":
        master = faceted_surface(master.points, master.facets[:0])
    if reason == "empty slave":
        slave = faceted_surface(slave.points, slave.facets[:0])
    coupling = mortar_coupling(slave, master)
    assert len(coupling.node) == len(coupling.area) == len(coupling.gap) == 0
    assert coupling.normal.shape == (0, slave.dim)
    assert coupling.weight.shape == (0, len(master.nodes))


@kinds
@pytest.mark.parametrize("width", [1e-2, 1e-4, 1e-6, 1e-9, 1e-13])
def test_slivers_do_no_harm(slave_kind: str, master_kind: str, width: float) -> None:
    slave = plate(slave_kind, 4, up=False, height=0.01, uneven=0.0)
    master = plate(master_kind, 5, low=-1.1, high=0.25 + width)
    coupling = mortar_coupling(slave, master)
    check_rows(coupling, slave, master)
    overlap = (0.25 + width) ** (slave.dim - 1)
    assert coupling.area.sum() == pytest.approx(overlap, rel=1e-7)
    assert np.abs(coupling.weight.toarray()).max() < 20
    np.testing.assert_allclose(coupling.gap, 0.01, atol=1e-12)
    assert 0.9 < (coupling.area @ coupling.weight).sum() / overlap < 1.1


def test_nodes_with_next_to_no_covered_area_carry_no_multiplier() -> None:
    slave = plate("edges", 4, up=False, uneven=0.0)
    count = [
        len(mortar_coupling(slave, plate("edges", 5, low=-1, high=h)).node) for h in (0.25, 0.250001, 0.26)
    ]
    assert count == [2, 2, 3]


@kinds
def test_a_graded_master_is_found_everywhere(slave_kind: str, master_kind: str) -> None:
    slave = plate(slave_kind, 8, up=False, height=0.3)
    master = plate(master_kind, 30, low=-0.4, high=2.0, uneven=0.97)
    coupling = mortar_coupling(slave, master)
    assert coupling.area.sum() == pytest.approx(1.0, rel=1e-12)
    np.testing.assert_allclose(coupling.gap, 0.3, atol=1e-13)


@kinds
def test_a_single_large_facet_meets_many_small_ones(slave_kind: str, master_kind: str) -> None:
    slave = plate(slave_kind, 1, up=False, height=0.1)
    coupling = mortar_coupling(slave, plate(master_kind, 60, low=-0.1, high=1.1))
    np.testing.assert_allclose(coupling.area, slave.areas, rtol=1e-12)
    back = mortar_coupling(plate(master_kind, 30, low=0.1, high=0.9), slave)
    assert back.area.sum() == pytest.approx(0.8 ** (slave.dim - 1), rel=1e-12)


@kinds
def test_inclined_surfaces_are_integrated_over_the_slave(slave_kind: str, master_kind: str) -> None:
    slave = plate(slave_kind, 6, up=False)
    master = plate(master_kind, 6, low=-1, high=2)
    inclined = master.points.copy()
    inclined[:, -1] = -0.4 + 0.8 * (inclined[:, 0] - 0.5)
    master = faceted_surface(inclined, master.facets)
    coupling = mortar_coupling(slave, master)
    assert coupling.area.sum() == pytest.approx(1.0, rel=1e-12)
    np.testing.assert_allclose(coupling.gap, 0.4 - 0.8 * (slave.points[:, 0] - 0.5), atol=1e-12)


def test_surfaces_of_different_dimension_are_refused() -> None:
    with pytest.raises(InvalidInputError, match="same dimension, got a slave in 3 and a master in 2"):
        mortar_coupling(plate("quads", 2), plate("edges", 2))


def test_folded_slave_facets_are_refused() -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0.2, 0.2, 0], [0, 1, 0]])
    with pytest.raises(InvalidInputError, match="convex facets on the slave surface, but 1 are folded"):
        mortar_coupling(faceted_surface(points, np.array([[3, 2, 1, 0]])), plate("quads", 2))


@kinds
@pytest.mark.parametrize("between", [0.01, 0.1, 3.0])
def test_only_the_nearest_of_several_layers_counts(slave_kind: str, master_kind: str, between: float) -> None:
    slave = plate(slave_kind, 5, up=False, height=0.02)
    front = plate(master_kind, 6, low=-0.1, high=1.1)
    back = plate(master_kind, 7, low=-0.3, high=1.4, height=-between)
    points = np.vstack([back.points, front.points])
    both = faceted_surface(points, np.vstack([back.facets, front.facets + len(back.points)]))
    coupling, alone = mortar_coupling(slave, both), mortar_coupling(slave, front)
    np.testing.assert_allclose(coupling.area, alone.area, rtol=1e-12)
    weights = np.hstack([np.zeros((len(slave.nodes), len(back.nodes))), alone.weight.toarray()])
    np.testing.assert_allclose(coupling.weight.toarray(), weights, atol=1e-12)
    np.testing.assert_allclose(coupling.gap, 0.02, atol=1e-13)


@kinds
def test_the_rear_side_of_a_thin_plate_is_not_met(slave_kind: str, master_kind: str) -> None:
    front, rear = plate(master_kind, 6, low=-0.1), plate(master_kind, 5, low=-0.1, height=-0.01, up=False)
    points = np.vstack([rear.points, front.points])
    both = faceted_surface(points, np.vstack([rear.facets, front.facets + len(rear.points)]))
    coupling = mortar_coupling(plate(slave_kind, 5, up=False, height=-0.008), both)
    assert coupling.area.sum() == pytest.approx(1.0, rel=1e-12)
    np.testing.assert_allclose(coupling.gap, -0.008, atol=1e-13)


@kinds
@pytest.mark.parametrize("chunk", [1, 7])
def test_the_size_of_chunks_does_not_matter(
    slave_kind: str, master_kind: str, chunk: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    slave, master = (
        plate(slave_kind, 6, up=False, skew=1.0),
        plate(master_kind, 5, low=0.3, high=1.5, turn=0.4),
    )
    whole = mortar_coupling(slave, master)
    monkeypatch.setattr("fenics_contact._pairing.mortar.coupling.CHUNK", chunk)
    cut = mortar_coupling(slave, master)
    np.testing.assert_array_equal(cut.node, whole.node)
    np.testing.assert_allclose(cut.area, whole.area, rtol=1e-13)
    np.testing.assert_allclose(cut.weight.toarray(), whole.weight.toarray(), atol=1e-13)
