"""What of a contact pair stays the same while its bodies move: nodes, facets, the weights of the patches."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from fenics_contact._base.libraries import MPI
from fenics_contact._pairing.inside import ON_PLANE, InFacets, InsideOf
from fenics_contact._pairing.points import PARALLEL, NodeNumbers, are_beside, tied_keys
from fenics_contact._pairing.search import find_contact_points, find_tied_points
from fenics_contact._pairing.sliding.closest import ClosestPoints, Roles, moved_surface
from fenics_contact._pairing.sliding.patches import SmoothPatches
from fenics_contact._pairing.tips import carrying
from fenics_contact._scene.local_axes import NO_AXES, LocalAxes
from fenics_contact._scene.obstacles import RigidObstacle, RigidPlane
from fenics_contact._scene.pairs import ContactPair, Surface
from fenics_contact._scene.parts import slave_of, surface_of
from fenics_contact._scene.scene import Scene
from fenics_contact._scene.touching import may_touch
from fenics_contact._surfaces.facets import FacetedSurface
from fenics_contact._surfaces.projection import Projection, join
from fenics_contact.errors import InvalidInputError, together


@dataclass(frozen=True)
class Meeting:
    """A contact pair.

    Attributes:
        slave: The slave surface in the reference configuration.
        slave_nodes: Its nodes among those of all bodies, shape (n_slave,).
        candidates: Positions in them of the nodes that may carry a multiplier, shape (n_candidates,).
        offset: What is added to the gap of each of them, as the pair gives it, shape (n_candidates,),
            [length].
        given: Whether it is, shape (n_candidates,).
        area: Area that belongs to each of them, shape (n_candidates,), [length^(dim - 1)].
        patches: The smooth surface of the master; None for a rigid obstacle and for mortar contact.
        facets: The master in the reference configuration for mortar contact; None for other pairs.
        master_nodes: Nodes of the master among those of all bodies; none for a rigid obstacle.
        master_cut: On which planes of symmetry these lie, shape (n_master, n_planes).
        obstacle: The rigid obstacle; None for a body.
        apart: Facets on which each candidate never has a point, where a body meets itself, shape
            (n_candidates, n_facets); None where bodies meet others.
        reach: Distance beyond which no candidate needs a point, [length].
        roles: Which candidates are slaves, where a surface meets itself; None where all are.
        taken: Whose areas they have, too, see `ContactPoints.taken`.
        own: Weights of the slave's nodes in where candidates lie, at their nodes at first, shape
            (n_candidates, n_slave).
        on_facet: The facet of the slave in which one lies, −1 at nodes, shape (n_candidates,).
        on_local: Local coordinates on it, shape (n_candidates, dim − 1).
    """

    slave: FacetedSurface
    slave_nodes: np.ndarray
    candidates: np.ndarray
    offset: np.ndarray
    given: np.ndarray
    area: np.ndarray
    own: sp.csr_matrix
    on_facet: np.ndarray
    on_local: np.ndarray
    patches: SmoothPatches | None
    facets: FacetedSurface | None
    master_nodes: np.ndarray
    master_cut: np.ndarray
    obstacle: RigidObstacle | None
    apart: sp.csr_matrix | None = None
    reach: float = np.inf
    roles: Roles | None = None
    taken: sp.csr_matrix | None = None

    @property
    def nodes(self) -> np.ndarray:
        """Nodes that may carry a multiplier among those of all bodies, ascending, shape (n_candidates,)."""
        return np.asarray(self.slave_nodes[self.candidates])

    def part(self, chosen: np.ndarray) -> Meeting:
        """Return the pair with some of its candidates, by their positions; not of a body with itself."""
        names = ("candidates", "offset", "given", "area", "own", "on_facet", "on_local")
        taken = None if self.taken is None else self.taken[chosen]
        return replace(self, taken=taken, **{name: getattr(self, name)[chosen] for name in names})

    def normals(self, coordinates: np.ndarray) -> np.ndarray:
        """Return the outward normals of the candidates as the bodies lie now, shape (n_candidates, dim)."""
        return np.asarray(self.own @ moved_surface(self.slave, coordinates[self.slave_nodes]).averaged)

    def with_inside(self, inside: InsideOf, places: InFacets) -> Meeting:
        """Return the pair with some candidates, by their nodes, inside facets of the slave."""
        at, own = np.searchsorted(self.nodes, places.point), self.own.tolil()
        offset, on_facet, on_local = self.offset.copy(), self.on_facet.copy(), self.on_local.copy()
        own[at] = inside.at(places.facet, places.local).own[:, self.slave_nodes]
        offset[at] += places.relief
        on_facet[at], on_local[at] = places.facet, places.local
        return replace(self, offset=offset, own=own.tocsr(), on_facet=on_facet, on_local=on_local)

    @property
    def cut(self) -> np.ndarray:
        """Planes of symmetry that cut the slave at candidates, shape (n_candidates, n_planes)."""
        return np.asarray(abs(self.own) @ (~self.slave.mirrored).astype(float) < ON_PLANE)

    def closest(
        self,
        coordinates: np.ndarray,
        last: tuple[np.ndarray, np.ndarray],
        met: np.ndarray,
        reach: float,
        comm: MPI.Comm,
    ) -> Projection:
        """Return the closest points of the candidates on the master. Collective.

        `coordinates`: of all nodes, shape (n_nodes, dim), [length]; `last`: last facets, −1 where there is
        none, shape (n_candidates,), and local coordinates; `met`: whether candidates are known to be on the
        side of their points, shape (n_candidates,); `reach`: distance beyond which no point is wanted,
        [length]; `comm`: communicator of the ranks, each of which projects a share.
        """
        assert self.patches is not None
        mine = np.arange(comm.rank, len(self.candidates), comm.size)
        found: Projection | None = None
        with together(comm):
            points = coordinates[self.master_nodes]
            apart = None if self.apart is None else self.apart[mine]
            reach = min(reach, self.reach)
            search = ClosestPoints(self.patches, points, self.patches.coefficients(points), reach, apart)
            normals, (facet, local) = self.normals(coordinates), last
            at = coordinates[self.nodes[mine]]
            hit = search.find(at, normals[mine], facet[mine], local[mine], met[mine])
            found = replace(hit, point=mine[hit.point], lost=mine[hit.lost])
        joined = join([part for part in comm.allgather(found) if part is not None])
        return joined if self.roles is None else joined.part(self.roles.are_slaves(joined, facet))


def meetings_of(
    scene: Scene, fixed: np.ndarray, comm: MPI.Comm, axes: LocalAxes = NO_AXES
) -> tuple[Meeting, ...]:
    """Return the pairs of a scene in its reference configuration. Collective.

    `fixed`: whether a component of a node is prescribed, shape (n_nodes, dim), along its `axes`.
    """
    with together(comm):
        _require_inside(scene)
    number = slave = np.zeros(0, dtype=np.int64)
    if scene.contacts and scene.ties:
        points, ties = (find(scene, fixed, comm) for find in (find_contact_points, find_tied_points))
        number, slave = tied_keys(points, ties, scene, fixed, axes)
    with together(comm):
        meetings = tuple(
            _meeting(scene, pair, fixed, slave[number == index]) for index, pair in enumerate(scene.contacts)
        )
        if scene.sectors and scene.contacts:
            from fenics_contact._pairing.sectors import around_once

            lost, onto = around_once(points, ties, scene)
            kept = np.asarray(onto.argmax(axis=1)).ravel()
            mine = [points.pair[lost] == index for index in range(len(meetings))]
            nodes = [(points.slave[lost[own]], points.slave[kept[own]]) for own in mine]
            meetings = tuple(
                _joined_to(met, *nodes[index], (index, len(meetings))) for index, met in enumerate(meetings)
            )
        if scene.preloads:
            meetings = tuple(
                _once_at_sections(scene, met, (index, len(meetings))) for index, met in enumerate(meetings)
            )
        return meetings


def _require_inside(scene: Scene) -> None:
    """Reject masters that end at a side of a sector: nodes that slide over it would meet the neighbour's."""
    for sector in scene.sectors:
        for pair in scene.contacts:
            for side in (sector.slave, sector.master):
                master = pair.master
                if not isinstance(master, Surface) or master.body != side.body:
                    continue
                surfaces = scene.bodies[side.body].mesh.surfaces
                if np.isin(surfaces[master.name], surfaces[side.name]).any():
                    raise InvalidInputError(
                        "contact of bodies that deform much does not go on around a sector, but the master "
                        f"of {pair.place} ends at the side {side.name!r} of {sector.place}: model the whole, "
                        "let the master end before, or take a rigid obstacle as master"
                    )


