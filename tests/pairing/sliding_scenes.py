"""Bodies that meet on a curved surface, pushed out of shape: for tests of contact where they lie now."""

from __future__ import annotations

import numpy as np

from fenics_contact import Body, BodyMesh, ContactPair, Scene, Support, Surface
from fenics_contact._pairing.sliding.contact import SlidingContact
from fenics_contact._pairing.sliding.points import SlidingPoints
from fenics_contact._pairing.sliding.surfaces import OnPatches
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, NeoHooke, PlaneStrain
from fenics_contact.mesh import quadratic

KINDS = ("hexahedron", "tetrahedron", "quadrilateral", "triangle")


def arched(points: np.ndarray, radius: float = 1.5) -> np.ndarray:
    """Return the points of a flat piece, its top at zero height, bent to a cylinder."""
    angle, r = points[:, 0] / radius, radius + points[:, -1]
    bent = points.copy()
    bent[:, 0], bent[:, -1] = r * np.sin(angle), r * np.cos(angle) - radius
    return bent


def on_arch(
    kind: str,
    *,
    master_cells: int = 8,
    slave_cells: int = 5,
    radius: float = 1.5,
    geometry: str = "best",
    order: int = 1,
) -> Scene:
    """Return a small slave above an arched master that is longer and wider."""
    if kind in ("hexahedron", "tetrahedron"):
        low = block((-1.0, -0.6, -0.5), (1.0, 0.6, 0.0), (master_cells, 5, 1), kind)
        cells = (slave_cells, slave_cells - 1, 1)
        high = block((-0.43, -0.35, 0.03), (0.37, 0.33, 0.4), cells, kind)
        material, top, under = IsotropicElasticity(10.0, 0.3), "z1", "z0"
    else:
        low = rectangle((-1.0, -0.5), (1.0, 0.0), (master_cells, 1), kind)
        high = rectangle((-0.43, 0.03), (0.37, 0.4), (slave_cells, 1), kind)
        material, top, under = PlaneStrain(10.0, 0.3), "y1", "y0"
    if order > 1:
        low, high = quadratic(low), quadratic(high)
    low = BodyMesh(arched(low.points, radius), low.cells, low.surfaces)
    high = BodyMesh(arched(high.points, radius), high.cells, high.surfaces)
    bodies = {"high": Body(high, material), "low": Body(low, material)}
    pair = ContactPair(Surface("high", under), Surface("low", top), geometry=geometry, discretisation="node")
    return Scene(bodies, contacts=[pair])


def half_on_arch(kind: str) -> Scene:
    """Return half of such a scene, cut at x = 0 by a plane of symmetry."""
    low = block((0.0, -0.6, -0.5), (1.0, 0.6, 0.0), (4, 5, 1), kind)
    high = block((0.0, -0.35, 0.03), (0.4, 0.33, 0.4), (3, 4, 1), kind)
    bodies = {
        name: Body(BodyMesh(arched(mesh.points), mesh.cells, mesh.surfaces), IsotropicElasticity(10.0, 0.3))
        for name, mesh in (("high", high), ("low", low))
    }
    rollers = [Support(name, "x0", (0.0, None, None)) for name in bodies]
    pair = ContactPair(Surface("high", "z0"), Surface("low", "z1"), discretisation="node")
    return Scene(bodies, rollers, contacts=[pair])


def ring(kind: str, sides: tuple[str, str] = ("roof", "floor")) -> Scene:
    """Return a ring of radius one and thickness 0.2, cut open at the bottom, whose sides may meet."""
    if kind in ("hexahedron", "tetrahedron"):
        mesh = block((-3.1, -0.2, 0.0), (3.1, 0.2, 0.2), (40, 2, 1), kind)
        under, over = "z0", "z1"
    else:
        mesh = rectangle((-3.1, 0.0), (3.1, 0.2), (40, 1), kind)
        under, over = "y0", "y1"
    angle, radius = mesh.points[:, 0], 0.9 + mesh.points[:, -1]
    points = mesh.points.copy()
    points[:, 0], points[:, -1] = radius * np.sin(angle), radius * np.cos(angle)
    inner, outer = mesh.surfaces[under], mesh.surfaces[over]
    up, out = (points[facets].mean(axis=1)[:, -1] > 0 for facets in (inner, outer))
    surfaces = {"inner": inner, "outer": outer, "roof": inner[up], "floor": inner[~up]}
    surfaces |= {"crown": outer[out], "base": outer[~out]}
    height = points[inner].mean(axis=1)[:, -1]
    surfaces |= {"top": inner[height > 0.7], "bottom": inner[height < -0.7]}
    bent = BodyMesh(points, mesh.cells, surfaces)
    pair = ContactPair(Surface("ring", sides[0]), Surface("ring", sides[1]))
    return Scene({"ring": Body(bent, NeoHooke(1.0, 0.3))}, contacts=[pair])


def free(scene: Scene) -> np.ndarray:
    """Return that nothing is held."""
    return np.zeros(scene.points.shape, dtype=bool)


def sliding(scene: Scene, reach: float = np.inf) -> SlidingContact:
    """Return the contact of a scene without supports."""
    return SlidingContact.of(scene, free(scene), reach=reach)


def on_patches(contact: SlidingContact) -> OnPatches:
    """Return the first pair, of nodes on the patches of a body."""
    meeting = contact.meetings[0]
    assert isinstance(meeting, OnPatches)
    return meeting


def shaken(scene: Scene, amount: float = 0.02, seed: int = 3) -> np.ndarray:
    """Return coordinates of the nodes pushed out of shape."""
    x = scene.points
    wave = np.column_stack([np.sin(3 * x[:, (a + 1) % scene.dim] + a) for a in range(scene.dim)])
    return np.asarray(x + amount * wave + 0.2 * amount * np.random.default_rng(seed).standard_normal(x.shape))


def rotation(dim: int, angle: float, axis: int = 1) -> np.ndarray:
    """Return a rotation, in space about one of the axes."""
    c, s = np.cos(angle), np.sin(angle)
    if dim == 2:
        return np.array([[c, -s], [s, c]])
    turn = np.eye(3)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    turn[i, i], turn[i, j], turn[j, i], turn[j, j] = c, -s, s, c
    return turn


def same_points(one: SlidingPoints, other: SlidingPoints) -> bool:
    """Return whether two sets consist of the same nodes on the same facets."""
    return np.array_equal(one.key, other.key) and np.array_equal(one.points.facet, other.points.facet)


def derivative_error(step: float, found: np.ndarray, plus: np.ndarray, minus: np.ndarray) -> float:
    """Return the largest error of a derivative relative to the difference quotient."""
    quotient = (plus - minus) / (2 * step)
    size = np.abs(quotient).max()
    assert size > 1e-2
    return float(np.abs(found - quotient).max() / size)
