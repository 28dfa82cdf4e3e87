"""Mortar coupling: weights, dual basis, clipping and curved surfaces."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from mpi4py import MPI
from scipy.optimize import linprog
from scipy.spatial import ConvexHull, HalfspaceIntersection

from fenics_contact._pairing.mortar.cells import Cells, clip, simplices
from fenics_contact._pairing.mortar.coupling import (
    CORNERS,
    DualBasis,
    MortarCoupling,
    _heights_along,
    mortar_coupling,
)
from fenics_contact._pairing.mortar.derivatives import weight_derivatives
from fenics_contact._pairing.mortar.planes import measure, rule
from fenics_contact._surfaces.facets import (
    FacetedSurface,
    Relief,
    facet_shape_values,
    faceted_surface,
    nodal_areas,
)
from fenics_contact._surfaces.pieces import local_coordinates
from fenics_contact.errors import InvalidInputError
from tests.conftest import run_on_ranks
from tests.pairing.mortar_on_ranks import collect, message_for_a_folded_facet
from tests.pairing.mortar_surfaces import CURVED, KINDS, SOLID, moved, plate, rotation, shell

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


# Quadratic facets: dual functions of their pieces, displacements of the whole facets.
curved = pytest.mark.parametrize(("slave_kind", "master_kind"), CURVED)


def pressed_by_one(surface: FacetedSurface) -> np.ndarray:
    """Nodal forces of a unit pressure."""
    facets = surface.whole
    areas = nodal_areas(surface.points, facets)
    return np.bincount(facets.ravel(), areas.ravel(), minlength=len(surface.points))


@curved
def test_constant_tractions_are_those_of_whole_quadratic_facets(slave_kind: str, master_kind: str) -> None:
    """On both sides, of a slave inside its master, up to the degree of quadrature on bent quadrilaterals."""
    slave = plate(slave_kind, 4, up=False, skew=1.0, height=0.1)
    master = plate(master_kind, 3, low=-0.2, high=1.3, skew=0.4)
    coupling = mortar_coupling(slave, master)
    assert np.all(coupling.area > 0.0)
    own = coupling.of_slave_pulled_back(coupling.area, len(slave.nodes))
    np.testing.assert_allclose(own, pressed_by_one(slave), atol=1e-11)
    np.testing.assert_allclose(
        coupling.of_slave(slave.points),
        coupling.weight @ master.points + [*[0.0] * (slave.dim - 1), 0.1],
        atol=1e-11,
    )
    np.testing.assert_allclose(coupling.gap, 0.1, atol=1e-12)
    quadratic = [side.points[:, 0] ** 2 for side in (slave, master)]
    if "quads" not in slave_kind + master_kind and len(slave_kind) == len(master_kind):
        np.testing.assert_allclose(
            coupling.of_slave(quadratic[0]), coupling.weight @ quadratic[1], atol=1e-11
        )


@curved
def test_constant_tractions_arrive_on_a_quadratic_master_inside_the_slave(
    slave_kind: str, master_kind: str
) -> None:
    slave = plate(slave_kind, 6, up=False, low=-0.3, high=1.2)
    master = plate(master_kind, 5, turn=0.25)
    coupling = mortar_coupling(slave, master)
    np.testing.assert_allclose(coupling.area @ coupling.weight, pressed_by_one(master), atol=1e-12)
    np.testing.assert_allclose(coupling.of_slave(slave.points), coupling.weight @ master.points, atol=1e-9)


@curved
def test_means_of_the_slave_are_close_to_its_nodes(slave_kind: str, master_kind: str) -> None:
    """The spectrum of the symmetric part, in terms of the areas: multipliers are determined on any mesh."""
    coupling = mortar_coupling(
        plate(slave_kind, 4, up=False, skew=1.0), plate(master_kind, 3, low=-0.2, high=1.3)
    )
    if coupling.own is None:
        assert "edges" == slave_kind or slave_kind in ("quads", "triangles")
        return
    root = np.sqrt(coupling.area)
    matrix = root[:, None] * coupling.own.toarray() / root
    values = np.linalg.eigvalsh((matrix + matrix.T) / 2)
    assert 0.6 < values.min() < values.max() < 1.45


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


@pytest.mark.parametrize("kind", KINDS)
def test_no_points_of_a_true_surface_have_no_heights(kind: str) -> None:
    """Candidates for contact may all be apart."""
    surface = plate(kind, 4)
    corners = np.zeros((*surface.facets.shape, surface.dim))
    flat = Relief(np.zeros_like(surface.normals), corners, np.zeros((len(corners), surface.corners + 1)))
    local, values = np.zeros((0, 7, surface.dim - 1)), np.zeros((0, 7, surface.corners))
    nothing = np.zeros(0, dtype=np.int64)
    found = _heights_along(replace(surface, relief=flat), nothing, local, values, np.zeros((0, surface.dim)))
    assert found.shape == (0, 7)


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


# Derivatives of mortar weights by both surfaces, one by one.
def moved_surfaces(surface: FacetedSurface, by: np.ndarray) -> FacetedSurface:
    return replace(surface, points=surface.points + by, relief=None)


@pytest.mark.parametrize("kinds", KINDS, ids="-".join)
@pytest.mark.parametrize("name", ["plates", "rim", "shells"])
def test_weights_change_as_their_derivatives_say(name: str, kinds: tuple[str, str]) -> None:
    """At the rim of the master and on quadrilaterals that warp, dual functions change as well."""
    if name == "shells":
        slave, master = (
            shell(kind, cells, radius, convex=convex, span=span)
            for kind, cells, radius, convex, span in (
                (kinds[0], 9, 1.0, True, (0.2, 0.9)),
                (kinds[1], 7, 1.02, False, (0.0, 1.0)),
            )
        )
        # No rim of the master over a rim of the slave, where derivatives differ on both sides.
        aside = 1.3 * master.points[:, 2:] - 0.15
        master = replace(master, points=np.hstack([master.points[:, :2], aside]))
    else:
        low, high = (0.2, 0.9) if name == "plates" else (0.2, 1.2)
        slave = plate(kinds[0], 5, height=0.01, up=False, low=low, high=high, turn=0.3)
        master = plate(kinds[1], 7)
    random, step = np.random.default_rng(5), 1e-6
    ways = [random.standard_normal(each.points.shape) for each in (slave, master)]
    coupling = mortar_coupling(slave, master)
    found = weight_derivatives(slave, master, coupling, np.ones(len(coupling.node), dtype=bool))
    slope = found.rows @ np.concatenate([way.ravel() for way in ways])
    ahead, behind = (
        mortar_coupling(
            moved_surfaces(slave, sign * step * ways[0]), moved_surfaces(master, sign * step * ways[1])
        ).weight
        for sign in (1, -1)
    )
    quotient = np.asarray((ahead - behind)[found.point, found.node]).ravel() / (2 * step)
    error = np.abs(slope - quotient).max() / np.abs(quotient).max()
    assert np.abs(quotient).max() > 1.0
    assert error < 1e-7


# Mortar coupling of concentric cylinders and circles with different meshes tends to the true distance.
GAP = 0.05


def pair(slave_kind: str, master_kind: str, n: int, convex: bool) -> tuple[FacetedSurface, FacetedSurface]:
    """A shaft in a hole as slave, or the hole as slave and the shaft as master."""
    slave = shell(slave_kind, n, 1.0 if convex else 1 + GAP, convex=convex, span=(0.3, 1.5))
    master = shell(
        master_kind, 4 * n // 3, 1 + GAP if convex else 1.0, convex=not convex, span=(0.0, 2.0), uneven=-0.2
    )
    return slave, master


@kinds
@pytest.mark.parametrize("convex", [True, False])
def test_gaps_between_concentric_shells_converge_with_second_order(
    slave_kind: str, master_kind: str, convex: bool
) -> None:
    errors = []
    for n in (6, 12, 24, 48):
        slave, master = pair(slave_kind, master_kind, n, convex)
        coupling = mortar_coupling(slave, master)
        assert len(coupling.node) == len(slave.nodes)
        assert coupling.area.sum() == pytest.approx(slave.areas.sum(), rel=1e-12)
        errors.append(np.abs(coupling.gap - GAP).max())
    rates = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert rates[-1] > 1.8, f"orders of the gap: {rates}"
    assert errors[0] > 1e-4, "the coarse shells are too good: nothing was tested"


@kinds
def test_coarse_shells_give_bounded_weights_and_rows_that_add_up(slave_kind: str, master_kind: str) -> None:
    coupling = mortar_coupling(*pair(slave_kind, master_kind, 3, True))
    assert len(coupling.node) > 0
    np.testing.assert_allclose(coupling.weight.sum(axis=1), 1.0, atol=1e-12)
    assert np.abs(coupling.weight.toarray()).max() < 5


@kinds
def test_rigid_motions_of_shells_change_nothing(slave_kind: str, master_kind: str) -> None:
    slave, master = pair(slave_kind, master_kind, 9, True)
    turn, shift = rotation(slave.dim), np.arange(slave.dim) - 0.4
    before: MortarCoupling = mortar_coupling(slave, master)
    after = mortar_coupling(moved(slave, turn, shift), moved(master, turn, shift))
    np.testing.assert_array_equal(after.node, before.node)
    np.testing.assert_allclose(after.area, before.area, rtol=1e-10)
    np.testing.assert_allclose(after.weight.toarray(), before.weight.toarray(), atol=1e-9)
    np.testing.assert_allclose(after.gap, before.gap, atol=1e-12)


@kinds
def test_the_other_side_of_a_hole_is_not_met(slave_kind: str, master_kind: str) -> None:
    hole = shell(master_kind, 60, 1.02, convex=False, span=(0.0, 6.2), uneven=0.0)
    shaft = shell(slave_kind, 20, 1.0, convex=True, span=(0.2, 2.2))
    coupling = mortar_coupling(shaft, hole)
    assert len(coupling.node) == len(shaft.nodes)
    met = np.unique(coupling.weight.indices)
    assert np.arctan2(hole.points[met, 1], hole.points[met, 0]).min() > 0
    np.testing.assert_allclose(coupling.gap, 0.02, atol=5e-3)


# Dual functions are biorthogonal to the shape functions on whatever part of a facet is covered.
def covered(corners: int, parts: np.ndarray, share_of_pairs: np.ndarray) -> Cells:
    """Cells on one facet in its own local coordinates, coupled with the facet's own shape functions."""
    barycentric, weights = rule(parts.shape[1])
    local = barycentric @ parts
    values = facet_shape_values(local, corners)
    size = np.abs(measure(parts))[:, None] * weights
    return Cells(np.zeros(len(parts), dtype=np.int64), share_of_pairs, size, local, local, values, values)


