"""Contact points: nodes of one surface with their counterparts on another surface or an obstacle."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol, Self, TypeAlias, TypeVar

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.csr import Csr
from fenics_contact._base.display import displayed
from fenics_contact._base.fingerprint import described, require_alike
from fenics_contact._base.libraries import MPI
from fenics_contact._scene.local_axes import NO_AXES, LocalAxes, free_part
from fenics_contact._scene.pairs import ContactPair, Coulomb, Tresca
from fenics_contact._scene.scene import Scene
from fenics_contact._scene.sectors import AnyTie
from fenics_contact.errors import together
from fenics_contact.mesh.faces import corners_of, match_faces
from fenics_contact.qp.cones import Proportional, Strengths

if TYPE_CHECKING:
    from fenics_contact.qp.compliance import Closures

Law = TypeVar("Law")

#: Weights of nodes below this fraction of all are rounding, which must not keep a supported point free.
HELD = 1e-6


@displayed
@dataclass(frozen=True)
class ContactPoints:
    """Contact points of a scene, replicated on all ranks, in the order pair by pair, node by node.

    Attributes:
        pair: Contact pair of the scene, shape (n,).
        slave: Slave node among all bodies' nodes, shape (n,).
        master: Weights of the nodes of all bodies in the node's counterpart on the master, shape (n,
            n_nodes); a row sums to one, and is empty on a rigid obstacle.
        normal: Unit normal from master to slave, shape (n, dim).
        tangents: Unit tangents, shape (n, dim - 1, dim).
        gap: Gap before anything moves, positive when open: the distance, or what the pair gives in its place,
            shape (n,), [length].
        area: Area of the slave surface that belongs to the node, shape (n,), [length^(dim - 1)].
        facet: Facet of the master surface that a node projects on; −1 on a rigid obstacle and where a point
            represents a mean over facets, shape (n,).
        local: Local coordinates on it, shape (n, dim - 1).
        axes: Coordinate axis nearest to the first tangent, as a unit vector, shape (n, dim).
        symmetric: Components normal to a plane of symmetry that cuts both surfaces there, or the one on an
            obstacle: the mirror images move opposite, so that there is no slip across the plane, shape (n,
            dim). Other planes are `oblique_normals`.
        distance: Measured distance of the surfaces along the normal, positive when apart, shape (n,),
            [length].
        given: Whether the pair says what the gap is, by a value or by declaring the measured overlap an
            interference, shape (n,).
        own: Weights of the nodes in the slave's displacement, shape (n, n_nodes): that of its node alone,
            but for points inside a facet, where a master that is narrower than the cells presses.
        slave_facet: Which facet of the slave that is, −1 for points at nodes, shape (n,).
        slave_local: Local coordinates on it, shape (n, dim − 1).
        oblique_normals: Unit normals of planes of symmetry that are not normal to an axis, as `symmetric`,
            zero where a plane does not cut a point, shape (n, n_planes, dim).
        merged_nodes: Slave nodes plus one of other contact pairs that have a point in the same place, which
            is left out, on a surface beside: their areas are part of that of the point. Shape (n, n_pairs).
        length: `sizes` on bodies of revolution, shape (n,), [length]; None elsewhere, where areas give them.
    """

    pair: np.ndarray
    slave: np.ndarray
    master: sp.csr_matrix
    normal: np.ndarray
    tangents: np.ndarray
    gap: np.ndarray
    area: np.ndarray
    facet: np.ndarray
    local: np.ndarray
    axes: np.ndarray
    symmetric: np.ndarray
    distance: np.ndarray
    given: np.ndarray
    own: sp.csr_matrix
    slave_facet: np.ndarray
    slave_local: np.ndarray
    oblique_normals: np.ndarray
    merged_nodes: sp.csr_matrix
    length: np.ndarray | None = None

    @classmethod
    def at_nodes(
        cls,
        pair: np.ndarray,
        slave: np.ndarray,
        master: sp.csr_matrix,
        normal: np.ndarray,
        gap: np.ndarray,
        area: np.ndarray,
        **more: Any,
    ) -> Self:
        """Return points at nodes of slaves, by default with what is measured, off facets and planes."""
        (count, dim), none, axes = normal.shape, np.full(len(slave), -1), reference_axes(normal)
        if "own" not in more:
            entries = np.ones(count), slave, np.arange(count + 1)
            more["own"] = Csr(entries, shape=master.shape)
        if "merged_nodes" not in more:
            more["merged_nodes"] = Csr((count, 0), dtype=np.int64)
        values: dict[str, Any] = {
            "tangents": tangent_frames(normal, axes), "facet": none, "local": np.zeros((count, dim - 1)),
            "axes": axes, "symmetric": np.zeros((count, dim), dtype=bool), "distance": gap,
            "given": np.zeros(count, dtype=bool), "slave_facet": none,
            "slave_local": np.zeros((count, dim - 1)), "oblique_normals": np.zeros((count, 0, dim)),
        }  # fmt: skip
        parts = {"pair": pair, "slave": slave, "master": master, "normal": normal, "gap": gap, "area": area}
        return cls(**parts, **(values | more))

    @property
    def sizes(self) -> np.ndarray:
        """Size of the slave's facets around each node, shape (n,), [length]."""
        if self.length is not None:
            return self.length
        return np.asarray(self.area ** (1.0 / (self.normal.shape[1] - 1)))

    @property
    def count(self) -> int:
        """Number of contact points."""
        return len(self.slave)

    def part(self, chosen: np.ndarray) -> Self:
        """Return some of the points, by indices or a mask."""
        values = {each.name: getattr(self, each.name) for each in fields(self)}
        return type(self)(**{name: value[chosen] for name, value in values.items() if value is not None})

    def of_surface(self, pair: int, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return slave nodes of a pair whose areas belong to points, ascending, with values of these points.

        `values`: A value for each point, shape (n,).
        """
        mine = np.flatnonzero(self.pair == pair)
        if not self.merged_nodes.nnz:
            return self.slave[mine], values[mine]
        other = self.merged_nodes[:, [pair]].tocoo()
        nodes = np.concatenate([self.slave[mine], other.data - 1])
        order = np.argsort(nodes)
        return nodes[order], np.concatenate([values[mine], values[other.row]])[order]

    @property
    def are_inside(self) -> np.ndarray:
        """Numbers of the points that lie inside a facet of the slave, shape (k,)."""
        return np.flatnonzero(self.slave_facet >= 0)

    @property
    def are_at_nodes(self) -> bool:
        """Whether none of the points lies inside a facet of the slave."""
        return not len(self.are_inside)

    @cached_property
    def jump(self) -> sp.csr_matrix:
        """Weights of the nodes in slave minus master displacement, shape (n, n_nodes)."""
        return (self.own - self.master).tocsr()

    @property
    def are_rotated(self) -> np.ndarray:
        """Which points compare displacements with those of a master that are turned, shape (n,)."""
        return np.zeros(self.count, dtype=bool)

    def onto_slave(self, which: np.ndarray, vectors: np.ndarray) -> np.ndarray:
        """Return vectors at masters of some points as the slave has them, shape (k, dim)."""
        return vectors

    def relative(self, values: np.ndarray, nodes: slice = slice(None)) -> np.ndarray:
        """Return slave minus master displacement, shape (n, dim, ...).

        `values`: displacements of nodes, shape (n_nodes, dim, ...); `nodes`: which they are, all by default.
        """
        flat, shape = values.reshape(len(values), -1), (self.count, *values.shape[1:])
        return np.asarray(self.jump[:, nodes] @ flat).reshape(shape)

    def on_nodes(self, force: np.ndarray) -> np.ndarray:
        """Return forces on all nodes for those on the slave at each point, (n, dim) to (n_nodes, dim)."""
        return np.asarray(self.jump.T @ force)

    def entries(self, which: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return the entries of rows d·(u_slave − R u_master) of some points, sorted by row, then by node.

        `which`: point of each row, shape (n_rows,); `directions`: d, shape (n_rows, dim).

        Returns row, node, weight and the vector along which the displacement of the node is measured.
        """
        jump = self.jump[which]
        row = np.repeat(np.arange(len(which)), np.diff(jump.indptr))
        order = np.lexsort((jump.indices, row))
        row = row[order]
        return row, jump.indices[order], jump.data[order], directions[row]

    def as_rotated(self) -> RotatedPoints:
        """Return the points with rotations that are none."""
        count, dim = self.normal.shape
        values = {each.name: getattr(self, each.name) for each in fields(self)}
        return RotatedPoints(**values, rotations=np.tile(np.eye(dim), (count, 1, 1)))


@displayed
@dataclass(frozen=True, kw_only=True)
class RotatedPoints(ContactPoints):
    """Points of which some compare both sides of sectors.

    Attributes:
        rotations: R in the slave's displacement less R times that of the master, shape (n, dim, dim).
    """

    rotations: np.ndarray

    @property
    def are_rotated(self) -> np.ndarray:
        """Which points lie on sides of sectors, shape (n,)."""
        return np.asarray((self.rotations != np.eye(self.rotations.shape[1])).any(axis=(1, 2)))

    def onto_slave(self, which: np.ndarray, vectors: np.ndarray) -> np.ndarray:
        """Return vectors at masters, turned."""
        return np.asarray(np.einsum("nde,ne->nd", self.rotations[which], vectors))

    def relative(self, values: np.ndarray, nodes: slice = slice(None)) -> np.ndarray:
        """Return slave minus turned master displacement."""
        flat, shape = values.reshape(len(values), -1), (self.count, *values.shape[1:])
        own, theirs = (np.asarray(part[:, nodes] @ flat).reshape(shape) for part in (self.own, self.master))
        return np.asarray(own - np.einsum("nde,ne...->nd...", self.rotations, theirs))

    def on_nodes(self, force: np.ndarray) -> np.ndarray:
        """Return forces on all nodes."""
        back = np.einsum("nde,nd->ne", self.rotations, force)
        return np.asarray(self.own.T @ force - self.master.T @ back)

    def entries(self, which: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return the entries of rows, those of slaves and of masters."""
        parts = self.own[which], -self.master[which]
        back = np.einsum("nde,nd->ne", self.rotations[which], directions)
        rows = [np.repeat(np.arange(len(which)), np.diff(part.indptr)) for part in parts]
        along = np.concatenate([directions[rows[0]], back[rows[1]]])
        row, node = np.concatenate(rows), np.concatenate([part.indices for part in parts])
        order = np.lexsort((node, row))
        weight = np.concatenate([part.data for part in parts])
        return row[order], node[order], weight[order], along[order]

    def as_rotated(self) -> RotatedPoints:
        """Return the points."""
        return self


def join_points(parts: Sequence[ContactPoints], dim: int, n_nodes: int) -> ContactPoints:
    """Concatenate the points of several pairs, turned ones if the first are; empty if there are no parts."""
    if not parts:
        integer, real = np.zeros(0, dtype=np.int64), np.zeros(0)
        none = Csr((0, n_nodes))
        return ContactPoints.at_nodes(integer, integer, none, np.zeros((0, dim)), real, real)
    if len(parts) == 1:
        return parts[0]
    names = [each.name for each in fields(parts[0]) if each.name not in {"length", "oblique_normals"}]
    values = {name: [getattr(part, name) for part in parts] for name in names}
    joined = {
        name: sp.vstack(each, format="csr") if sp.issparse(each[0]) else np.concatenate(each)
        for name, each in values.items()
    }
    oblique = [part.oblique_normals for part in parts]
    most = max(each.shape[1] for each in oblique)
    oblique = [np.pad(each, ((0, 0), (0, most - each.shape[1]), (0, 0))) for each in oblique]
    plain = all(part.length is None for part in parts)
    length = None if plain else np.concatenate([part.sizes for part in parts])
    return type(parts[0])(**joined, oblique_normals=np.concatenate(oblique), length=length)


def reference_axes(normals: np.ndarray) -> np.ndarray:
    """Return for each normal the coordinate axis that is least aligned with it, shape (n, dim)."""
    # Rounding first: symmetric geometries have ties, which must not be decided by the last bit.
    return np.eye(normals.shape[1])[np.argmin(np.round(np.abs(normals), 6), axis=1)]


def with_symmetry(points: ContactPoints, marks: np.ndarray, planes: np.ndarray) -> ContactPoints:
    """Return points with the planes of symmetry that cut them.

    `marks`: which planes do, shape (n, n_planes); `planes`: their normals, the axes first.
    """
    dim = points.normal.shape[1]
    return replace(points, symmetric=marks[:, :dim], oblique_normals=marks[:, dim:, None] * planes[dim:])


def movable(points: ContactPoints, fixed: np.ndarray) -> np.ndarray:
    """Return the components of the relative displacement that supports leave free, shape (n_points, dim).

    `fixed`: whether a component of a node is prescribed, shape (n_nodes, dim).
    """
    jump = points.jump
    squares = Csr((jump.data**2, jump.indices, jump.indptr), shape=jump.shape)
    free, every = squares @ (~fixed).astype(float), squares @ np.ones(fixed.shape)
    return np.asarray((free > HELD**2 * every) & ~points.symmetric)


@dataclass(frozen=True, eq=False)
class FreeSpaces:
    """In which directions supports leave points free to move.

    Attributes:
        components: Those along the axes of the coordinates, shape (n_points, dim).
        oblique: Points whose free directions are others, ascending, shape (k,).
        projectors: The projections onto these, shape (k, dim, dim).
    """

    components: np.ndarray
    oblique: np.ndarray
    projectors: np.ndarray

    @classmethod
    def of(cls, points: ContactPoints, fixed: np.ndarray, axes: LocalAxes) -> FreeSpaces:
        """Return those of points; `fixed`: whether components are prescribed, along the axes of nodes."""
        dim, components = points.normal.shape[1], movable(points, fixed)
        touched = points.oblique_normals.any(axis=(1, 2)) | points.are_rotated
        if axes:
            turned = np.zeros(fixed.shape[0], dtype=bool)
            turned[axes.nodes] = True
            touched |= np.asarray(abs(points.jump) @ turned.astype(float)) > 0.0
        at = np.flatnonzero(touched)
        if not len(at):
            return cls(components, at, np.zeros((0, dim, dim)))
        square, every = np.zeros((len(at), dim, dim)), np.zeros(len(at))
        moved = []
        for axis in range(dim):
            row, node, weight, along = points.entries(at, np.tile(np.eye(dim)[axis], (len(at), 1)))
            moved.append(weight[:, None] * free_part(along, node, fixed, axes))
            every += np.bincount(row, weight**2, len(at)) / dim
        for one, other in np.ndindex(dim, dim):
            square[:, one, other] = np.bincount(row, np.sum(moved[one] * moved[other], axis=1), len(at))
        value, vector = np.linalg.eigh(square / every[:, None, None])
        held = np.einsum("nda,na,nea->nde", vector, value <= HELD**2, vector)
        across = np.eye(dim) * points.symmetric[at][:, :, None]
        across = across + np.einsum("npd,npe->nde", points.oblique_normals[at], points.oblique_normals[at])
        value, vector = np.linalg.eigh(held + across)
        return cls(components, at, np.einsum("nda,na,nea->nde", vector, value <= HELD, vector))

    def part(self, vectors: np.ndarray, which: np.ndarray | None = None) -> np.ndarray:
        """Return the free parts of vectors at points, by default one at each, shape (n, dim)."""
        which = np.arange(len(self.components)) if which is None else which
        result = np.where(self.components[which], vectors, 0.0)
        if len(self.oblique):
            place = np.minimum(np.searchsorted(self.oblique, which), len(self.oblique) - 1)
            mine = np.flatnonzero(self.oblique[place] == which)
            result[mine] = np.einsum("nde,ne->nd", self.projectors[place[mine]], vectors[mine])
        return result

    def held_axes(self) -> tuple[np.ndarray, np.ndarray]:
        """Return which points are held along one direction alone, (n,), and that direction, (n, dim)."""
        held = (~self.components).astype(float)
        single = held.sum(axis=1) == 1
        if len(self.oblique):
            value, vector = np.linalg.eigh(self.projectors)
            single[self.oblique] = np.round(value).sum(axis=1) == self.components.shape[1] - 1
            along = vector[:, :, 0]
            largest = np.argmax(np.round(np.abs(along), 6), axis=1)[:, None]
            held[self.oblique] = along * np.sign(np.take_along_axis(along, largest, axis=1))
        return single, held


def in_free_frames(points: ContactPoints, fixed: np.ndarray, axes: LocalAxes = NO_AXES) -> ContactPoints:
    """Return points whose second tangent is the only direction of slip where supports leave one.

    Where one component is held, closed points can slip only normal to that axis and the normal.

    `fixed`: whether a component of a node is prescribed, shape (n_nodes, dim), along its `axes`.
    """
    if points.normal.shape[1] == 2:
        return points
    single, held = FreeSpaces.of(points, fixed, axes).held_axes()
    single &= np.einsum("nd,nd->n", held, points.normal) ** 2 < 0.5
    first = np.where(single[:, None], held, points.axes)
    return replace(points, axes=first, tangents=tangent_frames(points.normal, first))


def tangent_frames(normals: np.ndarray, axes: np.ndarray | None = None) -> np.ndarray:
    """Return the unit tangents of each unit normal, shape (n, dim - 1, dim).

    In space (t1, t2, n) is right-handed, in the plane (t, n).

    `normals`: unit normals, shape (n, dim); `axes`: axes nearest to the first tangents, shape (n, dim);
    `reference_axes` by default.
    """
    if normals.shape[1] == 2:
        return np.stack([normals[:, 1], -normals[:, 0]], axis=1)[:, None]
    axes = reference_axes(normals) if axes is None else axes
    first = axes - np.einsum("nd,nd->n", axes, normals)[:, None] * normals
    first = first / np.linalg.norm(first, axis=1)[:, None]
    return np.stack([first, np.cross(normals, first)], axis=1)


def friction_data(
    scene: Scene, points: ContactPoints, comm: MPI.Comm
) -> tuple[np.ndarray, np.ndarray, Proportional]:
    """Return the friction data of each contact point. Collective on ``comm``.

    Returns whether it has friction, shape (n,); its Tresca bound as a nodal force (zero under Coulomb), shape
    (n,), [force]; and what follows the normal force (zero under Tresca).
    """
    has, coefficient, bound = np.zeros(points.count, dtype=bool), *np.zeros((2, points.count))
    places = scene.points[points.slave]
    with together(comm):
        for number, pair in enumerate(scene.contacts):
            mine = np.flatnonzero(points.pair == number)
            has[mine] = pair.has_friction
            if isinstance(pair.friction, Coulomb):
                coefficient[mine] = pair.friction_at(places[mine])
            elif isinstance(pair.friction, Tresca):
                bound[mine] = pair.friction_at(places[mine]) * points.area[mine]
    if comm.size > 1 and any(pair.friction_varies for pair in scene.contacts):
        values = np.stack([coefficient, bound])
        require_alike(comm, described(values, "friction given as functions of position"))
    return has, bound, _strengths(scene, points, comm, coefficient)


def _strengths(scene: Scene, points: ContactPoints, comm: MPI.Comm, coefficient: np.ndarray) -> Proportional:
    """Return friction that follows the normal force, with its limits and curves, if any. Collective."""
    curves = [pair.friction_curve for pair in scene.contacts]
    limits = [pair.shear_limit for pair in scene.contacts]
    if all(each is None for each in (*curves, *limits)):
        return Proportional(coefficient)
    limit, places = np.full(points.count, np.inf), scene.points[points.slave]
    with together(comm):
        for number, pair in enumerate(scene.contacts):
            mine = np.flatnonzero(points.pair == number)
            limit[mine] = pair.limit_at(places[mine]) * points.area[mine]
    if comm.size > 1 and any(map(callable, limits)):
        require_alike(comm, described(limit, "shear limits given as functions of position"))
    return Strengths(coefficient, limit, points.area, *_numbered(curves, points.pair))


def _numbered(given: Sequence[Law | None], pair: np.ndarray) -> tuple[np.ndarray, tuple[Law, ...]]:
    """Return the number of each point's law among those that pairs are given, −1 without, and these laws."""
    has = np.array([law is not None for law in given], dtype=bool)
    return np.where(has, np.cumsum(has) - 1, -1)[pair], tuple(law for law in given if law is not None)


def closures_of(scene: Scene, points: ContactPoints) -> Closures | None:
    """Return the closures of all contact points under force; None where all contact is exact."""
    curve, known = _numbered([pair.closure for pair in scene.contacts], points.pair)
    if not known:
        return None
    from fenics_contact.qp.compliance import Closures  # of no use in exact contact

    return Closures(points.area, curve, np.ones(points.count), known)


def elastic_slip(scene: Scene, points: ContactPoints) -> np.ndarray:
    """Return the elastic slip of contact points per friction force, 1/(k A), zero without any, shape (n,)."""
    stiffness = [pair.stick_stiffness for pair in scene.contacts]
    by_traction = np.array([0.0 if each is None else 1.0 / each for each in stiffness])
    elastic, slip = by_traction[points.pair] if len(stiffness) else np.zeros(0), np.zeros(points.count)
    return np.divide(elastic, points.area, out=slip, where=elastic > 0.0)


def reach_of(scene: Scene, points: ContactPoints) -> np.ndarray:
    """Return the distances at which pressure begins, zero in exact contact, shape (n,), [length]."""
    reach = np.array([0.0 if pair.closure is None else pair.closure.reach for pair in scene.contacts])
    return reach[points.pair] if len(reach) else np.zeros(0)


@displayed
@dataclass(frozen=True)
class NodeNumbers:
    """Numbers of the nodes of all bodies, body after body.

    Attributes:
        body_names: Names of the bodies, in numbering order.
        node_offset: First node of each body and the total, shape (n_bodies + 1,).
    """

    body_names: tuple[str, ...]
    node_offset: np.ndarray

    @classmethod
    def of(cls, scene: Scene) -> NodeNumbers:
        """Number the nodes of a scene."""
        names = scene.body_names
        return NodeNumbers(names, np.cumsum([0] + [scene.bodies[name].mesh.n_nodes for name in names]))

    @property
    def n_nodes(self) -> int:
        """Number of nodes of all bodies."""
        return int(self.node_offset[-1])

    def first_of(self, body: str) -> int:
        """Return the number of a body's first node."""
        return int(self.node_offset[self.body_names.index(body)])

    def global_nodes(self, body: str, nodes: np.ndarray) -> np.ndarray:
        """Number nodes of one body among those of all bodies."""
        return nodes + self.first_of(body)


def are_sliding(ties: Sequence[AnyTie], pair: np.ndarray) -> np.ndarray:
    """Return whether tied points may slide, by the numbers of their pairs."""
    return np.array([tie.sliding for tie in ties], dtype=bool)[pair]


#: Cosine between normals above which two points act in the same direction: corners stay what they are.
PARALLEL = 0.9

_LOG = logging.getLogger(__name__)


#: Pairs, their points, and numbers of some of them.
SomePoints: TypeAlias = tuple[Sequence[ContactPair | AnyTie], ContactPoints, np.ndarray]


class Notices(Protocol):
    """Who is told which points are left out, see `_pairing.advice`."""

    def left_out(self, words: str, lost: SomePoints, kept: SomePoints, comm: MPI.Comm) -> None:
        """Take notice of points that are left out for others."""


def without_tied(
    points: ContactPoints,
    ties: ContactPoints,
    scene: Scene,
    fixed: np.ndarray,
    axes: LocalAxes,
    advice: Notices,
    comm: MPI.Comm,
) -> ContactPoints:
    """Return the contact points that no tie has as well.

    Where an edge belongs to a tie and to a contact, both hold the same relative displacement. Their normal
    forces would be split at will, and friction would follow. The tie alone has them: it keeps closed.

    `fixed`: whether a component of a node is prescribed, shape (n_nodes, dim), along its `axes`.
    """
    point, tied = _tied(points, ties, scene, fixed, axes)
    words = "the contact of %s leaves out %s, where the force is that of %s, which ties the same places"
    advice.left_out(words, (scene.contacts, points, point), (scene.ties, ties, tied), comm)
    return points.part(np.setdiff1d(np.arange(points.count), point))


def tied_keys(
    points: ContactPoints,
    ties: ContactPoints,
    scene: Scene,
    fixed: np.ndarray,
    axes: LocalAxes = NO_AXES,
) -> tuple[np.ndarray, np.ndarray]:
    """Return pair and slave node of the points that `without_tied` leaves out."""
    point = np.unique(_tied(points, ties, scene, fixed, axes)[0])
    return points.pair[point], points.slave[point]


def tied_once(
    ties: ContactPoints, scene: Scene, fixed: np.ndarray, axes: LocalAxes = NO_AXES
) -> ContactPoints:
    """Return the points of ties without those of which another tie holds all, the first one of equals.

    Where an edge belongs to two ties, their forces would be split at will.
    """
    one, other, _ = _same_places(ties, ties)
    sliding = are_sliding(scene.ties, ties.pair)
    held = _held(ties.normal[one], ties, other, scene, (fixed, axes))
    first = np.where(sliding[one] == sliding[other], ties.pair[other] < ties.pair[one], sliding[one])
    lost = one[held & first & (sliding[one] | ~sliding[other])]
    return ties.part(np.setdiff1d(np.arange(ties.count), lost))


def shared_once(points: ContactPoints, scene: Scene, advice: Notices, comm: MPI.Comm) -> ContactPoints:
    """Return the contact points, of those that compare the same places in one direction only one.

    Where an edge belongs to two contact pairs, or two pairs have the same surfaces, their normal forces would
    be split at will, and friction would follow. The pair whose gap is smaller has them, of equal ones the
    one named first, with its friction and the area of the surfaces of both.
    """
    kept, lost = _shared(points, scene)
    words = "the contact of %s leaves out %s, where force and friction are those of %s at the same places"
    advice.left_out(words, (scene.contacts, points, lost), (scene.contacts, points, kept), comm)
    if not len(lost):
        return points
    area, merged_nodes = merged_areas(points, (kept, lost), scene)
    merged_nodes = points.merged_nodes.maximum(merged_nodes)  # not their sum: entries are numbers of nodes
    points = replace(points, area=points.area + area, merged_nodes=merged_nodes)
    return points.part(np.setdiff1d(np.arange(points.count), lost))


def merged_areas(
    points: ContactPoints, couples: tuple[np.ndarray, np.ndarray], scene: Scene
) -> tuple[np.ndarray, sp.csr_matrix]:
    """Return the areas that points take over from others, and whose nodes' they are, by `merged_nodes`.

    `couples`: numbers of points and of those that they stand for, shape (n,) each.
    """
    kept, lost = couples
    beside = np.zeros(len(kept), dtype=bool)
    for one, other, which in by_pairs(points.pair[kept], points.pair[lost]):
        beside[which] = are_beside(scene, scene.contacts[one], scene.contacts[other])
    # A node that two points could stand for gives its area to one of them.
    _, first = np.unique(np.where(beside, lost, -1), return_index=True)
    first = first[beside[first]]
    kept, lost = kept[first], lost[first]
    area = np.bincount(kept, points.area[lost], points.count)
    entries = points.slave[lost] + 1, (kept, points.pair[lost])
    return area, Csr(entries, shape=(points.count, len(scene.contacts)))


def are_beside(scene: Scene, pair: ContactPair, other: ContactPair) -> bool:
    """Return whether the slave surface of another pair has no facet of the surfaces of a pair."""
    mesh = scene.bodies[other.slave.body].mesh
    theirs = corners_of(mesh.surfaces[other.slave.name], mesh.dim)
    for side in pair.surfaces:
        if side.body == other.slave.body:
            mine = corners_of(mesh.surfaces[side.name], mesh.dim)
            if (match_faces(theirs, mine) >= 0).any():
                return False
    return True


def _shared(points: ContactPoints, scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Return the numbers of points, and of others for which each of them stands."""
    if points.count == 0:
        return points.pair, points.pair
    one, other, sign = _same_places(points, points)
    towards = sign[:, None] * points.normal[other]
    cosine = np.einsum("nd,nd->n", points.normal[one], towards)
    # Of two in one direction the one with the larger gap never closes; turned ones differ by their facets.
    size = points.sizes
    equal = HELD * size.mean()
    turned = np.linalg.norm(points.normal[one] - towards, axis=1)
    as_far = np.abs(points.gap[one] - points.gap[other]) <= equal + turned * size[one]
    rank = np.argsort(np.lexsort((points.pair, np.round(points.gap / (2.0 * equal)))))
    differ = points.pair[one] != points.pair[other]
    chosen = differ & (cosine > PARALLEL) & as_far & (rank[one] < rank[other])
    one, other = one[chosen], other[chosen]
    kept, lost = [one[:0]], [one[:0]]
    while len(one):
        stays = ~np.isin(one, other)
        kept.append(one[stays])
        lost.append(other[stays])
        left = ~np.isin(one, lost[-1]) & ~np.isin(other, lost[-1])
        one, other = one[left], other[left]
    return np.concatenate(kept), np.concatenate(lost)


def _tied(
    points: ContactPoints,
    ties: ContactPoints,
    scene: Scene,
    fixed: np.ndarray,
    axes: LocalAxes,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the numbers of contact points and tied ones that hold the same displacement."""
    point, tied, _ = _same_places(points, ties)
    held = _held(points.normal[point], ties, tied, scene, (fixed, axes))
    return point[held], tied[held]


def _held(
    normal: np.ndarray,
    ties: ContactPoints,
    tied: np.ndarray,
    scene: Scene,
    supported: tuple[np.ndarray, LocalAxes],
) -> np.ndarray:
    """Return whether tied points hold displacements along normals, shape (n, dim)."""
    sliding = are_sliding(scene.ties, ties.pair[tied])
    along = np.abs(np.einsum("nd,nd->n", normal, ties.normal[tied]))
    # A fixed tie holds all components but those that a support has on its slave.
    bonded = np.linalg.norm(free_part(normal, ties.slave[tied], *supported), axis=1)
    return np.asarray(np.where(sliding, along, bonded) > PARALLEL)


def _same_places(
    points: ContactPoints, others: ContactPoints, same_place: float = 0.95
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the numbers of points and others that compare the same places, and −1 where slaves swap.

    `same_place`: cosine between weights of nodes above which two points compare the same places.
    """
    left, right = (_unit_rows(each.jump) for each in (points, others))
    cosine = (left @ right.T).tocoo()
    same = np.abs(cosine.data) > same_place
    row, column = cosine.row[same].astype(np.int64), cosine.col[same].astype(np.int64)
    return row, column, np.sign(cosine.data[same])


def _unit_rows(jump: sp.csr_matrix) -> sp.csr_matrix:
    size = np.sqrt(np.asarray(jump.multiply(jump).sum(axis=1)).ravel())
    return sp.diags(1.0 / np.maximum(size, np.finfo(float).tiny)) @ jump


def by_pairs(left: np.ndarray, right: np.ndarray) -> Iterator[tuple[int, int, np.ndarray]]:
    """Yield each combination of pairs that occurs, with its places in the lists."""
    for one, other in np.unique(np.column_stack([left, right]), axis=0):
        yield int(one), int(other), (left == one) & (right == other)
