"""The reverse mode through the closest-point projection agrees with difference quotients, term by term."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest

from fenics_contact._pairing.points import tangent_frames
from fenics_contact._surfaces.facets import (
    FacetedSurface,
    Relief,
    faceted_surface,
    heights,
    outside,
    shape_functions,
)
from fenics_contact._surfaces.projection import Projection, project
from fenics_contact._surfaces.true_surface import by_shape, height_over, reconstructed
from fenics_contact.design import surface_derivatives as projection_derivative
from fenics_contact.design.surface_derivatives import (
    PointDerivatives,
    frames_pulled_back,
    normals_pulled_back,
    projection_pulled_back,
)
from fenics_contact.gallery import block
from fenics_contact.shapes import Torus

CELLS = ("hexahedron", "tetrahedron")
#: What is known of the master: its facets, the shape they stand for, or its nodes, which suggest one.
KNOWN = ("facets", "shape", "nodes")
TORUS = Torus((0.0, 0.75, 3.0), (1.0, 0.0, 0.0), 7.0, 4.0)
UP = np.array([0.0, 0.0, 1.0])
STEP = 1e-6
SHAPES = {"gap": (), "normal": (3,), "tangents": (2, 3), "weight": ("corners",)}


@dataclass(frozen=True)
class Setting:
    """A master of bilinear or triangular facets and points on either side of it."""

    points: np.ndarray
    facets: np.ndarray
    slave: np.ndarray
    mirrored: np.ndarray | None = None
    relief: Relief | None = None

    @property
    def master(self) -> FacetedSurface:
        return replace(faceted_surface(self.points, self.facets, self.mirrored), relief=self.relief)

    def moved(self, by_master: np.ndarray, by_slave: np.ndarray) -> Setting:
        return replace(self, points=self.points + by_master, slave=self.slave + by_slave)

    def hit(self) -> Projection:
        master = self.master
        found = project(self.slave, np.tile(-UP, (len(self.slave), 1)), master)
        assert np.array_equal(found.point, np.arange(len(self.slave)))
        return found

    def projected(self) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Return the facets hit, and gap, normal, tangents and weights of every point."""
        hit = self.hit()
        weight, _ = shape_functions(hit.local, self.master.corners)
        frames = tangent_frames(hit.normal)
        return hit.facet, {"gap": hit.gap, "normal": hit.normal, "tangents": frames, "weight": weight}


@cache
def setting(cell: str, known: str = "facets") -> Setting:
    """A wavy master, or where its shape is known a torus; all but facets end in a plane of symmetry."""
    rng = np.random.default_rng(7)
    mesh = block((0.0, 0.0, -1.0), (2.0, 1.5, 0.0), (5, 4, 1), cell)
    x, y, z = mesh.points.T
    wavy = np.column_stack([x + 0.04 * np.sin(3 * y), y, z + (z + 1) * 0.15 * np.sin(2 * x) * np.cos(3 * y)])
    wavy = wavy + 0.01 * rng.standard_normal(wavy.shape)
    places = rng.uniform([0.3, 0.3], [1.7, 1.2], (30, 2))
    height = 0.15 * np.sin(2 * places[:, 0]) * np.cos(3 * places[:, 1]) + rng.uniform(-0.05, 0.2, 30)
    facets, slave = mesh.surfaces["z1"], np.column_stack([places, height])
    if known == "facets":
        return Setting(wavy, facets, slave)
    if known == "shape":
        slave[:, 2] = height_over(slave * [1, 1, 0], np.tile(UP, (30, 1)), TORUS) + rng.uniform(
            -0.05, 0.2, 30
        )
        top = np.unique(facets)
        wavy[top] += height_over(wavy[top], np.tile(UP, (len(top), 1)), TORUS)[:, None] * UP
    mirrored = np.zeros(wavy.shape, dtype=bool)
    mirrored[x == 0.0, 0] = True
    surface = faceted_surface(wavy, facets, mirrored)
    whole = by_shape(surface, TORUS) if known == "shape" else reconstructed(surface)
    return Setting(wavy, facets, slave, mirrored, whole.relief)


