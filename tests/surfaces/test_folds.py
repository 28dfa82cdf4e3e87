"""Where a surface would fold it stays flat, and where a shape has no point above a facet that is said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fenics_contact._surfaces.facets import FacetedSurface, heights, slopes
from fenics_contact._surfaces.true_surface import height_over, reconstructed, without_folds
from fenics_contact.errors import InvalidInputError
from fenics_contact.shapes import Cylinder
from tests.pairing.mortar_surfaces import lattice


def bump(kind: str) -> FacetedSurface:
    """A shallow bump."""
    x, y = np.meshgrid(np.linspace(0, 1, 6), np.linspace(0, 1, 7), indexing="ij")
    points = np.stack([x, y, 0.1 * np.sin(3 * x) * np.cos(2 * y)], axis=-1)
    if kind == "edges":
        return lattice(np.ascontiguousarray(points[:, 0, ::2]), kind, True)
    return lattice(points, kind, True)


def middles(surface: FacetedSurface) -> np.ndarray:
    """Heights somewhere on each facet."""
    every = np.arange(len(surface.facets))
    return heights(surface, every, np.full((len(every), surface.dim - 1), 0.25)).value


@pytest.mark.parametrize("kind", ["quads", "triangles", "edges"])
@pytest.mark.parametrize("over", ["steep", "folded back"])
def test_facets_with_a_fold_stay_flat_and_others_as_they_are(kind: str, over: str) -> None:
    smooth = reconstructed(bump(kind))
    relief = smooth.relief
    assert relief is not None
    assert relief.flattened == 0
    assert without_folds(smooth) is smooth
    corners = relief.corners.copy()
    edge = smooth.points[smooth.facets[2, 1]] - smooth.points[smooth.facets[2, 0]]
    normal = smooth.averaged[smooth.facets[2, 0]]
    turned = normal + 2.0 * edge / np.linalg.norm(edge) if over == "steep" else -normal
    corners[2, 0] = turned / np.linalg.norm(turned) - normal
    found = without_folds(replace(smooth, relief=replace(relief, corners=corners)))
    assert found.relief is not None
    assert found.relief.flattened == 1
    np.testing.assert_allclose(slopes(found, np.array([2])), 0.0, atol=1e-15)
    assert abs(middles(smooth)[2]) > 1e-4
    np.testing.assert_allclose(np.delete(middles(found), 2), np.delete(middles(smooth), 2), rtol=1e-12)
    assert abs(middles(found)[2]) < 1e-15


def test_a_direction_along_a_shape_is_refused() -> None:
    wire = Cylinder((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 1.0)
    points, up = np.array([[0.3, 0.0, 1.1], [0.0, 0.2, 0.9]]), np.array([[0.0, 0.0, 1.0]] * 2)
    top = np.sqrt(1.0 - points[:, 0] ** 2)
    np.testing.assert_allclose(height_over(points, up, wire), top - points[:, 2], atol=1e-12)
    with pytest.raises(
        InvalidInputError,
        match=r"at 1 of 2 points Cylinder is nearly parallel to .* of the facets, the first at \(0, 0.2",
    ):
        height_over(points, np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.01]]), wire)
