"""Are contact points where they should be? Gaps, normals, weights and areas against the geometry itself."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fenics_contact import BodyMesh, ContactPair, RigidCylinder, RigidPlane, RigidSphere, Surface
from fenics_contact._pairing.points import ContactPoints
from tests.scenes import RigidObstacle
from tools.random_scenes.whole import Whole, surface_area

#: What rounding may do beside the coordinates, and beside the size of what lies about a point.
ROUNDING, EXACT = 64 * np.finfo(float).eps, 1e-8
#: How far beyond the outer edge of a master a node may lie that still meets it: weights of its facet. Those
#: of quadratic facets are as low as -1/8 inside, and -0.3 as far outside.
BEYOND = {1: -0.12, 2: -0.3}
#: What of the sagitta of facets the true surface over them may miss.
NEARLY = 0.01
#: A node this far inside of a master's facet must meet it.
INSIDE = 1e-3


@dataclass(frozen=True)
class Side:
    """A surface with its linear facets, node numbers among those of all bodies.

    Attributes:
        facets: (n_facets, corners).
        normals: Of the facets, outward, unit length, (n_facets, dim).
        mean: Of the nodes: the facets' area vectors around each added up, unit length, (n_nodes, dim); NaN
            away from the surface.
        flat: Whether all facets lie in one plane.
        entire: The facets of its cells, each of which consecutive linear ones make up, (n_entire, nodes).
        order: That of its cells.
    """

    facets: np.ndarray
    normals: np.ndarray
    mean: np.ndarray
    flat: bool
    entire: np.ndarray
    order: int

    @classmethod
    def of(cls, whole: Whole, surface: Surface) -> Side:
        mesh = whole.scene.bodies[surface.body].mesh
        facets = whole.scene.facets(surface) + whole.offset[surface.body]
        x = whole.points[facets]
        if whole.dim == 2:
            along = x[:, 1] - x[:, 0]
            vector = np.stack([along[:, 1], -along[:, 0]], axis=1)
        else:
            # Half the product of the diagonals; of a triangle, whose first corner counts twice, of two edges.
            vector = 0.5 * np.cross(x[:, -2] - x[:, 0], x[:, -1] - (x[:, 1] if x.shape[1] == 4 else x[:, 0]))
        normals = vector / np.linalg.norm(vector, axis=1)[:, None]
        mean = np.full(whole.points.shape, np.nan)
        mean[np.unique(facets)] = 0.0
        np.add.at(mean, facets, vector[:, None])
        mean /= np.linalg.norm(mean, axis=1)[:, None]
        flat = bool(np.abs(normals - normals[0]).max() < EXACT)
        entire = mesh.surfaces[surface.name] + whole.offset[surface.body]
        return cls(facets, normals, mean, flat, entire, mesh.order)


def own_distance(obstacle: RigidObstacle, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return signed distances to an obstacle and their gradients."""
    if isinstance(obstacle, RigidPlane):
        normal = np.array(obstacle.normal)
        return (points - np.array(obstacle.point)) @ normal, np.tile(normal, (len(points), 1))
    if isinstance(obstacle, RigidSphere):
        arm, sign = points - np.array(obstacle.centre), -1.0 if obstacle.hollow else 1.0
    else:
        assert isinstance(obstacle, RigidCylinder)
        axis, sign = np.array(obstacle.axis), -1.0 if obstacle.hollow else 1.0
        arm = points - np.array(obstacle.point)
        arm = arm - np.outer(arm @ axis, axis)
    length = np.linalg.norm(arm, axis=1)
    return sign * (length - obstacle.radius), sign * arm / length[:, None]


def misplaced(whole: Whole, points: ContactPoints, pairs: list[ContactPair]) -> Iterator[str]:
    """Say what is wrong with the contact points of all pairs."""
    assert np.all(np.diff(points.pair) >= 0)
    if points.count and np.abs(np.linalg.norm(points.normal, axis=1) - 1.0).max() > EXACT:
        yield "normals have not length one"
    frame = np.concatenate([points.normal[:, None], points.tangents], axis=1)
    if np.abs(frame @ frame.swapaxes(1, 2) - np.eye(whole.dim)).max(initial=0.0) > EXACT:
        yield "normal and tangents are not orthonormal"
    for index, pair in enumerate(pairs):
        own = np.flatnonzero(points.pair == index)
        for complaint in _pair_misplaced(whole, points, pair, own):
            yield f"pair {index}: {complaint}"


