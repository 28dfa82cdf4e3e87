"""The reverse mode through the closest-point projection agrees with difference quotients, term by term."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest

from fenics_contact.feti.contact_points import tangent_frames
from fenics_contact.geometry import block
from fenics_contact.shape.projection_derivative import (
    PointDerivatives,
    frames_pulled_back,
    projection_pulled_back,
)
from fenics_contact.shape.surface_derivative import normals_pulled_back
from fenics_contact.surfaces.facets import FacetedSurface, faceted_surface, outside, shape_functions
from fenics_contact.surfaces.projection import project

CELLS = ("hexahedron", "tetrahedron")
STEP = 1e-6
SHAPES = {"gap": (), "normal": (3,), "tangents": (2, 3), "weight": ("corners",)}


@dataclass(frozen=True)
class Setting:
    """A wavy master of bilinear or triangular facets and points on either side of it."""

    points: np.ndarray
    facets: np.ndarray
    slave: np.ndarray

    @property
    def master(self) -> FacetedSurface:
        return faceted_surface(self.points, self.facets)

    def moved(self, by_master: np.ndarray, by_slave: np.ndarray) -> Setting:
        return Setting(self.points + by_master, self.facets, self.slave + by_slave)

    def projected(self) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Return the facets hit, and gap, normal, tangents and weights of every point."""
        master = self.master
        hit = project(self.slave, np.tile([0.0, 0.0, -1.0], (len(self.slave), 1)), master)
        assert np.array_equal(hit.point, np.arange(len(self.slave)))
        weight, _ = shape_functions(hit.local, master.corners)
        frames = tangent_frames(hit.normal)
        return hit.facet, {"gap": hit.gap, "normal": hit.normal, "tangents": frames, "weight": weight}


@cache
def setting(cell: str) -> Setting:
    rng = np.random.default_rng(7)
    mesh = block((0.0, 0.0, -1.0), (2.0, 1.5, 0.0), (5, 4, 1), cell)
    x, y, z = mesh.points.T
    wavy = np.column_stack([x + 0.04 * np.sin(3 * y), y, z + (z + 1) * 0.15 * np.sin(2 * x) * np.cos(3 * y)])
    wavy = wavy + 0.01 * rng.standard_normal(wavy.shape)
    places = rng.uniform([0.3, 0.3], [1.7, 1.2], (30, 2))
    height = 0.15 * np.sin(2 * places[:, 0]) * np.cos(3 * places[:, 1]) + rng.uniform(-0.05, 0.2, 30)
    return Setting(wavy, mesh.surfaces["z1"], np.column_stack([places, height]))


def derivatives_by_points(cell: str, term: str, rng: np.random.Generator) -> PointDerivatives:
    """Random derivatives by one term, none by the others."""
    here = setting(cell)
    count, corners = len(here.slave), here.facets.shape[1]
    sizes = {name: tuple(corners if n == "corners" else n for n in shape) for name, shape in SHAPES.items()}
    parts = {name: np.zeros((count, *size)) for name, size in sizes.items()}
    parts[term] = rng.standard_normal(parts[term].shape)
    return PointDerivatives(**parts)


def test_points_lie_on_both_sides_and_inside_facets() -> None:
    for cell in CELLS:
        here = setting(cell)
        hit = project(here.slave, np.tile([0.0, 0.0, -1.0], (30, 1)), here.master)
        assert np.count_nonzero(hit.gap < -0.01) > 2
        assert np.count_nonzero(hit.gap > 0.01) > 10
        assert len(np.unique(hit.facet)) > 8
        # A point in the middle of a facet would hide errors in its local coordinates.
        assert np.abs(hit.local).max() > 0.6
        assert outside(hit.local, here.master.corners).max() == 0.0


@pytest.mark.parametrize("what", ["master", "slave"])
@pytest.mark.parametrize("term", SHAPES)
@pytest.mark.parametrize("cell", CELLS)
def test_each_term_agrees_with_central_differences(cell: str, term: str, what: str) -> None:
    rng = np.random.default_rng(11)
    here = setting(cell)
    hit = project(here.slave, np.tile([0.0, 0.0, -1.0], (30, 1)), here.master)
    by = derivatives_by_points(cell, term, rng)
    by_slave, by_master = projection_pulled_back(here.master, hit.facet, hit.local, hit.gap, by)
    nodes = here.master.nodes
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
    adjoint = np.sum(by_slave * move_slave) + np.sum(by_master * move_master[nodes])
    assert abs(adjoint) > 0.1
    assert adjoint == pytest.approx(quotient, rel=1e-6)


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


def test_pushing_a_point_along_the_normal_opens_its_gap_and_nothing_else() -> None:
    for cell in CELLS:
        here = setting(cell)
        hit = project(here.slave, np.tile([0.0, 0.0, -1.0], (30, 1)), here.master)
        for term in SHAPES:
            by = derivatives_by_points(cell, term, np.random.default_rng(5))
            by_slave, _ = projection_pulled_back(here.master, hit.facet, hit.local, hit.gap, by)
            along = np.einsum("nd,nd->n", by_slave, hit.normal)
            assert along == pytest.approx(by.gap, abs=1e-10)


@pytest.mark.parametrize("cell", CELLS)
def test_moving_everything_together_changes_nothing(cell: str) -> None:
    here = setting(cell)
    hit = project(here.slave, np.tile([0.0, 0.0, -1.0], (30, 1)), here.master)
    for term in SHAPES:
        by = derivatives_by_points(cell, term, np.random.default_rng(5))
        by_slave, by_master = projection_pulled_back(here.master, hit.facet, hit.local, hit.gap, by)
        assert np.abs(by_slave).max() > 0.1
        assert by_slave.sum(axis=0) + by_master.sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-10)