def without_field(cells: Cells) -> tuple[np.ndarray, np.ndarray]:
    """Integrals of shape functions alone."""
    basis = DualBasis.on(cells)
    return basis.coverage, basis.integrals(cells.master)


def inside(corners: int, seed: int, count: int, width: float) -> np.ndarray:
    """Small simplices somewhere in a facet."""
    rng = np.random.default_rng(seed)
    dim = 2 if corners == 2 else 3
    low, high = CORNERS[corners].min(), (0.5 if corners == 3 else 0.9)
    middle = rng.uniform(low, high - width, dim - 1)
    return middle + width * rng.uniform(0, 1, (count, dim, dim - 1))


@given(
    st.sampled_from([2, 3, 4]), st.integers(0, 10**6), st.integers(1, 5), st.sampled_from([0.01, 0.1, 0.4])
)
def test_dual_functions_are_biorthogonal_on_the_covered_part(
    corners: int, seed: int, count: int, width: float
) -> None:
    cells = covered(corners, inside(corners, seed, count, width), np.arange(count))
    coverage, integrals = without_field(cells)
    scale = coverage.sum()
    np.testing.assert_allclose(coverage[0], np.einsum("nq,nqk->k", cells.weight, cells.slave), rtol=1e-12)
    # Thin triangles are slivers, in which only sums are kept.
    np.testing.assert_allclose(integrals.sum(axis=(0, 2)), coverage[0], atol=1e-9 * scale)
    np.testing.assert_allclose(integrals.sum(axis=(0, 1)), coverage[0], atol=1e-9 * scale)