def derivatives_by_points(here: Setting, term: str, rng: np.random.Generator) -> PointDerivatives:
    """Random derivatives by one term, none by the others."""
    count, corners = len(here.slave), here.facets.shape[1]
    sizes = {name: tuple(corners if n == "corners" else n for n in shape) for name, shape in SHAPES.items()}
    parts = {name: np.zeros((count, *size)) for name, size in sizes.items()}
    parts[term] = rng.standard_normal(parts[term].shape)
    return PointDerivatives(**parts)


def both_ways(here: Setting, term: str, what: str) -> tuple[float, float]:
    """Return the adjoint's derivative along a random motion of one side, and the difference quotient."""
    rng = np.random.default_rng(11)
    hit, nodes = here.hit(), here.master.nodes
    by = derivatives_by_points(here, term, rng)
    by_slave, by_master = projection_pulled_back(here.master, hit.facet, hit.local, hit.gap, by)
    move_master, move_slave = np.zeros_like(here.points), np.zeros_like(here.slave)
    if what == "master":
        move_master[nodes] = rng.standard_normal((len(nodes), 3))
    else:
        move_slave = rng.standard_normal(here.slave.shape)
    values = []
    for sign in (1, -1):
        facet, found = here.moved(sign * STEP * move_master, sign * STEP * move_slave).projected()
        assert np.array_equal(facet, hit.facet)
        values.append(found[term])
    quotient = np.sum(getattr(by, term) * (values[0] - values[1])) / (2 * STEP)
    return float(np.sum(by_slave * move_slave) + np.sum(by_master * move_master[nodes])), float(quotient)


@pytest.mark.parametrize("known", KNOWN)
@pytest.mark.parametrize("cell", CELLS)
def test_points_lie_on_both_sides_and_inside_facets(cell: str, known: str) -> None:
    here = setting(cell, known)
    hit = here.hit()
    assert np.count_nonzero(hit.gap < -0.01) > 2
    assert np.count_nonzero(hit.gap > 0.01) > 10
    assert len(np.unique(hit.facet)) > 8
    # A point in the middle of a facet would hide errors in its local coordinates.
    assert np.abs(hit.local).max() > 0.6
    assert outside(hit.local, here.master.corners).max() == 0.0
    above = heights(here.master, hit.facet, hit.local)
    assert (np.abs(above.value).max() > 1e-3) == (np.abs(above.by_local).max() > 1e-3) == (known != "facets")
    assert here.master.mirrored.any() == (known != "facets")


@pytest.mark.parametrize("what", ["master", "slave"])
@pytest.mark.parametrize("term", SHAPES)
@pytest.mark.parametrize("known", KNOWN)
@pytest.mark.parametrize("cell", CELLS)
def test_each_term_agrees_with_central_differences(cell: str, known: str, term: str, what: str) -> None:
    adjoint, quotient = both_ways(setting(cell, known), term, what)
    assert abs(adjoint) > 0.1
    assert adjoint == pytest.approx(quotient, rel=1e-6)


@pytest.mark.parametrize("known", ["shape", "nodes"])
@pytest.mark.parametrize("cell", CELLS)
def test_the_gap_changes_with_the_slopes_of_the_true_surface(
    monkeypatch: pytest.MonkeyPatch, cell: str, known: str
) -> None:
    here = setting(cell, known)
    monkeypatch.setattr(
        projection_derivative,
        "slopes_pulled_back",
        lambda surface, facet, by: tuple(np.zeros((3, *surface.points.shape))),
    )
    adjoint, quotient = both_ways(here, "gap", "master")
    assert abs(adjoint - quotient) > 1e-2 * abs(quotient)
    adjoint, quotient = both_ways(here, "gap", "slave")
    assert adjoint == pytest.approx(quotient, rel=1e-6)