def _once_at_sections(
    scene: Scene, meeting: Meeting, number: tuple[int, int], across: float = 0.1
) -> Meeting:
    """Return a pair by nodes with one of two candidates on both sides of a section, see `once_at_sections`.

    `across`: largest cosine between normals of contact and section with which they count as across.
    """
    pair, numbers = scene.contacts[number[0]], NodeNumbers.of(scene)
    for preload in scene.preloads:
        if pair.by_mortar or pair.slave.body != preload.body:
            continue
        mesh = scene.bodies[preload.body].mesh
        behind, before = numbers.global_nodes(preload.body, preload.cut(mesh).pairs).T
        along = np.abs(meeting.slave.normals[meeting.candidates] @ preload.normal(mesh)) < across
        both = np.isin(behind, meeting.nodes[along]) & np.isin(before, meeting.nodes[along])
        meeting = _joined_to(meeting, behind[both], before[both], number)
    return meeting


def _joined_to(meeting: Meeting, lost: np.ndarray, kept: np.ndarray, number: tuple[int, int]) -> Meeting:
    """Return a pair without some of its nodes, whose areas others have."""
    there = np.flatnonzero(np.isin(meeting.nodes, lost))
    if not len(there):
        return meeting
    order = np.argsort(lost)
    place = np.searchsorted(meeting.nodes, kept[order])
    area = meeting.area.copy()
    np.add.at(area, place, meeting.area[there])
    entries = meeting.nodes[there] + 1, (place, np.full(len(place), number[0]))
    taken = sp.csr_matrix(entries, shape=(len(area), number[1]))
    taken = taken if meeting.taken is None else meeting.taken.maximum(taken)
    joined = replace(meeting, area=area, taken=taken)
    return joined.part(np.setdiff1d(np.arange(len(area)), there))