@pytest.mark.parametrize("corners", [2, 3, 4])
@pytest.mark.parametrize("width", [1.0, 0.1, 0.01])
def test_integrals_with_the_shape_functions_are_diagonal(corners: int, width: float) -> None:
    corner = CORNERS[corners]
    part = corner[[0, 1]] if corners == 2 else corner[[0, 1, 2]]
    parts = (corner[0] + width * (part - corner[0]))[None]
    coverage, integrals = without_field(covered(corners, parts, np.array([0])))
    assert (coverage > 0).all()
    np.testing.assert_allclose(integrals[0], np.diag(coverage[0]), atol=1e-13 * coverage.sum() / width**2)


def test_slivers_are_not_extrapolated() -> None:
    strip = np.array([[[-1.0, -1], [1, -1], [1, -1 + 1e-7]], [[-1, -1], [1, -1 + 1e-7], [-1, -1 + 1e-7]]])
    cells = covered(4, strip, np.array([0, 0]))
    coverage, integrals = without_field(cells)
    values = integrals[0] / coverage[0][:, None]
    # Along the strip all is linear; across it the far corners take the values of the near ones.
    np.testing.assert_allclose(values[0], values[3], atol=1e-6)
    np.testing.assert_allclose(values[0], [1, 0, 0, 0], atol=1e-6)
    np.testing.assert_allclose(values.sum(axis=1), 1.0, atol=1e-12)