@pytest.mark.parametrize("known", ["shape", "nodes"])
@pytest.mark.parametrize("cell", CELLS)
def test_the_gap_changes_by_the_second_order_beside_its_derivative(cell: str, known: str) -> None:
    here, rng = setting(cell, known), np.random.default_rng(12)
    hit, nodes = here.hit(), here.master.nodes
    by = derivatives_by_points(here, "gap", rng)
    by_slave, by_master = projection_pulled_back(here.master, hit.facet, hit.local, hit.gap, by)
    move_master, move_slave = np.zeros_like(here.points), rng.standard_normal(here.slave.shape)
    move_master[nodes] = rng.standard_normal((len(nodes), 3))
    slope = np.sum(by_slave * move_slave) + np.sum(by_master * move_master[nodes])
    rests = []
    for step in (1e-4, 2e-4):
        facet, found = here.moved(step * move_master, step * move_slave).projected()
        assert np.array_equal(facet, hit.facet)
        rests.append(abs(np.sum(by.gap * (found["gap"] - hit.gap)) - step * slope))
    assert np.log2(rests[1] / rests[0]) > 1.9


@pytest.mark.parametrize("given", [False, True])
def test_frames_turn_with_their_normals(given: bool) -> None:
    """About the axis that is least aligned, or one that is given."""
    rng = np.random.default_rng(3)
    axes = np.eye(3)[rng.integers(0, 3, 40)] if given else None
    normals = rng.standard_normal((40, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    by_tangents, turn = rng.standard_normal((40, 2, 3)), rng.standard_normal((40, 3))
    turn -= np.einsum("nd,nd->n", turn, normals)[:, None] * normals

    def frames(step: float) -> np.ndarray:
        moved = normals + step * turn
        return tangent_frames(moved / np.linalg.norm(moved, axis=1)[:, None], axes)

    quotients = np.einsum("nad,nad->n", by_tangents, frames(STEP) - frames(-STEP)) / (2 * STEP)
    adjoint = np.einsum("nd,nd->n", frames_pulled_back(normals, by_tangents, axes), turn)
    assert np.abs(quotients).min() > 1e-3
    assert adjoint == pytest.approx(quotients, rel=1e-5, abs=1e-7)


@pytest.mark.parametrize("cell", CELLS)
def test_normals_in_a_plane_of_symmetry_turn_within_it(cell: str) -> None:
    rng = np.random.default_rng(4)
    known = setting(cell).master
    mirrored = np.zeros(known.points.shape, dtype=bool)
    side = known.points[:, 0] < 0.1
    mirrored[side, 0] = True
    by, way = rng.standard_normal((2, *known.points.shape))

    def normals(step: float) -> np.ndarray:
        return faceted_surface(known.points + step * way, known.facets, mirrored).normals

    assert not normals(0.0)[side, 0].any()
    quotient = np.sum(by * (normals(STEP) - normals(-STEP))) / (2 * STEP)
    surface = faceted_surface(known.points, known.facets, mirrored)
    found = np.sum(normals_pulled_back(surface, by) * way)
    assert abs(found) > 0.1
    assert found == pytest.approx(quotient, rel=1e-6)
    plain = faceted_surface(known.points, known.facets)
    assert abs(np.sum(normals_pulled_back(plain, by) * way) - found) > 1e-3 * abs(found)


@pytest.mark.parametrize("known", KNOWN)
@pytest.mark.parametrize("cell", CELLS)
def test_pushing_a_point_along_the_normal_opens_its_gap_and_nothing_else(cell: str, known: str) -> None:
    here = setting(cell, known)
    hit = here.hit()
    for term in SHAPES:
        by = derivatives_by_points(here, term, np.random.default_rng(5))
        by_slave, _ = projection_pulled_back(here.master, hit.facet, hit.local, hit.gap, by)
        along = np.einsum("nd,nd->n", by_slave, hit.normal)
        assert along == pytest.approx(by.gap, abs=1e-10)


@pytest.mark.parametrize("known", KNOWN)
@pytest.mark.parametrize("cell", CELLS)
def test_moving_everything_together_changes_nothing(cell: str, known: str) -> None:
    here = setting(cell, known)
    hit = here.hit()
    for term in SHAPES:
        by = derivatives_by_points(here, term, np.random.default_rng(5))
        by_slave, by_master = projection_pulled_back(here.master, hit.facet, hit.local, hit.gap, by)
        assert np.abs(by_slave).max() > 0.1
        assert by_slave.sum(axis=0) + by_master.sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-10)
