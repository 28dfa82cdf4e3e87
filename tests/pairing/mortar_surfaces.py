"""Surfaces for mortar coupling: plates and lines whose meshes do not match, and concentric shells."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fenics_contact._surfaces.facets import FacetedSurface, faceted_surface
from fenics_contact._surfaces.pieces import Pieces
from fenics_contact.mesh.cell_types import FACET_TYPES

#: Facets of the slave and of the master.
SOLID = [(slave, master) for slave in ("quads", "triangles") for master in ("quads", "triangles")]
KINDS = [("edges", "edges"), *SOLID]
#: Linear facets between the corners of quadratic ones.
LINEAR = {"edges3": "edges", "triangles6": "triangles", "quads9": "quads"}
#: Quadratic facets on one or both sides.
CURVED = [
    ("edges3", "edges3"), ("edges", "edges3"), ("edges3", "edges"), ("quads9", "triangles6"),
    ("triangles6", "quads9"), ("triangles6", "triangles6"), ("quads9", "quads9"), ("quads", "triangles6"),
    ("triangles6", "triangles"),
]  # fmt: skip


def ticks(low: float, high: float, cells: int, uneven: float) -> np.ndarray:
    """Points along an interval, unevenly spaced."""
    even = np.linspace(0, 1, cells + 1)
    return low + (high - low) * (even + uneven * even * (1 - even))


def lattice(points: np.ndarray, kind: str, outward: bool) -> FacetedSurface:
    """The surface over a lattice of points, shape (n, m, 3), or the curve through points, shape (n, 2).

    Outward is the cross product of the lattice's directions, in the plane the right of the curve.
    """
    number = np.arange(points[..., 0].size).reshape(points.shape[:-1])
    if kind in LINEAR:
        flat = points.reshape(-1, points.shape[-1])
        corners = number[(slice(None, None, 2),) * (points.ndim - 1)]
        return quadratic_surface(flat, _facets(corners, LINEAR[kind], outward))
    return faceted_surface(points.reshape(-1, points.shape[-1]), _facets(number, kind, outward))


def quadratic_surface(points: np.ndarray, corners: np.ndarray) -> FacetedSurface:
    """Quadratic facets whose nodes between corners have the mean numbers of these."""
    middles = (corners + np.roll(corners, -1, axis=1)) // 2
    count = corners.shape[1]
    more = [middles[:, :1]] if count == 2 else [middles]
    if count == 4:
        more.append((corners[:, :1] + corners[:, 2:3]) // 2)
    whole = np.concatenate([corners, *more], axis=1)
    pieces = FACET_TYPES[whole.shape[1], points.shape[1]].pieces
    surface = faceted_surface(points, whole[:, pieces].reshape(-1, count))
    return replace(surface, cut=Pieces(whole, points.shape[1])).with_areas_of_pieces()


def _facets(number: np.ndarray, kind: str, outward: bool) -> np.ndarray:
    """Linear facets between nodes of a lattice."""
    if kind == "edges":
        facets = np.stack([number[:-1], number[1:]], axis=1)
    else:
        corners = [number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]]
        facets = np.stack(corners, axis=-1).reshape(-1, 4)
    if not outward:
        facets = facets[:, ::-1]
    if kind == "triangles":
        facets = facets[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
    return facets


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
    if kind in LINEAR:
        plain = plate(
            LINEAR[kind], cells, height=height, low=low, high=high, turn=turn, uneven=uneven, skew=skew
        )
        shape = (cells + 1,) if kind == "edges3" else (cells + 1, cells + 2)
        points = halved(plain.points.reshape(*shape, plain.dim))
        if kind == "triangles6":  # the middles of their diagonals
            ends = (
                (points[:-1:2, :-1:2], points[2::2, 2::2])
                if up
                else (points[:-1:2, 2::2], points[2::2, :-1:2])
            )
            points[1::2, 1::2] = (ends[0] + ends[1]) / 2
        return lattice(points, kind, up if plain.dim == 3 else not up)
    first = ticks(low, high, cells, uneven)
    if kind == "edges":
        return lattice(np.column_stack([first, np.full(cells + 1, height)]), kind, not up)
    x, y = np.meshgrid(first, ticks(low, high, cells + 1, -uneven), indexing="ij")
    bump = skew * (x - low) * (high - x) * (y - low) * (high - y)
    x, y, middle = x + bump * np.cos(9 * y), y + bump * np.sin(7 * x), (low + high) / 2
    turned = np.exp(1j * turn) * (x - middle + 1j * (y - middle))
    points = np.stack([turned.real + middle, turned.imag + middle, np.full_like(x, height)], axis=2)
    return lattice(points, kind, up)


def halved(points: np.ndarray) -> np.ndarray:
    """A lattice with the means between its points."""
    for axis in range(points.ndim - 1):
        each = np.moveaxis(points, axis, 0)
        finer = np.empty((2 * len(each) - 1, *each.shape[1:]))
        finer[::2], finer[1::2] = each, (each[1:] + each[:-1]) / 2
        points = np.moveaxis(finer, 0, axis)
    return points


def shell(
    kind: str, cells: int, radius: float, *, convex: bool, span: tuple[float, float], uneven: float = 0.2
) -> FacetedSurface:
    """A piece of a circular cylinder of length 1, or of a circle, seen from outside or from inside."""
    angle = ticks(*span, cells, uneven)
    if kind in LINEAR:
        angle = halved(angle[:, None])[:, 0]
    arc = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    if kind in ("edges", "edges3"):
        return lattice(arc, kind, convex)
    along = ticks(0, 1, max(cells // 2, 2), -uneven)
    if kind in LINEAR:
        along = halved(along[:, None])[:, 0]
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