def test_facets_do_not_mix() -> None:
    rng = np.random.default_rng(8)
    parts = [inside(4, seed, 3, 0.4) for seed in (1, 2)]
    alone = [without_field(covered(4, part, np.array([0, 1, 1]))) for part in parts]
    both = covered(4, np.concatenate(parts), np.array([0, 1, 1, 2, 3, 3]))
    order = rng.permutation(6)
    cells = Cells(
        np.repeat([0, 1], 3)[order],
        both.pair[order],
        both.weight[order],
        both.local[order],
        both.opposite[order],
        both.slave[order],
        both.master[order],
    )
    coverage, integrals = without_field(cells)
    np.testing.assert_allclose(coverage, np.concatenate([a[0] for a in alone]), rtol=1e-12)
    np.testing.assert_allclose(integrals, np.concatenate([a[1] for a in alone]), atol=1e-10)


# Clipped polygons are the intersections that half-planes give; local coordinates and rules are exact.

#: Coordinates that often coincide, so that corners meet corners and edges meet edges, and any others.
coordinate = st.one_of(st.integers(-4, 4).map(lambda k: k / 4), st.floats(-1, 1))
point = st.tuples(coordinate, coordinate)
area_of = measure


def convex(corners: int) -> st.SearchStrategy[np.ndarray]:
    """Convex polygons, counterclockwise, as images of a regular one and triangles of any three points."""
    if corners == 3:
        return (
            st.tuples(point, point, point).map(np.array).filter(lambda p: abs(doubled(p)) > 0.05).map(ordered)
        )
    return st.tuples(point, point, point, point).map(np.array).filter(is_convex).map(ordered)


def doubled(p: np.ndarray) -> float:
    return float(2 * measure(p[None])[0])


def ordered(p: np.ndarray) -> np.ndarray:
    return p if doubled(p) > 0 else p[::-1]


def is_convex(p: np.ndarray) -> bool:
    turned = [doubled(p[[i, (i + 1) % 4, (i + 2) % 4]]) for i in range(4)]
    return min(turned) > 0.02 or max(turned) < -0.02


def half_planes(p: np.ndarray) -> np.ndarray:
    """Rows (a, b, c) with a x + b y + c ≤ 0 inside."""
    along = np.roll(p, -1, axis=0) - p
    outward = np.column_stack([along[:, 1], -along[:, 0]]) / np.linalg.norm(along, axis=1)[:, None]
    return np.column_stack([outward, -(outward * p).sum(axis=1)])


def intersection_area(p: np.ndarray, q: np.ndarray) -> float:
    """Area of the intersection by half-planes around the centre of its largest circle."""
    planes = np.vstack([half_planes(p), half_planes(q)])
    rows = np.column_stack([planes[:, :2], np.ones(len(planes))])
    best = linprog([0, 0, -1], rows, -planes[:, 2], bounds=[(None, None)] * 2 + [(0, None)])
    if not best.success or best.x[2] < 1e-7:
        return 0.0
    return float(ConvexHull(HalfspaceIntersection(planes, best.x[:2]).intersections).volume)


def clipped_area(p: np.ndarray, q: np.ndarray) -> float:
    vertices, count = clip(p[None], q[None])
    triangles, *_ = simplices(vertices, count)
    assert (measure(triangles) > -1e-15).all()
    return float(measure(triangles).sum())


polygon = st.sampled_from([3, 4]).flatmap(convex)


@given(polygon, polygon)
def test_clipping_finds_the_area_of_the_intersection(p: np.ndarray, q: np.ndarray) -> None:
    area = clipped_area(p, q)
    assert area == pytest.approx(intersection_area(p, q), abs=1e-6)
    assert area == pytest.approx(clipped_area(q, p), abs=1e-13)
    assert area <= min(measure(p[None])[0], measure(q[None])[0]) + 1e-13
    assert area == pytest.approx(clipped_area(np.roll(p, 1, axis=0), q), abs=1e-13)


@given(polygon, polygon)
def test_vertices_of_the_intersection_lie_in_both(p: np.ndarray, q: np.ndarray) -> None:
    vertices, count = clip(p[None], q[None])
    assume(count[0] > 0)
    homogeneous = np.column_stack([vertices[0], np.ones(len(vertices[0]))])
    assert (homogeneous @ np.vstack([half_planes(p), half_planes(q)]).T).max() < 1e-10
    np.testing.assert_array_equal(
        vertices[0, count[0] :], np.tile(vertices[0, 0], (len(vertices[0]) - count[0], 1))
    )