def _meeting(scene: Scene, pair: ContactPair, fixed: np.ndarray, tied: np.ndarray) -> Meeting:
    numbers, dim = NodeNumbers.of(scene), scene.dim
    slave = slave_of(scene, pair, "faceted")
    slave_nodes = numbers.global_nodes(pair.slave.body, slave.nodes)
    bearing = ~fixed[slave_nodes].all(axis=1) & ~np.isin(slave_nodes, tied)
    bearing &= may_touch(scene.bodies, pair, slave)
    other = pair.master
    master = surface_of(scene, other, "faceted") if isinstance(other, Surface) else other
    candidates = np.flatnonzero(bearing & carrying(pair, slave, master))
    count = len(candidates)
    at_nodes = np.ones(count), candidates, np.arange(count + 1)
    own = (
        np.zeros(count), np.zeros(count, dtype=bool), slave.point_areas[candidates],
        sp.csr_matrix(at_nodes, shape=(count, len(slave.nodes))), np.full(count, -1),
        np.zeros((count, dim - 1)),
    )  # fmt: skip
    if not isinstance(master, FacetedSurface):
        none = np.zeros(0, dtype=np.int64), np.zeros((0, dim), dtype=bool)
        return Meeting(slave, slave_nodes, candidates, *own, None, None, *none, master)
    assert isinstance(pair.master, Surface)
    patches = None if pair.by_mortar else SmoothPatches.of(master, smooth=pair.geometry != "faceted")
    nodes = numbers.global_nodes(pair.master.body, master.nodes)
    met = Meeting(
        slave, slave_nodes, candidates, *own, patches, master if pair.by_mortar else None, nodes,
        master.mirrored, None,
    )  # fmt: skip
    return _within_body(met, master) if pair.within_body else met


