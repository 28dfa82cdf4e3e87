"""Surfaces one or two layers of facets wide: their normals do not depend on how they lie in space."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import permutations, product

import numpy as np
import pytest

from fenics_contact._surfaces.facets import FacetedSurface, faceted_surface
from fenics_contact._surfaces.fitting import PolynomialFit
from fenics_contact._surfaces.tangents import surface_tangents
from fenics_contact._surfaces.true_surface import reconstructed
from tests.pairing.mortar_surfaces import lattice


def orientations() -> Iterator[np.ndarray]:
    """The 24 rotations of a cube and one of no symmetry."""
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        turn = np.eye(3)[list(order)] * signs
        if np.linalg.det(turn) > 0:
            yield turn
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    yield turn * np.sign(np.linalg.det(turn))


def ways(cells: int, layers: int, width: float, uneven: float) -> tuple[np.ndarray, np.ndarray]:
    """Parameters along and across a strip of length π/2, nodes moved by a fraction of the edges."""
    along, across = np.meshgrid(
        np.linspace(0, np.pi / 2, cells + 1), np.linspace(0, width, layers + 1), indexing="ij"
    )
    edge = min(np.pi / 2 / cells, width / layers)
    moved = uneven * edge * np.random.default_rng(7).uniform(-1, 1, (2, *along.shape))
    moved[0, [0, -1]] = 0.0
    return along + moved[0], across + moved[1]


def sheet(name: str, t: np.ndarray, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points and outward normals of a surface of radius 2 around y; t goes around, s across."""
    if name == "helix":  # a strip that winds around a cylinder
        t, s = t * np.cos(0.5) - s * np.sin(0.5), t * np.sin(0.5) + s * np.cos(0.5)
    high = s / 2 + 0.3
    # radius, height, and outward normal of the meridian
    meridian = {
        "cone": (2 - s * np.sin(0.4), s * np.cos(0.4), np.cos(0.4) + 0 * s, np.sin(0.4) + 0 * s),
        "torus": (1 + np.cos(s + 0.2), np.sin(s + 0.2), np.cos(s + 0.2), np.sin(s + 0.2)),
        "sphere": (2 * np.cos(high), 2 * np.sin(high), np.cos(high), np.sin(high)),
    }
    if name == "plane":
        return np.stack([t, s, 0 * t], axis=-1), np.stack([0 * t, 0 * t, 1 + 0 * t], axis=-1)
    radius, height, out, up = meridian.get(name, (2 + 0 * s, s, 1 + 0 * s, 0 * s))
    return (
        np.stack([radius * np.sin(t), height, radius * np.cos(t)], axis=-1),
        np.stack([out * np.sin(t), up, out * np.cos(t)], axis=-1),
    )


def lean(found: np.ndarray, normals: np.ndarray) -> float:
    """Largest angle between found and true normals."""
    return float(2 * np.arcsin(np.linalg.norm(found - normals, axis=-1).max() / 2))


def strip(kind: str, cells: int, layers: int, turn: np.ndarray) -> FacetedSurface:
    """A quarter of a cylinder of radius 2 around y, turned."""
    angle, y = np.meshgrid(np.linspace(0, np.pi / 2, cells + 1), np.linspace(0, 1, layers + 1), indexing="ij")
    return lattice(np.stack([2 * np.sin(angle), y, 2 * np.cos(angle)], axis=-1) @ turn.T, kind, True)


def miss(surface: FacetedSurface, turn: np.ndarray) -> float:
    """Largest error of a strip's normals."""
    radial = surface.points @ turn * [0.5, 0.0, 0.5]
    return float(np.abs(surface.normals @ turn - radial).max())


@pytest.mark.parametrize("layers", [1, 2])
@pytest.mark.parametrize("kind", ["quads", "triangles"])
@pytest.mark.parametrize("order", [2, 3])
def test_a_narrow_strip_has_radial_normals_in_every_orientation(kind: str, layers: int, order: int) -> None:
    misses = np.array(
        [
            [miss(reconstructed(strip(kind, cells, layers, turn), order), turn) for cells in (8, 16)]
            for turn in orientations()
        ]
    )
    assert misses.shape == (25, 2)
    np.testing.assert_allclose(misses, np.broadcast_to(misses[0], misses.shape), atol=1e-11)
    assert np.log2(misses[0, 0] / misses[0, 1]) > 2.9
    assert misses[0, 1] < 2e-2 * miss(strip(kind, 16, layers, np.eye(3)), np.eye(3)), "as good as facets"


def slid(surface: FacetedSurface) -> np.ndarray:
    """Normals at the nodes of the patches of surfaces that slide."""
    found = surface_tangents(surface)
    first, second = np.moveaxis((found.derivatives @ surface.points).reshape(-1, 2, 3), 1, 0)
    normals, out = np.empty_like(surface.points), np.cross(first, second)
    normals[surface.facets.ravel()] = out[found.of_corner.ravel()]
    normals *= np.sign(np.einsum("nd,nd->n", normals, surface.averaged))[:, None]  # in bases of either hand
    return normals / np.linalg.norm(normals, axis=1)[:, None]


