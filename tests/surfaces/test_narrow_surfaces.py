"""Surfaces one or two layers of facets wide: their normals do not depend on how they lie in space."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import permutations, product

import numpy as np
import pytest

from fenics_contact.surfaces.facets import FacetedSurface, faceted_surface
from fenics_contact.surfaces.reconstruction import reconstructed
from tests.pairing.mortar_surfaces import lattice


def orientations() -> Iterator[np.ndarray]:
    """The 24 rotations of a cube and one of no symmetry."""
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        turn = np.eye(3)[list(order)] * signs
        if np.linalg.det(turn) > 0:
            yield turn
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    yield turn * np.sign(np.linalg.det(turn))


def strip(kind: str, cells: int, layers: int, turn: np.ndarray) -> FacetedSurface:
    """A quarter of a cylinder of radius 2 around y, turned."""
    angle, y = np.meshgrid(
        np.linspace(0, np.pi / 2, cells + 1), np.linspace(0, 1, layers + 1), indexing="ij"
    )
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