def _pair_misplaced(whole: Whole, points: ContactPoints, pair: ContactPair, own: np.ndarray) -> Iterator[str]:
    slave, side = points.slave[own], Side.of(whole, pair.slave)
    at_nodes = np.setdiff1d(own, points.are_inside)  # others stand for contact inside a facet
    nodes = np.unique(side.facets)
    if len(np.unique(slave)) != len(slave) or not np.isin(slave, nodes).all():
        yield "points are no nodes of the slave, or the same"
    mesh = whole.scene.bodies[pair.slave.body].mesh
    area = surface_area(mesh, mesh.surfaces[pair.slave.name], whole.scene.axisymmetric)
    # Ends of quadratic edges on an axis of revolution have no area.
    wide = np.abs(area[nodes - whole.offset[pair.slave.body]]) > EXACT * area.max()
    movable = nodes[whole.free[nodes].any(axis=1) & wide]
    size = np.ptp(whole.points, axis=0).max()
    length = EXACT * size + ROUNDING * np.abs(whole.points).max()
    mortar = pair.discretisation == "mortar" and isinstance(pair.master, Surface)
    if not mortar:
        yield from _areas(whole, pair.slave, slave, points.area[own])
    if isinstance(pair.master, Surface):
        master = Side.of(whole, pair.master)
        yield from _weights(whole, points, at_nodes, (side, master), mortar, length)
        if master.flat and side.flat and not mortar:
            must = above(whole, movable, side, master)
            missing = np.setdiff1d(must, slave)
            if len(missing):
                yield f"{len(missing)} of {len(must)} nodes above the master are no contact points"
        return
    distance, normal = own_distance(pair.master, whole.points[points.slave[at_nodes]])
    if np.abs(points.gap[at_nodes] - distance).max(initial=0.0) > length:
        yield f"gaps to the obstacle are off by {np.abs(points.gap[at_nodes] - distance).max():.1e}"
    if np.abs(points.normal[at_nodes] - normal).max(initial=0.0) > 1e-6:
        yield "normals are not those of the obstacle"
    facing = np.einsum("nd,nd->n", side.mean[movable], own_distance(pair.master, whole.points[movable])[1])
    if len(np.setdiff1d(movable[facing < -1e-6], slave)) or len(
        np.intersect1d(movable[facing > 1e-6], slave)
    ):
        yield "points are not the nodes that face the obstacle"


def _areas(whole: Whole, surface: Surface, slave: np.ndarray, area: np.ndarray) -> Iterator[str]:
    mesh: BodyMesh = whole.scene.bodies[surface.body].mesh
    own = surface_area(mesh, mesh.surfaces[surface.name], whole.scene.axisymmetric)[
        slave - whole.offset[surface.body]
    ]
    # On facets that are no parallelograms their equal parts are not the integrals of shape functions.
    if np.abs(area / own - 1.0).max(initial=0.0) > 0.25:
        yield f"areas of points are off by {np.abs(area / own - 1).max():.1e}"


