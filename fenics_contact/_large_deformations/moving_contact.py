"""Contact points of undeformed or moved bodies, and the change of forces that turn with surfaces."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any, TypeAlias, cast

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.csr import Csr
from fenics_contact._base.display import displayed
from fenics_contact._base.sparse import ROUNDING, scaled_columns, scaled_rows
from fenics_contact._large_deformations.contact_feedback import (
    NOTHING_ON_SURFACES,
    ContactFeedback,
    OnSurfaces,
)
from fenics_contact._large_deformations.loading import Loading, UnsymmetricLowRank, with_added
from fenics_contact._pairing.inside import InFacets
from fenics_contact._pairing.sliding.slip import MaterialPoints
from fenics_contact._scene.local_axes import LocalAxes, free_matrix
from fenics_contact._scene.obstacles import RigidPlane
from fenics_contact._scene.pairs import ContactPair, Surface
from fenics_contact._scene.scene import Scene
from fenics_contact._surfaces.facets import share_areas
from fenics_contact.errors import InvalidInputError, together
from fenics_contact.feti.averages import nodal_mean_at
from fenics_contact.feti.contact_rows import on_copies
from fenics_contact.feti.decomposition import Decomposition, Rows, Tearing
from fenics_contact.feti.fluid_front import Front
from fenics_contact.feti.row_groups import RowGroup
from fenics_contact.feti.torn import TornSystem, on_contact_rows
from fenics_contact.qp.reductions import Vector

if TYPE_CHECKING:
    from fenics_contact._pairing.inside import InsideOf
    from fenics_contact._pairing.points import ContactPoints
    from fenics_contact._pairing.sliding.meeting import Candidates
    from fenics_contact._pairing.sliding.points import SlidingPoints


#: Returns the slip before a load step at points of moved bodies, shape (n, dim − 1), [length].
EarlierSlip: TypeAlias = "Callable[[SlidingPoints], np.ndarray]"

_NONE = np.zeros(0, dtype=np.int64)


@displayed
@dataclass(frozen=True, eq=False)
class RowCorrections:
    """The differences of derivatives of gap and slip from the rows of their forces.

    `columns`: of each row that is not the derivative; dof dim · node + component of all nodes; `corrected`:
    number of that row among those of contact.
    """

    columns: sp.csr_matrix
    corrected: np.ndarray
    owner: np.ndarray

    @classmethod
    def of(cls, rows: sp.csr_matrix, owner: np.ndarray) -> RowCorrections:
        """Return those that are not zero, of all rows of contact, shape (n, n_dofs), with their owners."""
        corrected = np.flatnonzero(_lengths(rows.T.tocsr()) > ROUNDING)
        return cls(rows[corrected].T.tocsr(), corrected, owner[corrected])


@displayed
@dataclass(frozen=True, eq=False)
class SymmetricLowRank:
    """A symmetric stiffness V diag(D) Vᵀ of few columns, D of either sign, [force / length].

    `owner`: node whose rank owns the row of a column.
    """

    columns: sp.csr_matrix
    values: np.ndarray
    owner: np.ndarray

    @classmethod
    def none(cls, size: int) -> SymmetricLowRank:
        """Return none on that many dofs."""
        return cls(Csr((size, 0)), np.zeros(0), _NONE)

    def joined(self, other: SymmetricLowRank) -> SymmetricLowRank:
        """Return the sum of two, the columns of the other one last."""
        if not len(other.owner):
            return self
        return SymmetricLowRank(
            sp.hstack([self.columns, other.columns], format="csr"),
            np.concatenate([self.values, other.values]),
            np.concatenate([self.owner, other.owner]),
        )


@displayed
@dataclass(frozen=True, eq=False)
class FollowerStiffness:
    """How forces change as surfaces turn under them, at fixed multipliers, and gaps other than by their rows.

    `normal`: of the normal forces of contact and of springs; `blocks`: of normal forces on single nodes,
    `block_node`; `forces`: directions of changes of friction forces and pressures, columns of length one;
    `displacements`: the displacements that change them, columns of length one; `stiffness`: change of force
    for a displacement of one; `owner`: node whose rank owns the rows of each of these.
    """

    normal: SymmetricLowRank
    blocks: np.ndarray
    block_node: np.ndarray
    forces: sp.csr_matrix
    displacements: sp.csr_matrix
    stiffness: np.ndarray
    owner: np.ndarray
    corrections: RowCorrections

    @classmethod
    def of(
        cls,
        normal: SymmetricLowRank,
        blocks: tuple[np.ndarray, np.ndarray],
        others: Sequence[UnsymmetricLowRank],
        corrections: RowCorrections,
    ) -> FollowerStiffness:
        """Return those of several stiffnesses; blocks with their nodes."""
        nothing = Csr((normal.columns.shape[0], 0))
        others = [each for each in others if each.left.shape[1]] or [
            UnsymmetricLowRank(nothing, nothing, _NONE)
        ]
        L, R = (_joined([getattr(each, side) for each in others]) for side in ("left", "right"))
        owner = np.concatenate([each.owner for each in others])
        left, right = _lengths(L), _lengths(R)
        kept = np.flatnonzero(left * right > ROUNDING * (left * right).max(initial=0.0))
        forces, displacements = (
            scaled_columns(columns[:, kept], 1.0 / lengths[kept])
            for columns, lengths in ((L, left), (R, right))
        )
        stiffness = (left * right)[kept]
        return cls(normal, *blocks, forces, displacements, stiffness, owner[kept], corrections)

    @classmethod
    def of_loads(cls, size: int, others: Sequence[UnsymmetricLowRank]) -> FollowerStiffness:
        """Return that of loads alone on that many dofs."""
        nothing = RowCorrections(Csr((size, 0)), _NONE, _NONE)
        return cls.of(SymmetricLowRank.none(size), (np.zeros((0, 0, 0)), _NONE), others, nothing)

    @property
    def compliance(self) -> np.ndarray:
        """Of the rows of normal forces, of either sign, shape (m,), [length / force]."""
        return np.asarray(1.0 / self.normal.values)

    @property
    def columns(self) -> list[tuple[sp.csr_matrix, np.ndarray]]:
        """Columns of all rows with the nodes whose ranks own them, in the order of `AuxiliaryRows`."""
        corrections = self.corrections
        return [
            (self.normal.columns, self.normal.owner),
            (self.forces, self.owner),
            (self.displacements, self.owner),
            (corrections.columns, corrections.owner),
        ]

    @property
    def count(self) -> int:
        """Number of rows."""
        return sum(len(owner) for _, owner in self.columns)


def _joined(parts: Sequence[sp.csr_matrix]) -> sp.csr_matrix:
    return parts[0] if len(parts) == 1 else sp.hstack(parts, "csr")


def _lengths(columns: sp.csr_matrix) -> np.ndarray:
    return np.sqrt(np.bincount(columns.indices, columns.data**2, columns.shape[1]))


@displayed
@dataclass(frozen=True, eq=False)
class AuxiliaryRows:
    """The rows of turning forces, after all others; positions are among all owned rows.

    `compliance`: of rows of normal forces, of either sign, zero of others, owned; `force_rows`: positions of
    rows whose multipliers act without being measured: each is what the row of `displacement_rows` of the same
    number measures, an unsymmetric stiffness; `displacement_rows`: positions of these rows, which have no
    multipliers; `share`: what each of them measures for a multiplier of one; `correction_rows`: positions of
    rows without multipliers that others need where displacements are measured: the derivative of a gap need
    not be the row of its force; `corrected_rows`: positions of these others; `correction`: the factor with
    which the former are added to the latter.
    """

    compliance: Vector
    force_rows: np.ndarray
    displacement_rows: np.ndarray
    share: Vector
    correction_rows: np.ndarray
    corrected_rows: np.ndarray
    correction: Vector

    @classmethod
    def of(cls, torn: TornSystem, before: TornSystem, turning: FollowerStiffness) -> AuxiliaryRows:
        """Return those of a system, given the one before without them."""
        begin, normal = len(before.numbering.owned), len(turning.compliance)
        number = torn.numbering.owned[begin:] - before.numbering.total
        pairs = len(turning.stiffness)
        compliance = np.concatenate([turning.compliance, np.zeros(turning.count - normal)])
        place, ends = begin + np.arange(len(number)), normal + pairs * np.arange(3)
        forces, displacements = ((number >= first) & (number < last) for first, last in pairwise(ends))
        correcting = number >= ends[-1]
        row = before.groups.n_equality + turning.corrections.corrected[number[correcting] - ends[-1]]
        return cls(
            compliance[number],
            place[forces],
            place[displacements],
            1.0 / turning.stiffness[number[forces] - normal],
            place[correcting],
            np.searchsorted(before.numbering.owned, row),
            np.ones(np.count_nonzero(correcting)),
        )

    @property
    def count(self) -> int:
        """Number of rows of this rank."""
        return len(self.compliance)

    def scaled(self, s: Vector) -> AuxiliaryRows:
        """Return the rows for multipliers λ / s, with s of all owned rows."""
        return replace(
            self,
            compliance=np.asarray(self.compliance * s[len(s) - self.count :] ** 2),
            share=np.asarray(self.share * s[self.displacement_rows] * s[self.force_rows]),
            correction=np.asarray(self.correction * s[self.corrected_rows] / s[self.correction_rows]),
        )


@dataclass(frozen=True, eq=False)
class TurningRows(RowGroup):
    """Rows of turning forces on the free components of nodes.

    `fields`: displacements of nodes that the rows measure; dof dim · node + component of all nodes; `axes`:
    axes of nodes along which supports prescribe components.
    """

    fields: sp.csr_matrix
    owner: np.ndarray
    axes: LocalAxes

    @property
    def count(self) -> int:
        """Number of rows."""
        return len(self.owner)

    def rows(self, tearing: Tearing, fixed: np.ndarray) -> Rows:
        """Return these rows of B."""
        fields, axes = self.fields, self.axes
        entries = (free_matrix(fixed, axes) @ fields if axes else fields).T.tocoo()
        node, component = np.divmod(entries.col, tearing.components)
        free = np.full(len(node), True) if axes else ~fixed[node, component]
        row, value = entries.row[free], entries.data[free]
        return on_copies(tearing, row, node[free], component[free], value, self.owner)

    def columns(self, fields: sp.csr_matrix) -> sp.csr_matrix:
        """Return by how much fields of nodes, (n_dofs, n), close the rows, shape (n_rows, n)."""
        return -self.fields.T @ fields


NO_ROWS = AuxiliaryRows(np.zeros(0), _NONE, _NONE, np.zeros(0), _NONE, _NONE, np.zeros(0))


def stiffened(
    torn: TornSystem, tangents: list[sp.csr_matrix], turning: FollowerStiffness
) -> list[sp.csr_matrix]:
    """Add blocks on single nodes, shared by their copies, to the tangents of this rank's subdomains."""
    if len(turning.block_node) == 0:
        return tangents
    decomposition, dim = torn.decomposition, torn.components
    entry, copy, place = decomposition.copies_here(turning.block_node)
    block = turning.blocks[entry] * decomposition.tearing.copy_share[copy, None, None]
    dofs = dim * place[:, None] + np.arange(dim)
    row, column = np.repeat(dofs, dim, axis=1).ravel(), np.tile(dofs, dim).ravel()
    size = decomposition.torn_size
    added = Csr((block.ravel(), (row, column)), shape=(size, size))
    return with_added(decomposition, tangents, added)