def test_many_pairs_are_clipped_as_each_alone() -> None:
    rng = np.random.default_rng(3)
    shift = rng.uniform(-1.2, 1.2, (200, 1, 2))
    square = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    turned = square @ np.array([[0.8, 0.6], [-0.6, 0.8]])
    subject, window = turned + shift, np.tile(square, (200, 1, 1))
    vertices, count = clip(subject, window)
    triangles, pair, _ = simplices(vertices, count)
    together = np.bincount(pair, weights=measure(triangles), minlength=200)
    alone = [clipped_area(p, q) for p, q in zip(subject, window, strict=True)]
    np.testing.assert_allclose(together, alone, atol=1e-15)
    assert (count == 0).any()
    assert (count >= 6).any(), "too simple intersections"


def test_intervals_are_clipped_too() -> None:
    subject = np.array([[0.0, 1], [0.0, 1], [0.0, 1], [2.0, 5]])[:, :, None]
    window = np.array([[0.5, 2], [-1, 3], [1, 2], [3, 4]])[:, :, None]
    pieces, pair, _ = simplices(*clip(subject, window))
    np.testing.assert_array_equal(pair, [0, 1, 3])
    np.testing.assert_array_equal(pieces[:, :, 0], [[0.5, 1], [0, 1], [3, 4]])


@given(convex(4), st.floats(-1, 1), st.floats(-1, 1), st.booleans())
def test_local_coordinates_of_quadrilaterals_invert_the_bilinear_map(
    p: np.ndarray, s: float, t: float, backwards: bool
) -> None:
    p = p[::-1] if backwards else p
    local = np.array([[[s, t]]])
    there = facet_shape_values(local, 4) @ p[None]
    again = facet_shape_values(local_coordinates(there, p[None]), 4) @ p[None]
    np.testing.assert_allclose(again, there, atol=1e-13)
    np.testing.assert_allclose(local_coordinates(there, p[None]), local, atol=1e-9)


@pytest.mark.parametrize("corners", [2, 3])
def test_local_coordinates_of_simplices_invert_the_linear_map(corners: int) -> None:
    rng = np.random.default_rng(5)
    flat, local = rng.uniform(-1, 1, (50, corners, corners - 1)), rng.uniform(0, 0.5, (50, 4, corners - 1))
    np.testing.assert_allclose(
        local_coordinates(facet_shape_values(local, corners) @ flat, flat), local, atol=1e-10
    )


def test_the_rules_integrate_polynomials_of_degree_five() -> None:
    barycentric, weights = rule(2)
    x = barycentric[:, 1]
    np.testing.assert_allclose([weights @ x**k for k in range(6)], 1 / np.arange(1, 7), rtol=1e-14)
    barycentric, weights = rule(3)
    x, y = barycentric[:, 1], barycentric[:, 2]
    factorial = np.cumprod([1, *range(1, 8)])
    powers = [(i, j) for i in range(6) for j in range(6 - i)]
    exact = [2 * factorial[i] * factorial[j] / factorial[i + j + 2] for i, j in powers]
    np.testing.assert_allclose([weights @ (x**i * y**j) for i, j in powers], exact, rtol=1e-13)


@pytest.mark.parametrize("count", [0, 3])
def test_nothing_is_left_of_no_pairs_and_of_pairs_apart(count: int) -> None:
    square = np.tile(np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]]), (count, 1, 1))
    vertices, left = clip(square + 2, square)
    np.testing.assert_array_equal(left, np.zeros(count))
    triangles, pair, _ = simplices(vertices, left)
    assert triangles.shape == (0, 3, 2)
    assert len(pair) == 0


# Mortar coupling is the same on any number of ranks, and all ranks raise what one of them meets.
SCRIPT = Path(__file__).with_name("mortar_on_ranks.py")


@pytest.mark.parametrize("ranks", [3])
def test_coupling_and_errors_do_not_depend_on_the_number_of_ranks(ranks: int, tmp_path: Path) -> None:
    run_on_ranks(SCRIPT, ranks, tmp_path / "numbers.npz", timeout=60)
    with np.load(tmp_path / "numbers.npz") as stored:
        parallel = dict(stored)
    messages = parallel.pop("messages")
    serial = collect(MPI.COMM_SELF)
    assert set(parallel) == set(serial)
    for name, numbers in serial.items():
        assert numbers.size > 0, f"{name} is empty: nothing was compared"
        np.testing.assert_allclose(parallel[name], numbers, rtol=1e-9, atol=1e-9 if " by " in name else 1e-12)
    assert len(messages) == ranks
    alone = message_for_a_folded_facet(MPI.COMM_SELF)
    assert "convex facets on the slave surface, but 1 are folded" in alone
    assert all(str(text).startswith(alone) for text in messages)
