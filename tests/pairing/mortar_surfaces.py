"""Surfaces for mortar coupling: plates and lines whose meshes do not match, and concentric shells."""

from __future__ import annotations

import numpy as np

from fenics_contact._surfaces.facets import FacetedSurface, faceted_surface

#: Facets of the slave and of the master.
SOLID = [(slave, master) for slave in ("quads", "triangles") for master in ("quads", "triangles")]
KINDS = [("edges", "edges"), *SOLID]


def ticks(low: float, high: float, cells: int, uneven: float) -> np.ndarray:
    """Points along an interval, unevenly spaced."""
    even = np.linspace(0, 1, cells + 1)
    return low + (high - low) * (even + uneven * even * (1 - even))


def lattice(points: np.ndarray, kind: str, outward: bool) -> FacetedSurface:
    """The surface over a lattice of points, shape (n, m, 3), or the curve through points, shape (n, 2).

    Outward is the cross product of the lattice's directions, in the plane the right of the curve.
    """
    number = np.arange(points[..., 0].size).reshape(points.shape[:-1])
    if kind == "edges":
        facets = np.stack([number[:-1], number[1:]], axis=1)
    else:
        corners = [number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]]
        facets = np.stack(corners, axis=-1).reshape(-1, 4)
    if not outward:
        facets = facets[:, ::-1]
    if kind == "triangles":
        facets = facets[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
    return faceted_surface(points.reshape(-1, points.shape[-1]), facets)


def plate(
    kind: str,
    cells: int,
    *,
    height: float = 0.0,
    up: bool = True,
    low: float = 0.0,
    high: float = 1.0,
    turn: float = 0.0,
    uneven: float = 0.3,
    skew: float = 0.0,
) -> FacetedSurface:
    """A square [low, high]², turned about its centre, or the interval [low, high]; faces up or down.

    ``skew`` makes the facets general quadrilaterals instead of rectangles.
    """
    first = ticks(low, high, cells, uneven)
    if kind == "edges":
        return lattice(np.column_stack([first, np.full(cells + 1, height)]), kind, not up)
    x, y = np.meshgrid(first, ticks(low, high, cells + 1, -uneven), indexing="ij")
    bump = skew * (x - low) * (high - x) * (y - low) * (high - y)
    x, y, middle = x + bump * np.cos(9 * y), y + bump * np.sin(7 * x), (low + high) / 2
    turned = np.exp(1j * turn) * (x - middle + 1j * (y - middle))
    points = np.stack([turned.real + middle, turned.imag + middle, np.full_like(x, height)], axis=2)
    return lattice(points, kind, up)


def shell(
    kind: str, cells: int, radius: float, *, convex: bool, span: tuple[float, float], uneven: float = 0.2
) -> FacetedSurface:
    """A piece of a circular cylinder of length 1, or of a circle, seen from outside or from inside."""
    angle = ticks(*span, cells, uneven)
    arc = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    if kind == "edges":
        return lattice(arc, kind, convex)
    along = ticks(0, 1, max(cells // 2, 2), -uneven)
    points = np.concatenate(
        [
            np.repeat(arc[:, None], len(along), axis=1),
            np.broadcast_to(along[None, :, None], (len(arc), len(along), 1)),
        ],
        axis=2,
    )
    return lattice(points, kind, convex)


def moved(surface: FacetedSurface, turn: np.ndarray, shift: np.ndarray) -> FacetedSurface:
    """The same surface after a rigid motion."""
    return faceted_surface(surface.points @ turn.T + shift, surface.facets)


def rotation(dim: int, seed: int = 4) -> np.ndarray:
    """Some rotation."""
    turn, _ = np.linalg.qr(np.random.default_rng(seed).standard_normal((dim, dim)))
    turn[:, 0] *= np.sign(np.linalg.det(turn))
    return turn
