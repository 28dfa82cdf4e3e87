"""Two interlocked links, placed so that their crowns just touch, and the measure of their distance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from fenics_contact.errors import InvalidInputError
from fenics_contact.geometry.arguments import check_numbers
from fenics_contact.geometry.link import Link, chain_link
from fenics_contact.geometry.mesh import BodyMesh
from fenics_contact.geometry.ring import LinkShape

if TYPE_CHECKING:
    from mpi4py import MPI

PULL_AXIS = np.array([1.0, 0.0, 0.0])
"""Link 2 is pulled along this direction, away from link 1."""

_TURN = np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
"""Half a turn about the diagonal of y and z: reverses the pull axis and swaps the other two."""


@dataclass(frozen=True, eq=False)
class TwoLinks:
    """Two links in touch.

    Attributes:
        first: The link to be held at its "grip"; on the -x side, ring in the x-z plane.
        second: The link to be pulled along +x at its "grip"; on the +x side, ring in the x-y plane.
        clearance: Smallest distance along the pull axis between the nodes of one contact surface and the
            facets of the other.
        faceting: How far the flat facets stand off the smooth crowns; the clearance means nothing below it.
    """

    first: Link
    second: Link
    clearance: float
    faceting: float


def two_links(
    shape: LinkShape | None = None,
    other: LinkShape | None = None,
    *,
    gap: float = 0.0,
    comm: MPI.Comm | None = None,
) -> TwoLinks:
    """Build two interlocked links, the second turned by 90 degrees about the pull axis.

    Near the spot where they touch, link 1 is concave along its ring (radius R) and convex across (radius r)
    and link 2 the same, turned. The gap between them is, with y and z across the pull axis,

        g = gap + y² (1/r1 - 1/R2) / 2 + z² (1/r2 - 1/R1) / 2,

    so they touch at one spot only where r1 < R2 and r2 < R1. The meshed crowns have facets: link 2 is moved
    along the axis until the measured clearance of nodes and facets is ``gap``. Where edges cross edges the
    facets may overlap by the height of the faceting.

    Args:
        shape: Link 1; `LinkShape()` unless given.
        other: Link 2; as link 1 unless given.
        gap: Clearance along the pull axis. Down to minus the faceting it may be negative.
        comm: As in `chain_link`.

    Returns:
        The links and the measured clearance.

    Raises:
        InvalidInputError: If the links do not fit into each other, cannot touch at one spot, or would
            penetrate by more than the faceting.

    Note:
        Collective on ``comm`` if given.
    """
    shape = LinkShape() if shape is None else shape
    other = shape if other is None else other
    check_fit(shape, other)
    faceting = max(shape.faceting, other.faceting)
    check_penetration(gap, faceting)
    first = chain_link(shape, comm)
    turned = (first if other == shape else chain_link(other, comm)).placed(_TURN, np.zeros(3))
    shift = mutual_clearance(first.mesh, turned.mesh) - gap
    second = turned.placed(np.eye(3), shift * PULL_AXIS)
    return TwoLinks(first, second, mutual_clearance(first.mesh, second.mesh), faceting)


def check_penetration(clearance: float, faceting: float) -> None:
    """Refuse bodies that overlap before anything is loaded.

    Args:
        clearance: Smallest distance between them, negative where they overlap.
        faceting: Overlap that comes from flat facets on curved surfaces.

    Raises:
        InvalidInputError: Saying by how much they penetrate.
    """
    check_numbers(gap=clearance)
    if clearance < -faceting:
        raise InvalidInputError(
            f"links must not penetrate each other by more than the faceting of {faceting:.3g} at the start, "
            f"these would by {-clearance:.6g}: move them apart (gap of at least 0) or use a finer mesh"
        )


def mutual_clearance(first: BodyMesh, second: BodyMesh) -> float:
    """Measure the smallest distance along the pull axis between two contact surfaces, nodes against facets.

    Args:
        first: Body whose "contact" surface faces against the pull axis.
        second: Body whose "contact" surface faces along it.

    Returns:
        The smaller of both ways round; negative where they overlap, infinite where they are nowhere opposite.
    """
    ways = (axial_clearance(first, second), axial_clearance(second, first))
    return float(min(np.min(distance, initial=np.inf) for _, distance in ways))


def axial_clearance(slave: BodyMesh, master: BodyMesh, reach: float = 60.0) -> tuple[np.ndarray, np.ndarray]:
    """Measure the distance along the pull axis from the slave's contact nodes to the master's contact facets.

    Facets are looked at as triangles (those of an unmoved link are plane). Only facets within ``reach``
    degrees of being perpendicular to the axis count, so that every node has one opposite at most.

    Args:
        slave: Body whose nodes of "contact" are measured.
        master: Body whose facets of "contact" they are measured against.
        reach: Largest angle between facet normal and axis, in degrees.

    Returns:
        Those nodes that have a facet opposite, (n,), and their distances, positive when open, (n,).
    """
    nodes = np.unique(slave.surfaces["contact"])
    triangles = _triangles(master.points, master.surfaces["contact"])
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    cosine = normals @ PULL_AXIS / np.linalg.norm(normals, axis=1)
    triangles = triangles[np.abs(cosine) > np.cos(np.radians(reach))]
    if triangles.shape[0] == 0:
        return nodes[:0], np.zeros(0)
    side = np.sign(cosine[np.argmax(np.abs(cosine))])
    points = slave.points[nodes]
    height = _height_over(points[:, 1:], triangles)
    found = np.isfinite(height)
    return nodes[found], side * (points[:, 0] - height)[found]


def _triangles(points: np.ndarray, facets: np.ndarray) -> np.ndarray:
    """Corners of the facets as triangles, (n, 3, 3)."""
    if facets.shape[1] == 4:
        facets = np.concatenate([facets[:, [0, 1, 2]], facets[:, [0, 2, 3]]])
    return points[facets]


def _height_over(places: np.ndarray, triangles: np.ndarray, candidates: int = 32) -> np.ndarray:
    """Interpolate the axial coordinate of a triangulated surface.

    Args:
        places: Coordinates (y, z), (n, 2).
        triangles: Corners, (m, 3, 3), of a surface that is a graph over (y, z).
        candidates: How many triangles with the nearest centres are tried for each place.

    Returns:
        (n,) coordinates along x; NaN where no triangle covers the place.
    """
    flat = triangles[:, :, 1:]
    count = min(candidates, triangles.shape[0])
    _, near = cKDTree(flat.mean(axis=1)).query(places, k=count)
    near = near.reshape(places.shape[0], count)
    edges = flat[:, 1:] - flat[:, :1]
    local = np.linalg.inv(edges)
    weights = np.einsum("nci,ncij->ncj", places[:, None] - flat[near, 0], local[near])
    weights = np.concatenate([1.0 - weights.sum(axis=-1, keepdims=True), weights], axis=-1)
    best = np.argmax(weights.min(axis=-1), axis=1)[:, None]
    inside = np.take_along_axis(weights, best[:, :, None], axis=1)[:, 0]
    heights = np.take_along_axis(triangles[near, :, 0], best[:, :, None], axis=1)[:, 0]
    return np.where(inside.min(axis=1) > -1e-9, np.sum(inside * heights, axis=1), np.nan)


def check_fit(first: LinkShape, second: LinkShape, names: tuple[str, str] = ("link 1", "link 2")) -> None:
    """Refuse links that cannot be interlocked or would not touch at one spot.

    Args:
        first: A link.
        second: Its neighbour.
        names: What messages call them.

    Raises:
        InvalidInputError: Naming the wire that is too large.
    """
    for wire, ring, one, two in ((first, second, *names), (second, first, *names[::-1])):
        if wire.width >= 2.0 * ring.inner_radius or wire.thickness >= ring.opening:
            raise InvalidInputError(
                f"the wire of {one} must pass through the opening of {two}, got a wire {wire.width:g} wide "
                f"and {wire.thickness:g} thick for an opening {2.0 * ring.inner_radius:g} wide and "
                f"{ring.opening:g} long: make the wire thinner, or inner_radius or straight of {two} larger"
            )
        radius = wire.section.crown_radius
        if radius >= ring.inner_radius:
            raise InvalidInputError(
                "links touch at one spot only if the radius across the wire is below the other link's "
                f"inner_radius, got {radius:.6g} for {one} against {ring.inner_radius:.6g} for {two}: make "
                "inner_radius larger, the wire narrower or roundness closer to 1"
            )