#: How uneven the nodes are, in edges, and what is missed at most, in parts of what facets miss.
STRIPS = {
    "plane": (0.2, 0.0),
    "cylinder": (0.2, 0.02),
    "cone": (0.1, 0.08),
    "helix": (0.1, 0.06),
    "torus": (0.01, 1.0),
    "sphere": (0.01, 1.0),
}


@pytest.mark.parametrize("kind", ["quads", "triangles"])
@pytest.mark.parametrize("name", STRIPS)
def test_the_normals_of_one_layer_lean_alike_in_every_orientation(name: str, kind: str) -> None:
    """Developable surfaces are found; how others bend across one layer cannot be known, by facets neither."""
    uneven, part = STRIPS[name]
    points, normals = sheet(name, *ways(16, 1, 0.5, uneven))
    leans = []
    for turn in orientations():
        surface = lattice(points @ turn.T, kind, True)
        found = reconstructed(surface).normals, slid(surface), surface.averaged
        leans.append([lean(each @ turn, normals.reshape(-1, 3)) for each in found])
    first = leans[0]
    assert np.shape(leans) == (25, 3)
    np.testing.assert_allclose(leans, np.broadcast_to(first, np.shape(leans)), atol=1e-8)
    assert max(first[:2]) <= part * first[2] + 1e-9, first


@pytest.mark.parametrize("kind", ["quads", "triangles"])
@pytest.mark.parametrize("name", ["cylinder", "cone", "helix"])
def test_normals_of_a_developable_layer_are_of_the_second_order_in_the_edges(name: str, kind: str) -> None:
    misses = []
    for cells, width in ((8, 0.4), (16, 0.2), (32, 0.1)):
        points, normals = sheet(name, *ways(cells, 1, width, 0.01))
        misses.append(lean(reconstructed(lattice(points, kind, True)).normals, normals.reshape(-1, 3)))
    assert np.log2(np.divide(misses[:-1], misses[1:])).min() > 1.8


@pytest.mark.parametrize("order", [2, 3])
def test_what_the_nodes_determine_is_fitted_by_least_squares_alone(order: int) -> None:
    """On a lattice of four rows of uneven nodes."""
    x, y = (each.ravel() for each in np.meshgrid(np.arange(-3.0, 4.0), np.arange(-1.0, 3.0)))
    place = np.column_stack([x, y])[(x != 0) | (y != 0)] / 3
    place += 0.01 * np.random.default_rng(1).normal(size=place.shape)
    x, y = place.T
    height = x + 0.3 * x**2 - 0.2 * x * y + 0.1 * y**2 + 0.05 * np.cos(3 * x + y)
    fit = PolynomialFit.of(place, height, np.zeros(27, dtype=int), np.zeros(1, dtype=bool), order)
    powers = [(k - m, m) for k in range(1, order + 1) for m in range(k + 1)]
    rows = np.column_stack([x**a * y**b for a, b in powers]) / np.linalg.norm(place, axis=1)[:, None]
    expected = np.linalg.lstsq(rows, height / np.linalg.norm(place, axis=1), rcond=None)[0]
    np.testing.assert_allclose(fit.coefficients(height)[0], expected, atol=1e-10)


@pytest.mark.parametrize("corners", [3, 4])
def test_one_twisted_facet_alone_is_the_same_surface_in_every_orientation(corners: int) -> None:
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.1], [1.1, 1.0, -0.2], [0.0, 0.9, 0.2]])[:corners]
    facet = np.arange(corners)[None]
    found = []
    for turn in orientations():
        relief = reconstructed(faceted_surface(points @ turn.T, facet)).relief
        assert relief is not None
        found.append(np.concatenate([relief.corners[0] @ turn, relief.normals @ turn]))
    np.testing.assert_allclose(found, np.broadcast_to(found[0], np.shape(found)), atol=1e-12)


def test_the_next_order_adds_what_an_arc_is_higher_than_its_cubic() -> None:
    """The arc of angle a is a⁴ / 128 of its radius higher in its middle than Hermite's cubic."""
    angle = np.linspace(0.0, 1.2, 25)
    arc = lattice(np.column_stack([np.cos(angle), np.sin(angle)])[::-1], "edges", False)
    for sign, surface in ((1.0, arc), (-1.0, faceted_surface(arc.points, arc.facets[:, ::-1]))):
        relief = reconstructed(surface, 3).relief
        assert relief is not None
        np.testing.assert_allclose(relief.rest, sign * angle[1] ** 4 / 128, rtol=0.02)