#: Number of facets that supports and obstacles may pass within a step: contact is searched where nodes are.
FACETS = 2.0


@displayed
@dataclass(frozen=True, eq=False)
class ContactConfiguration:
    """The contact points of undeformed bodies, with the system of their rows."""

    torn: TornSystem
    prescribed: np.ndarray

    @property
    def acting(self) -> OnSurfaces:
        """What acts on surfaces beside multipliers."""
        return NOTHING_ON_SURFACES

    @property
    def slip_start(self) -> MaterialPoints:
        """The moved points at the start of the load step, in material coordinates of the master."""
        return MaterialPoints.none(0, 0)

    def from_here(self, multiplier: Vector) -> ContactConfiguration:
        """Return the same points with slip that begins here, without what springs back. Collective."""
        return self

    def measured(self, load: Loading, origin: Callable[[], tuple[np.ndarray, np.ndarray]]) -> Loading:
        """Return a load whose system measures slip from an origin, where slip is not one of moved points."""
        return replace(load, torn=load.torn.with_slip_from(*origin()))

    def elastic_slip(self, friction: np.ndarray) -> np.ndarray:
        """Return D τ of friction forces, both of shape (n, dim − 1), [length]."""
        by_force, slips = np.zeros(len(friction)), self.torn.groups.slips
        by_force[slips.frictional] = slips.elastic_slip
        return np.asarray(by_force[:, None] * friction)

    def constraint_residual(self, displacement: Vector) -> Vector:
        """Return c − B u of contact, friction and gluing rows, owned, [length]. Collective.

        Gaps, minus the slip, and openings of glued rows.
        """
        return self.torn.closed(self.torn.right - self.torn.jump(displacement))

    def turning(
        self, multiplier: Vector, further: list[UnsymmetricLowRank], springs: SymmetricLowRank
    ) -> FollowerStiffness:
        """Return the stiffness of forces that turn with their surfaces. Collective.

        `further`: that of pressures; `springs`: of tools, which only bodies meet that move far.
        """
        return FollowerStiffness.of_loads(self.prescribed.size, further)

    def carried(self, values: Vector, other: ContactConfiguration) -> Vector:
        """Return a vector on the rows of other points on the rows of these, zero at new ones. Collective."""
        return values

    def spread(self, values: Vector, other: ContactConfiguration) -> Vector:
        """Return the same, but with the mean of others at points that are new. Collective."""
        return values

    def of_step(self, friction: np.ndarray, start: MaterialPoints, before: EarlierSlip) -> dict[str, Any]:
        """Return what of a `ContactResult` differs from that of undeformed bodies, by name.

        `friction`: forces, shape (n, dim − 1); `start`: where points lay on masters when the step began.
        """
        return {}

    def slip_on(self, points: SlidingPoints, slip: np.ndarray) -> np.ndarray:
        """Return slip at these points at those of moved bodies, shape (n, dim − 1), [length]."""
        return np.zeros((points.points.count, slip.shape[1]))

    def stored(self) -> dict[str, np.ndarray]:
        """Return the points as arrays, or from where slip is measured. Collective."""
        torn = self.torn
        origin = torn.numbering.gather(torn.right + torn.supported, np.arange(torn.numbering.total))
        return {"origin": origin, "slid": torn.slid}

    def where_they_are(self, undeformed: InsideOf, number: int) -> InsideOf:
        """Return the surfaces of a pair where its contact is found."""
        return undeformed

    def at_points(self, values: Vector) -> tuple[np.ndarray, np.ndarray]:
        """Return the part of a vector on normal rows, shape (n,), and on tangents, (n, dim − 1). Collective.

        That of points without friction is zero.
        """
        torn = self.torn
        count, width = torn.points.count, torn.components - 1
        rows = np.concatenate([torn.normal_rows, torn.tangential_rows.ravel()])
        gathered = torn.numbering.gather(values, rows)
        tangential = np.zeros((count, width))
        tangential[torn.frictional] = gathered[count:].reshape(-1, width)
        return gathered[:count], tangential

    def with_rows_of(self, turning: FollowerStiffness) -> TornSystem:
        """Return the system with the rows of turning forces after all others, in lengths. Collective."""
        rows = (TurningRows(*each, self.torn.decomposition.axes) for each in turning.columns)
        return on_contact_rows(self.torn, self._at, self.prescribed, tuple(rows)).giving_way_as(self.torn)

    @property
    def _at(self) -> ContactPoints:
        return self.torn.points