def _weights(
    whole: Whole,
    points: ContactPoints,
    own: np.ndarray,
    sides: tuple[Side, Side],
    mortar: bool,
    length: float,
) -> Iterator[str]:
    """The master's point that a slave node meets lies on the master, a gap away along the normal.

    By mortar a mean over nodes of the slave may take the place of its node.
    """
    weight, (slave, master) = points.master[own].tocsr(), sides
    flat, of_slave = slave.flat, np.isin(weight.indices, slave.facets)
    if mortar:
        jump = points.jump[own].tocsr()
        means = jump.data[np.isin(jump.indices, slave.facets)]
        if means.min(initial=0.0) < -EXACT or means.sum() > len(own) * (1.0 + EXACT):
            yield "weights of the slave are no means"
    if np.abs(np.asarray(weight.sum(axis=1)) - 1.0).max(initial=0.0) > EXACT:
        yield "weights of the master do not sum to one"
    there = np.isin(weight.indices, master.facets) | (mortar & of_slave)
    if not there[weight.data != 0.0].all():
        yield "weights lie on nodes that are not the master's"
    origin = whole.points.mean(axis=0)
    local = whole.points - origin
    way = local[points.slave[own]] - weight @ local
    along = np.einsum("nd,nd->n", way, points.normal[own])
    if not mortar:
        off = np.abs(way - along[:, None] * points.normal[own]).max(initial=0.0)
        if off > length:
            yield f"slave and master point do not lie on one normal, by {off:.1e}"
        true = local[points.slave[own]] - points.gap[own, None] * points.normal[own]
        off = off_the_master(local, master, true, weight @ local)
        if off > length:
            yield f"slave and master are not a gap apart along the normal, by {off:.1e}"
        if weight.data.min(initial=0.0) < BEYOND[master.order]:
            yield f"a node lies beside the master, weight {weight.data.min():.2f}"
        facet = master.entire[points.facet[own] // (len(master.facets) // len(master.entire))]
        rows = np.repeat(np.arange(len(own)), np.diff(weight.indptr))
        if not (weight.indices[:, None] == facet[rows]).any(axis=1)[weight.data != 0.0].all():
            yield "weights lie on several facets"
    elif master.flat and flat and np.abs(along - points.gap[own]).max(initial=0.0) > length:
        yield f"mean gaps are off by {np.abs(along - points.gap[own]).max():.1e}"
    if master.flat and not (mortar and not flat) and len(own):
        # Mortar points take the slave's normal, which is the opposite where both are flat.
        off = np.abs(points.normal[own] - master.normals[0]).max()
        if off > 1e-6:
            yield f"normals are not those of the flat master, by {off:.1e}"


def off_the_master(points: np.ndarray, master: Side, true: np.ndarray, on_facets: np.ndarray) -> float:
    """Return how far points are from the true master at most: a plane, or the ball through its nodes.

    What is between the nodes of a ball is known to a few parts in a thousand of what facets cut off.

    Args:
        points: Coordinates of all nodes.
        master: The master.
        true: The points.
        on_facets: The points of the facets below them.
    """
    if master.flat:
        return float(np.abs(true - on_facets).max(initial=0.0))
    nodes = points[np.unique(master.facets)]
    # |x|² = 2 c·x + r² − |c|²
    terms = np.column_stack([2.0 * nodes, np.full(len(nodes), np.ptp(nodes, axis=0).max())])
    solved, *_ = np.linalg.lstsq(terms, (nodes**2).sum(axis=1), rcond=None)
    radii = [np.linalg.norm(x - solved[:-1], axis=1) for x in (nodes, true, on_facets)]
    radius = radii[0].mean()
    assert np.ptp(radii[0]) < EXACT * radius, "round masters are balls or discs"
    cut_off = np.abs(radii[2] - radius).max(initial=0.0)
    return float(np.maximum(np.abs(radii[1] - radius) - NEARLY * cut_off, 0.0).max(initial=0.0))


def above(whole: Whole, nodes: np.ndarray, side: Side, master: Side) -> np.ndarray:
    """Return which nodes a flat master has a facet well below, if the surfaces face each other at all."""
    if float(side.normals[0] @ master.normals[0]) > -1e-3:
        return nodes[:0]
    corners = whole.points[master.facets]
    count = corners.shape[1]
    inside = np.zeros(len(nodes), dtype=bool)
    normal = master.normals[0]
    for facet in corners:
        edges = np.roll(facet, -1, axis=0) - facet
        arms = whole.points[nodes][:, None] - facet[None]
        if whole.dim == 2:
            share = arms[:, 0] @ edges[0] / (edges[0] @ edges[0])
            inside |= (share > INSIDE) & (share < 1 - INSIDE)
            continue
        height = np.einsum("nkd,kd->nk", np.cross(edges[None], arms, axis=2), np.tile(normal, (count, 1)))
        inside |= np.all(height > INSIDE * np.linalg.norm(edges, axis=1) ** 2, axis=1)
    return np.asarray(nodes[inside])