def _within_body(meeting: Meeting, master: FacetedSurface, facets: float = 3.0) -> Meeting:
    """Return a meeting of a body with itself.

    Candidates have no points on patches on which they lie, nor on facets behind them in the undeformed body:
    those on the other side of a thin wall.
    """
    assert meeting.patches is not None
    corners = master.points[master.facets]
    centres = corners.mean(axis=1)
    size = float(np.linalg.norm(corners - centres[:, None], axis=2).mean())
    reach = 2.0 * facets * size
    place = meeting.slave.points[meeting.candidates]
    lists = cKDTree(centres).query_ball_point(place, 2.0 * reach)
    row = np.repeat(np.arange(len(place)), [len(each) for each in lists])
    column = np.concatenate([np.zeros(0, dtype=np.int64), *map(np.asarray, lists)]).astype(np.int64)
    normals = meeting.slave.normals[meeting.candidates[row]]
    behind = np.einsum("nd,nd->n", centres[column] - place[row], normals) < 0.0
    shape = len(place), len(centres)
    behind_it = sp.csr_matrix((np.ones(behind.sum()), (row[behind], column[behind])), shape=shape)
    carried = meeting.patches.control.tocoo()
    facet = carried.row // (meeting.patches.control.shape[0] // len(centres))
    own = sp.csr_matrix(
        (np.ones(len(facet)), (facet, meeting.master_nodes[carried.col])),
        shape=(len(centres), int(max(meeting.slave_nodes.max(), meeting.master_nodes.max())) + 1),
    )
    touched = own[:, meeting.nodes]
    apart = ((behind_it + touched.T) > 0).tocsr()
    roles = None
    if np.array_equal(meeting.slave_nodes, meeting.master_nodes):
        roles = Roles(meeting.patches, master.points, meeting.candidates, touched)
    return replace(meeting, apart=apart, reach=reach, roles=roles)


def shared_once(meetings: tuple[Meeting, ...], scene: Scene) -> tuple[Meeting, ...]:
    """Return the pairs, of which each node that meets the same by nodes has points of the first only.

    Wherever the bodies lie, such nodes have the same counterpart in both pairs: the split of their force
    would not be determined. They keep the area of both surfaces. By mortar the counterparts are means over
    different facets, and of other masters a node may leave one for the other: these points are left alone.
    """
    pairs, result = scene.contacts, list(meetings)
    for other, pair in enumerate(pairs):
        for one in range(other):
            if _meet_alike(pairs[one], pair):
                beside = are_beside(scene, pairs[one], pair)
                result[one], result[other] = _split(result[one], result[other], beside, (other, len(pairs)))
    return tuple(result)


def _meet_alike(pair: ContactPair, other: ContactPair) -> bool:
    """Return whether a node has the same counterpart and gap in both pairs."""
    one, two = pair.master, other.master
    same = one is two or (isinstance(one, (Surface, RigidPlane)) and one == two)
    given = (pair.gap, pair.interference, pair.adjust) == (other.gap, other.interference, other.adjust)
    by_mortar = pair.by_mortar or other.by_mortar
    return same and given and not by_mortar and not pair.within_body and pair.geometry == other.geometry


def _split(kept: Meeting, lost: Meeting, beside: bool, number: tuple[int, int]) -> tuple[Meeting, Meeting]:
    """Return two pairs, the second without the nodes that both have where their surfaces run on smoothly."""
    _, here, there = np.intersect1d(kept.nodes, lost.nodes, return_indices=True)
    normals = kept.slave.normals[kept.candidates[here]], lost.slave.normals[lost.candidates[there]]
    parallel = np.einsum("nd,nd->n", *normals) > PARALLEL
    here, there = here[parallel], there[parallel]
    stays = np.setdiff1d(np.arange(len(lost.candidates)), there)
    if beside:
        area = kept.area.copy()
        area[here] += lost.area[there]
        entries = lost.nodes[there] + 1, (here, np.full(len(here), number[0]))
        taken = sp.csr_matrix(entries, shape=(len(area), number[1]))
        taken = taken if kept.taken is None else kept.taken + taken
        kept = replace(kept, area=area, taken=taken.tocsr())
    return kept, lost.part(stays)