@displayed
@dataclass(frozen=True, eq=False)
class MovedContact(ContactConfiguration):
    """The contact points of bodies that have moved.

    `points`: where they are; `start`: at the start of the load step, in material coordinates of the master;
    `on_surfaces`: what acts there beside multipliers.
    """

    points: SlidingPoints
    start: MaterialPoints
    on_surfaces: OnSurfaces = NOTHING_ON_SURFACES

    @property
    def slip_start(self) -> MaterialPoints:
        return self.start

    @property
    def acting(self) -> OnSurfaces:
        return self.on_surfaces

    def from_here(self, multiplier: Vector) -> ContactConfiguration:
        elastic = None
        if self.torn.groups.slips.is_elastic:
            elastic = self.elastic_slip(self.at_points(multiplier)[1])
        return replace(self, start=self.points.material_points(elastic))

    def measured(self, load: Loading, origin: Callable[[], tuple[np.ndarray, np.ndarray]]) -> Loading:
        return load

    def constraint_residual(self, displacement: Vector) -> Vector:
        residual = super().constraint_residual(displacement)
        gap = self.points.points.gap - self.torn.reach + self.torn.wear.before
        return self._with_contact_rows(residual, gap, -self.slip(self.start))

    def slip(self, start: MaterialPoints) -> np.ndarray:
        """Return the slip since other material points, none across planes of symmetry, shape (n, dim − 1)."""
        return np.where(self._across, 0.0, self.points.slip(start))

    @cached_property
    def _across(self) -> np.ndarray:
        """Marks tangents across planes of symmetry, which supports hold, shape (n, dim − 1).

        Means over the master that change along it would slip, and friction act on nothing but supports.
        """
        torn, points = self.torn, self.torn.points
        across = np.einsum("nad,nd->na", points.tangents**2, points.symmetric) > 0.5
        along = np.einsum("nad,npd->nap", points.tangents, points.oblique_normals)
        across |= np.max(along**2, axis=2, initial=0.0) > 0.5
        held = np.zeros_like(across)
        held[torn.frictional] = torn.groups.slips.held(torn.decomposition.fixed).reshape(
            -1, torn.components - 1
        )
        return np.asarray(across & held)

    def turning(
        self, multiplier: Vector, further: list[UnsymmetricLowRank], springs: SymmetricLowRank
    ) -> FollowerStiffness:
        normal, friction = self.at_points(multiplier)
        points, slave, normal = self.points, self.points.points.slave, np.maximum(normal, 0.0)
        stiffness, torn = points.stiffness(normal), self.torn
        apart = torn.compliance.contact.gives_way
        means = points.mean_tangents(normal, friction, self.start, apart=apart)
        further = [
            *further,
            *(
                UnsymmetricLowRank(each.left, each.right, slave[each.point])
                for each in (points.friction_stiffness(friction), means.stiffness)
            ),
        ]
        width, frictional = self.torn.components - 1, self.torn.frictional
        rubbed = (width * frictional[:, None] + np.arange(width)).ravel()
        # In the order of the rows of contact, of which those of gaps measure −n·[u].
        slips = scaled_rows(means.slip, 1.0 - self._across.ravel())
        rows = sp.vstack([-means.gap, slips[rubbed]], "csr")
        point = np.concatenate([np.arange(len(slave)), rubbed // width])
        corrections = RowCorrections.of(rows, slave[point])
        blocks = stiffness.blocks, stiffness.block_node
        pressed = SymmetricLowRank(stiffness.columns, stiffness.values, slave[stiffness.point])
        return FollowerStiffness.of(pressed.joined(springs), blocks, further, corrections)

    def carried(self, values: Vector, other: ContactConfiguration) -> Vector:
        before = cast(MovedContact, other).points
        normal, friction = other.at_points(values)
        friction = self.points.carry_tangential(friction, before)
        friction[self._across] = 0.0
        return self._on_rows(values, other.torn, self.points.carry(normal, before), friction)

    def spread(self, values: Vector, other: ContactConfiguration) -> Vector:
        before = cast(MovedContact, other).points
        return self._on_rows(values, other.torn, *(self._filled(x, before) for x in other.at_points(values)))

    def _on_rows(
        self, values: Vector, before: TornSystem, normal: np.ndarray, friction: np.ndarray
    ) -> Vector:
        """Return a vector with values at points, and those of other rows of a vector of a system before."""
        torn = self.torn
        result = np.empty(len(torn.numbering.owned))
        equality = torn.numbering.owned < torn.n_equality
        result[equality] = values[before.numbering.owned < before.n_equality]
        return self._with_contact_rows(result, normal, friction)

    def of_step(self, friction: np.ndarray, start: MaterialPoints, before: EarlierSlip) -> dict[str, Any]:
        areas = self.points.areas(self.torn.scene)
        return {
            "slip": self.slip(start) - self.elastic_slip(friction),
            "slip_before": before(self.points),
            "area": areas.true,
            "nominal_area": areas.nominal,
        }

    def slip_on(self, points: SlidingPoints, slip: np.ndarray) -> np.ndarray:
        return points.carry_slip(slip, self.points)

    def stored(self) -> dict[str, np.ndarray]:
        return self.points.stored(self.start)

    def where_they_are(self, undeformed: InsideOf, number: int) -> InsideOf:
        return undeformed.moved(number, self.points.coordinates, self.points.placements)

    def _with_contact_rows(self, values: Vector, normal: np.ndarray, tangential: np.ndarray) -> Vector:
        """Write values at points into the contact rows of a vector, and return it."""
        torn = self.torn
        contact = np.concatenate([normal, tangential[torn.frictional].ravel()])
        mine = torn.numbering.owned >= torn.n_equality
        values[mine] = contact[torn.numbering.owned[mine] - torn.n_equality]
        return values

    def _filled(self, values: np.ndarray, other: SlidingPoints) -> np.ndarray:
        carried = self.points.carry(values, other)
        usual = values[values > 0.0].mean() if np.any(values > 0.0) else 1.0
        return np.where(carried > 0.0, carried, usual)

    @property
    def _at(self) -> ContactPoints:
        return self.points.points


class Contact:
    """Contact at the points of the undeformed bodies: small displacements."""

    #: What equilibria change, since the load step before.
    feedbacks: tuple[ContactFeedback, ...] = ()

    def changed_by(self, found: Any, tolerance: float) -> list[ContactFeedback]:
        """Return what does not agree with an equilibrium; contact has what does now. Collective."""
        last, self.feedbacks = self.feedbacks, tuple(each.after(found, tolerance) for each in self.feedbacks)
        return [new for new, old in zip(self.feedbacks, last, strict=True) if new is not old]

    def put_inside(self, places: InFacets) -> None:
        """Put points of pairs with obstacles inside facets of slaves, by key, all others at nodes."""

    def longest_part(self, first: Loading, last: Loading) -> float:
        """Return the part between two loads in which contact points can be found again. Collective."""
        return 1.0

    def first(self, load: Loading, displacement: Vector) -> ContactConfiguration:
        """Return the contact points at a displacement of this rank, torn; slip starts there. Collective."""
        return ContactConfiguration(load.torn, load.prescribed)

    def at(self, load: Loading, displacement: Vector, last: ContactConfiguration) -> ContactConfiguration:
        """Return the contact points at a displacement next to that of the last ones. Collective.

        These have the start of slip.
        """
        return self.first(load, displacement)

    def anew(self, load: Loading, displacement: Vector, last: ContactConfiguration) -> ContactConfiguration:
        """Return the contact points at any displacement, with the start of slip of others. Collective."""
        return self.first(load, displacement)

    def found_again(
        self, load: Loading, displacement: Vector, stored: Mapping[str, np.ndarray]
    ) -> ContactConfiguration:
        """Return the points that were stored by `ContactConfiguration.stored`. Collective."""
        return self.first(load, displacement)


class MovingContact(Contact):
    """Contact wherever the bodies have moved to."""

    def __init__(self, scene: Scene, decomposition: Decomposition) -> None:
        """Prepare the surfaces of all pairs. Collective."""
        from fenics_contact._pairing.sliding.contact import SlidingContact  # only for bodies that move far

        self._sliding = self._at_nodes = SlidingContact.of(
            scene, decomposition.fixed, decomposition.comm, axes=decomposition.axes
        )
        self._places, self.decomposition = scene.points, decomposition
        surfaces = [side for pair in scene.contacts for side in pair.surfaces]
        for side in surfaces:
            hanging = scene.bodies[side.body].mesh.hanging
            if np.isin(hanging.nodes, scene.facets(side)).any():
                raise InvalidInputError(
                    "contact of bodies that deform much needs surfaces without hanging nodes, but "
                    f"{side.name!r} of body {side.body!r} has some: refine all cells at that surface"
                )
        numbers = [decomposition.tearing.global_nodes(s.body, np.unique(scene.facets(s))) for s in surfaces]
        numbers += [
            decomposition.tearing.global_nodes(name, np.arange(body.mesh.n_nodes))
            for name, body in scene.tools.items()
        ]
        self._nodes = np.unique(np.concatenate(numbers))
        # No node passes through a half space: it is known everywhere on which side of a plane a node lies.
        searched = [pair for pair in scene.contacts if not _on_plane(scene, pair)]
        sides = [side for pair in searched for side in pair.surfaces]
        self._obstacles = [obstacle for pair in searched for obstacle in pair.moving]
        self._facet = min((facet_size(scene, side) for side in sides), default=np.inf)

    def put_inside(self, places: InFacets) -> None:
        """Put points of pairs with obstacles inside facets of slaves, by key, all others at nodes."""
        self._sliding = self._at_nodes.with_inside(places)

    @property
    def slaves(self) -> tuple[Candidates, ...]:
        """The slaves of all pairs."""
        return self._at_nodes.meetings

    def fluid_front(self, scene: Scene) -> Front:
        """Return the nodes of slaves that fluid may reach. Collective."""
        nodes = [slave.nodes for slave in self.slaves]
        return Front.of(scene, self.decomposition.tearing, self._at_nodes.comm, nodes)

    def longest_part(self, first: Loading, last: Loading) -> float:
        """Return the part in which what nodes may pass moves by a few facets. Collective."""
        if np.isinf(self._facet):
            return 1.0
        part = last.longest_part(first)
        way = np.nan_to_num(last.between(first, part).prescribed - first.prescribed)
        moved = float(np.linalg.norm(way, axis=1).max(initial=0.0)) / part
        corners = np.array([self._places[self._nodes].min(axis=0), self._places[self._nodes].max(axis=0)])
        with together(last.torn.numbering.comm):
            times = first.time, last.time
            paths = [[obstacle.frame(time) for time in times] for obstacle in self._obstacles]
        for path in paths:
            before, after = (corners @ rotation.T + translation for rotation, translation in path)
            moved = max(moved, float(np.linalg.norm(after - before, axis=1).max()))
        return min(1.0, FACETS * self._facet / moved) if moved > 0.0 else 1.0

    def first(self, load: Loading, displacement: Vector) -> ContactConfiguration:
        found = self._sliding.at(
            self._coordinates(load, displacement), None, load.time, None, load.free_tools
        )
        return self._on_rows(load, found, found.material_points())

    def at(self, load: Loading, displacement: Vector, last: ContactConfiguration) -> ContactConfiguration:
        last = cast(MovedContact, last)
        return self._from(load, displacement, last.points, last.start)

    def anew(self, load: Loading, displacement: Vector, last: ContactConfiguration) -> ContactConfiguration:
        return self._from(load, displacement, None, cast(MovedContact, last).start)

    def _from(
        self, load: Loading, displacement: Vector, known: SlidingPoints | None, start: MaterialPoints
    ) -> ContactConfiguration:
        coordinates = self._coordinates(load, displacement)
        found = self._sliding.at(coordinates, known, load.time, start, load.free_tools)
        return self._on_rows(load, found, start.extended(found.material_points()))

    def found_again(
        self, load: Loading, displacement: Vector, stored: Mapping[str, np.ndarray]
    ) -> ContactConfiguration:
        coordinates = self._coordinates(load, displacement)
        return self._on_rows(
            load, *self._sliding.found_again(stored, coordinates, load.time, load.free_tools)
        )

    def _on_rows(self, load: Loading, found: SlidingPoints, start: MaterialPoints) -> ContactConfiguration:
        torn = on_contact_rows(load.torn, found.points, load.prescribed)
        contact = MovedContact(torn, load.prescribed, found, start)
        for feedback in self.feedbacks:
            contact = feedback.on(contact, load)
        return contact

    def _coordinates(self, load: Loading, displacement: Vector) -> np.ndarray:
        """Return where all nodes of contact surfaces are, shape (n_nodes, dim), [length]. Collective."""
        coordinates = self._places.copy()
        coordinates[self._nodes] += nodal_mean_at(load.torn.decomposition, displacement, self._nodes)
        # Prescribed components reach their values within the step: gaps are those after it.
        moved, axes = coordinates - self._places, load.torn.decomposition.axes
        if not axes:
            return np.where(np.isnan(load.prescribed), coordinates, self._places + load.prescribed)
        local = np.where(np.isnan(load.prescribed), axes.to_local(moved), load.prescribed)
        return np.asarray(self._places + axes.to_global(local))


def _on_plane(scene: Scene, pair: ContactPair) -> bool:
    """Return whether the master of a pair is a plane, or a tool with one."""
    shape = scene.tools[pair.tool].tool.shape if pair.tool else pair.obstacle_at_rest
    return isinstance(shape, RigidPlane)


def facet_size(scene: Scene, side: Surface) -> float:
    """Return the usual size of the facets of a surface, [length]."""
    mesh = scene.bodies[side.body].mesh
    area = float(share_areas(mesh, side.name).sum()) / len(mesh.surfaces[side.name])
    return area ** (1.0 / (scene.dim - 1))
