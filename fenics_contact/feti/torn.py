"""The torn system of one geometry: subdomain matrices, contact points and this rank's part of B."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.checks import naming_arguments
from fenics_contact._base.csr import Csr
from fenics_contact._base.display import displayed
from fenics_contact._base.shared import once_a_machine
from fenics_contact._fem.loads import as_tractions
from fenics_contact._pairing.advice import ADVICE, SILENCE, Advice
from fenics_contact._pairing.points import (
    ContactPoints,
    join_points,
    shared_once,
    tied_once,
    without_tied,
)
from fenics_contact._pairing.search import find_contact_points, find_tied_points
from fenics_contact._scene.scene import Scene
from fenics_contact._scene.true_shapes import is_approximate
from fenics_contact.errors import together
from fenics_contact.errors.kinds import safe_log
from fenics_contact.feti.all_rows import RowCompliance, RowGroups
from fenics_contact.feti.averages import nodal_mean_at
from fenics_contact.feti.contact_rows import NormalRows, TangentialRows
from fenics_contact.feti.decomposition import Decomposition, DualNumbering, entries, prescribed_along
from fenics_contact.feti.free_motions import FreeMotions, free_motions
from fenics_contact.feti.initial_gaps import check_no_penetration
from fenics_contact.feti.joints import JOINTS
from fenics_contact.feti.row_groups import Glued, Joint, RowGroup
from fenics_contact.feti.subdomain import Assembled, Subdomain, assemble
from fenics_contact.feti.ties import BondedTies, SlidingTies, TieRows
from fenics_contact.qp.cones import CoulombLaw, SlipLaw, TrescaLaw
from fenics_contact.qp.face import EXACT, ContactLaw
from fenics_contact.qp.layout import ContactLayout

if TYPE_CHECKING:
    from fenics_contact.qp.compliance import Closures


def contact_and_tied_points(
    scene: Scene, decomposition: Decomposition, *, overlap: bool, advice: Advice = SILENCE
) -> tuple[ContactPoints, ContactPoints]:
    """Search for contact and tied points, only where the scene has pairs. Collective."""
    tearing, fixed, comm = decomposition.tearing, decomposition.fixed, decomposition.comm
    axes = decomposition.axes
    points = ties = join_points([], scene.components, tearing.n_nodes)
    if scene.contacts:
        points = find_contact_points(scene, fixed, comm, axes=axes, advice=advice)
        if not overlap:
            check_no_penetration(scene, points)
    if scene.ties:
        ties = find_tied_points(scene, fixed, comm, axes=axes, advice=advice)
        if len(scene.ties) > 1:
            ties = tied_once(ties, scene, fixed, axes)
        if scene.sectors:
            from fenics_contact._pairing.sectors import check_supports_of_sides, joined_around

            with together(comm):
                check_supports_of_sides(ties, scene, fixed, axes)
            ties = joined_around(ties, ties, scene, areas=False)
            points = joined_around(points, ties, scene)
        if scene.contacts:
            points = without_tied(points, ties, scene, fixed, axes, advice, comm)
    if len(scene.contacts) > 1:
        points = shared_once(points, scene, advice, comm)
    return points, ties


def check_apart(scene: Scene, decomposition: Decomposition) -> None:
    """Search for contact and reject bodies that overlap at the start. Collective."""
    if scene.contacts:
        fixed, axes = decomposition.fixed, decomposition.axes
        points = find_contact_points(scene, fixed, decomposition.comm, axes=axes)
        check_no_penetration(scene, points)


_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class FluidLoad:
    """What fluid between surfaces exerts: nothing by default, where there is none."""

    load: np.ndarray | float = 0.0
    wet: np.ndarray | None = None
    pressure: np.ndarray | float = 0.0
    #: Which nodes of bodies that deform much it has reached, shape (n_nodes,); (0,) for none.
    marks: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=bool))

    @property
    def work(self) -> float:
        """Its work: none, or NaN, as it depends on the way."""
        return 0.0 if self.wet is None else np.nan


class Unworn:
    """What contact takes away: nothing by default."""

    #: Depth that points have lost before the load step, shape (n_contact,), [length].
    before: np.ndarray | float = 0.0

    def depth(self, pressure: np.ndarray, slip: np.ndarray) -> np.ndarray | float:
        """Return the depth that the load step takes, shape (n_contact,), [length].

        `pressure`: (n_contact,); `slip`: of the step, (n_contact, dim − 1).
        """
        return 0.0


@displayed
@dataclass(frozen=True)
class TornSystem:
    """min ½ uᵀK u − fᵀu + Σ Ψ_i ‖T_i u‖ subject to B_E u = c_E, B_N u ≤ c_N, distributed over ranks.

    Rows of B are those of its groups, one group after the other: gluing and Dirichlet rows, joints, normal
    rows (one per contact point), tangential rows (dim − 1 per frictional point).

    Attributes:
        scene: The scene with the geometry of this system.
        decomposition: The part that does not depend on the geometry.
        subdomains: This rank's subdomains with their matrices.
        groups: What the rows are, replicated.
        numbering: Owners and exchange of multipliers.
        B: This rank's part of B, shape (n_local_rows, torn_size); rows of joints and contacts act on free
            components only.
        supported: Contribution of prescribed displacements to the owned rows of joints and contacts, shape
            (n_owned,), zero on other rows, [length].
        right: c of the owned rows less the contribution of supports, shape (n_owned,), [length].
        slid: Tangential displacement of the points without friction, which have no such rows, at the origin
            of slip, replicated, shape (n_contact − n_friction, dim − 1), [length].
        free: The free motions of rigid surfaces and unknowns of joints, which add Q q to c.
        fluid: Load and place of fluid between surfaces.
        wear: What contact has taken away, and takes.
    """

    scene: Scene
    decomposition: Decomposition
    subdomains: tuple[Subdomain, ...]
    groups: RowGroups
    numbering: DualNumbering
    B: sp.csr_matrix
    supported: np.ndarray
    right: np.ndarray
    slid: np.ndarray
    free: FreeMotions
    fluid: FluidLoad = field(default_factory=FluidLoad)
    wear: Unworn = field(default_factory=Unworn)

    def jump(self, displacement: np.ndarray) -> np.ndarray:
        """Return B u for a torn displacement of this rank, owned, [length]. Collective."""
        return self.numbering.to_owned(self.B @ displacement)

    def force(self, multiplier: np.ndarray) -> np.ndarray:
        """Return Bᵀλ of owned multipliers on this rank's torn dofs, (torn_size,), [force]. Collective."""
        return np.asarray(self.B.T @ self.numbering.to_local(multiplier))

    def relative(self, displacement: np.ndarray) -> np.ndarray:
        """Return B u with the contribution of supports, owned, [length]. Collective."""
        jump = self.jump(displacement)
        return jump + self.supported - self.free.columns @ self.free_motion(self.right - jump)

    def free_motion(self, residual: np.ndarray) -> np.ndarray:
        """Return q of rigid surfaces and preloads, which fits the residual of rows best. Collective.

        Replicated; zero for tracked motions, which the right sides of rows contain.

        Args:
            residual: c − B u, owned, shape (n_owned,), [length].
        """
        first, moved = self.free.tracked, np.zeros(self.free.count)
        if self.free.count == first:
            return moved
        rows = self.groups.marks(self.groups.fitted)[self.numbering.owned]
        columns = self.free.columns[rows][:, first:]
        sums = np.column_stack([(columns.T @ columns).toarray(), -columns.T @ residual[rows]])
        sums = self.decomposition.comm.allreduce(sums)
        moved[first:] = np.linalg.solve(sums[:, :-1], sums[:, -1])
        return moved

    def closed(self, residual: np.ndarray) -> np.ndarray:
        """Return the residual c − B u of rows, owned, after the free motions that fit it best. Collective."""
        return residual + self.free.columns @ self.free_motion(residual) if self.free.count else residual

    def free_imbalance(self, multiplier: np.ndarray) -> np.ndarray:
        """Return g + Qᵀλ, the loads at free motions that multipliers do not balance. Collective.

        Args:
            multiplier: λ, owned, [force].

        Returns:
            Shape (n_free,), replicated.
        """
        return self.free.load + self.decomposition.comm.allreduce(self.free.columns.T @ multiplier)

    def load_work(self, displacement: np.ndarray) -> float:
        """Return the work of all loads, those at points of rigid surfaces included. Collective."""
        work = float(self.decomposition.comm.allreduce(self.load @ displacement))
        if self.free.count == 0:
            return work
        return work + float(self.free.load @ self.free_motion(self.right - self.jump(displacement)))

    def slip_origin(
        self, displacement: np.ndarray, multiplier: np.ndarray, sticks: np.ndarray | bool = False
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return from where a next load step measures slip, for `with_slip_from`. Collective.

        Elastic slip springs back: it is part of the next step's, whose friction begins as it is. What sticks
        has not slipped: its jumps are errors of the solver, and forces of a later step would follow them.

        `displacement`: torn, of this rank, shape (torn_size,), [length]; `multiplier`: λ, owned. Rows of
        points that are known to stick are marked, owned.
        """
        relative = self.relative(displacement) - self.compliance.contact.given_way(multiplier)
        return np.where(sticks, self.right + self.supported, relative), self.sliding(displacement)

    def with_slip_from(self, relative: np.ndarray, slid: np.ndarray) -> TornSystem:
        """Return the system in which slip is measured from an earlier displacement.

        Args:
            relative: Its value of `relative`, owned, shape (n_owned,), [length].
            slid: Its value of `sliding`, replicated, shape (n_contact − n_friction, dim − 1), [length].
        """
        marks = self.groups.marks([each for each in self.groups if each.from_before])
        right = np.where(marks[self.numbering.owned], relative - self.supported, self.right)
        return replace(self, right=right, slid=slid)

    def gluing_of(self, force: np.ndarray) -> np.ndarray:
        """Return multipliers of gluing rows that take a force as well as rows do one by one. Collective.

        λ_i = b_i D⁻¹ f / b_i D⁻¹ b_iᵀ of rows b_i of gluing and supports, owned, zero in others; `force`:
        torn, of this rank, shape (torn_size,), [force].
        """
        flexibility = 1.0 / self.decomposition.torn_stiffness
        size = self.numbering.to_owned(self.B.multiply(self.B) @ flexibility)
        glued = self.numbering.owned < self.n_gluing
        return np.where(glued, self.jump(flexibility * force) / np.where(glued, size, 1.0), 0.0)

    def moved_further(self, change: np.ndarray) -> TornSystem:
        """Return a system whose supports have moved, (n_nodes, dim), along axes of nodes, 0 where free."""
        groups, owned = self.groups, self.numbering.owned
        supported = groups.of_supports(change)
        right = -supported
        right[groups.rows_of(groups.glued)] = groups.glued.driven(change)
        return replace(self, right=self.right + right[owned], supported=self.supported + supported[owned])

    def sliding(self, displacement: np.ndarray) -> np.ndarray:
        """Return the tangential displacement of points without friction, [length]. Collective.

        Args:
            displacement: Torn displacement of this rank, shape (torn_size,), [length].

        Returns:
            Shape (n_contact − n_friction, dim − 1), replicated.
        """
        chosen = self.groups.slips.frictionless
        jump = self.points.jump[chosen]
        nodes = np.unique(jump.indices)
        relative = jump[:, nodes] @ nodal_mean_at(self.decomposition, displacement, nodes)
        return np.asarray(np.einsum("nad,nd->na", self.points.tangents[chosen], relative))

    def finer_gap(self) -> np.ndarray:
        """Return the gaps between surfaces known better than those used, see `true_surface`. Collective.

        Flat surfaces, and curved ones whose true shapes are used, are not searched again.

        Returns:
            Shape (n_contact,), [length]; the gap itself where no better surface is known.
        """
        decomposition, points = self.decomposition, self.points
        if not any(is_approximate(self.scene, pair) for pair in self.scene.contacts):
            return points.gap
        tearing, comm = decomposition.tearing, decomposition.comm
        fixed, axes = decomposition.fixed, decomposition.axes
        finer = find_contact_points(self.scene, fixed, comm, axes=axes, finer=True)
        mine, theirs = (searched.pair * tearing.n_nodes + searched.slave for searched in (points, finer))
        _, here, there = np.intersect1d(mine, theirs, return_indices=True)
        gap = points.gap.copy()
        gap[here] = finer.gap[there]
        gap[points.are_inside] = points.gap[points.are_inside]
        return gap

    def with_gap(self, gap: np.ndarray) -> TornSystem:
        """Return the system with other gaps, shape (n_contact,), [length]."""
        change = np.zeros(self.groups.total)
        change[self.normal_rows] = gap - self.points.gap
        groups = self.groups.with_points(replace(self.points, gap=gap))
        return replace(self, groups=groups, right=self.right + change[self.numbering.owned])

    def worn(self, wear: Unworn, closures: Closures) -> TornSystem:
        """Return the system whose surfaces have lost material, and give way as they lose more."""
        change = np.zeros(self.groups.total)
        change[self.normal_rows] = wear.before
        normal = replace(self.groups.normal, closures=closures)
        right = self.right + change[self.numbering.owned]
        return replace(self, groups=replace(self.groups, normal=normal), right=right, wear=wear)

    def giving_way_as(self, other: TornSystem) -> TornSystem:
        """Return the system whose contacts give way as those of another one do, at the same points."""
        normal = replace(self.groups.normal, closures=other.groups.normal.closures)
        return replace(self, groups=replace(self.groups, normal=normal), wear=other.wear)

    @property
    def components(self) -> int:
        """Displacement components of a node."""
        return self.decomposition.tearing.components

    @property
    def points(self) -> ContactPoints:
        """The contact points, replicated."""
        return self.groups.normal.points

    @property
    def tie_rows(self) -> tuple[TieRows, ...]:
        """The rows of the scene's ties."""
        return (*self.groups.of(BondedTies), *self.groups.of(SlidingTies))

    @property
    def ties(self) -> ContactPoints:
        """The points of the scene's ties in the order of `tie_rows`, replicated."""
        parts = [each.points for each in self.tie_rows]
        return join_points(parts, self.components, self.decomposition.tearing.n_nodes)

    @property
    def frictional(self) -> np.ndarray:
        """Numbers of the contact points with friction, replicated, shape (n_friction,)."""
        return self.groups.slips.frictional

    @property
    def n_gluing(self) -> int:
        """Number of gluing and Dirichlet rows of all ranks."""
        return self.groups.glued.count

    @property
    def n_equality(self) -> int:
        """Number of gluing, Dirichlet and joint rows of all ranks."""
        return self.groups.n_equality

    @property
    def normal_rows(self) -> np.ndarray:
        """Row number of every contact point's normal multiplier, shape (n_contact,)."""
        return self.groups.rows_of(self.groups.normal)

    @property
    def tangential_rows(self) -> np.ndarray:
        """Row numbers of every frictional point's tangential multipliers, shape (n_friction, dim - 1)."""
        return self.groups.rows_of(self.groups.slips).reshape(-1, max(self.components - 1, 1))

    def gathered(self, multiplier: np.ndarray, group: RowGroup) -> np.ndarray:
        """Return the entries of an owned vector in the rows of a group, on every rank. Collective."""
        return self.numbering.gather(multiplier, self.groups.rows_of(group))

    @cached_property
    def layout(self) -> ContactLayout:
        """Positions of this rank's contact multipliers."""
        normal, tangential = map(self.numbering.owned_index, (self.normal_rows, self.tangential_rows))
        owned, discs = normal >= 0, self.owned_discs
        contact = (np.cumsum(owned) - 1)[self.frictional[discs]]
        return ContactLayout(len(self.numbering.owned), normal[owned], tangential[discs], contact)

    @cached_property
    def owned_discs(self) -> np.ndarray:
        """The frictional points whose discs this rank owns, positions in `frictional`."""
        return np.flatnonzero(self.numbering.owned_index(self.tangential_rows[:, 0]) >= 0)

    @property
    def law(self) -> SlipLaw:
        """The law of friction of this rank's discs."""
        discs, layout, slips = self.owned_discs, self.layout, self.groups.slips
        if not np.any(slips.coefficient > 0):
            return TrescaLaw(layout, slips.tresca_bound[discs])
        return CoulombLaw(layout, slips.strength.part(discs), slips.tresca_bound[discs])

    @cached_property
    def compliance(self) -> RowCompliance:
        """By how much this rank's rows give way."""
        constant = self.groups.compliance[self.numbering.owned]
        soft = np.flatnonzero(constant)
        return RowCompliance(soft, constant[soft], self._compliance_of_contact)

    @property
    def _compliance_of_contact(self) -> ContactLaw:
        normal, slips = self.groups.normal, self.groups.slips
        if normal.closures is None and not slips.is_elastic:
            return EXACT
        from fenics_contact.qp.compliance import Closures, Compliance  # of no use in exact contact

        owned = self.numbering.owned_index(self.normal_rows) >= 0
        closures = normal.closures or Closures.exact(self.points.area)
        return Compliance(self.layout, closures.part(owned), slips.elastic_slip[self.owned_discs])

    @property
    def reach(self) -> np.ndarray | float:
        """Distances of the contact points at which pressure begins, shape (n_contact,); zero by default."""
        return self.groups.normal.reach(self.scene)

    @property
    def load(self) -> np.ndarray:
        """This rank's torn load f, shape (torn_size,), [force]."""
        return np.concatenate([subdomain.load for subdomain in self.subdomains]) + self.fluid.load

    def with_fluid(
        self,
        pressure: np.ndarray,
        wet: np.ndarray,
        at_points: np.ndarray,
        alone: np.ndarray | float = 0.0,
    ) -> TornSystem:
        """Return the system with fluid that presses surfaces apart as normal forces do. Collective.

        `pressure`: at each contact point, shape (n_contact,), [force / length²]; `wet`: where it is;
        `at_points`: its forces there, [force]; `alone`: forces on slaves alone, torn, of this rank.
        """
        force = np.zeros(len(self.numbering.owned))
        place = self.numbering.owned_index(self.normal_rows)
        force[place[place >= 0]] = at_points[place >= 0]
        free = self.free
        if free.count:  # it presses tools that are free to move, too
            on_points = np.asarray(self.numbering.comm.allreduce(free.columns.T @ force))
            free = replace(free, load=free.load + on_points)
        return replace(self, fluid=FluidLoad(alone - self.force(force), wet, pressure), free=free)


@naming_arguments
def build_torn_system(
    scene: Scene,
    decomposition: Decomposition,
    *,
    overlap: bool = False,
    previous: TornSystem | None = None,
) -> TornSystem:
    """Assemble the torn system for the scene's present coordinates. Collective.

    Args:
        scene: The scene whose decomposition is given, possibly moved.
        decomposition: Meshes and numbering.
        overlap: Whether bodies may overlap, as during shape optimisation: the gap is then negative and the
            state presses the bodies apart.
        previous: System of another geometry or load; unchanged subdomains are reused.

    Raises:
        InvalidInputError: If the bodies overlap at the start, or matrices are not finite.
    """
    comm = decomposition.comm
    loads = as_tractions(scene)
    decomposition.forms.prepare(scene)  # a new load may be of a type that the first scene did not have
    with together(comm):
        known = (None,) * len(decomposition.meshes) if previous is None else previous.subdomains
        assembled = Assembled()
        subdomains = tuple(
            assemble(
                mesh, scene.bodies[mesh.body], loads, decomposition.forms, earlier, scene.foundations,
                assembled=assembled,
            )
            for mesh, earlier in zip(decomposition.meshes, known, strict=True)
        )  # fmt: skip
    prescribed, _ = once_a_machine(comm, lambda: prescribed_along(scene, decomposition.tearing))
    with together(comm):
        free = free_motions(scene, decomposition.tearing)
    if previous is not None and _is_alike(scene, decomposition, previous, prescribed):
        # Only loads and prescribed values changed: B stays the same object, which marks F as unchanged, too.
        return at_rest(scene, decomposition, subdomains, previous, prescribed, free)
    groups = _found(scene, decomposition, overlap, previous, prescribed)
    rows = numbered(groups, decomposition, None if previous is None else previous.numbering)
    return at_rest(scene, decomposition, subdomains, rows, prescribed, free)


def with_points(torn: TornSystem, points: ContactPoints) -> TornSystem:
    """Return a system without fluid in which slip begins anew, with other contact points. Collective."""
    if points is torn.points:
        return torn
    scene, decomposition = torn.scene, torn.decomposition
    prescribed, _ = once_a_machine(decomposition.comm, lambda: prescribed_along(scene, decomposition.tearing))
    groups = with_contact(scene, decomposition, torn.groups.joints, points, prescribed)
    rows = numbered(groups, decomposition, torn.numbering)
    free = free_motions(scene, decomposition.tearing)
    return at_rest(scene, decomposition, torn.subdomains, rows, prescribed, free)


def with_points_inside(torn: TornSystem, other: TornSystem) -> TornSystem:
    """Return a system with points inside facets where another one has them. Collective."""
    return torn if other.points.are_at_nodes else with_points(torn, other.points)


@dataclass(frozen=True, eq=False)
class NumberedRows:
    """Groups of rows, numbered over ranks, with this rank's part of B; see `TornSystem`."""

    groups: RowGroups
    numbering: DualNumbering
    B: sp.csr_matrix


def at_rest(
    scene: Scene,
    decomposition: Decomposition,
    subdomains: tuple[Subdomain, ...],
    rows: NumberedRows | TornSystem,
    prescribed: np.ndarray,
    free: FreeMotions,
) -> TornSystem:
    """Return the system with what its rows measure at rest and under supports. Collective."""
    groups, owned, comm = rows.groups, rows.numbering.owned, decomposition.comm
    supported, right = once_a_machine(comm, lambda: groups.sides(scene, prescribed))
    with together(comm):
        for joint in groups.joints:
            joint.check(scene, prescribed, free.columns)
        free = free.on_rows(groups, decomposition.fixed, owned)
    return TornSystem(
        scene, decomposition, subdomains, groups, rows.numbering, rows.B, supported[owned], right[owned],
        np.zeros((len(groups.slips.frictionless), scene.components - 1)),
        free.with_unknowns(groups.unknowns(scene), owned),
    )  # fmt: skip


def _is_alike(scene: Scene, decomposition: Decomposition, known: TornSystem, prescribed: np.ndarray) -> bool:
    """Return whether scenes have the same meshes, pairs and held components, and supports drive the same."""
    same = scene.has_meshes_of(known.scene) and known.decomposition is decomposition
    same = same and known.points.are_at_nodes and contacts_alike(scene, known.scene)
    same = same and all(list(kind.key(scene)) == list(kind.key(known.scene)) for kind in JOINTS)
    return same and known.groups.slips.driven_as(prescribed)


def contacts_alike(scene: Scene, other: Scene) -> bool:
    """Return whether two scenes have contact pairs with the same rows, see `ContactPair.of_rows`."""
    return [pair.of_rows for pair in scene.contacts] == [pair.of_rows for pair in other.contacts]


def _found(
    scene: Scene,
    decomposition: Decomposition,
    overlap: bool,
    previous: TornSystem | None,
    prescribed: np.ndarray,
) -> RowGroups:
    """Search for contact, and return all groups of rows. Collective."""
    known = previous is not None and previous.scene.has_surfaces_of(scene)
    advice = SILENCE if known else ADVICE
    points, ties = contact_and_tied_points(scene, decomposition, overlap=overlap, advice=advice)
    found = _joints(scene, decomposition, ties, () if previous is None else previous.groups.joints)
    with together(decomposition.comm):
        left = ties
        for joint in found:
            points, left = joint.once(points, left, scene, prescribed)
    if left is not ties:
        found = _joints(scene, decomposition, left, found)
    groups = with_contact(scene, decomposition, found, points, prescribed)
    if decomposition.comm.rank == 0:
        _log_held(groups.slips, decomposition.fixed)
    return groups


def _joints(
    scene: Scene, decomposition: Decomposition, ties: ContactPoints, known: Sequence[Joint]
) -> tuple[Joint, ...]:
    """Return the joints of a scene in the order of their rows, given those of an earlier one. Collective."""
    found: list[Joint] = []
    for kind in JOINTS:
        found += kind.of(scene, decomposition, ties, [each for each in known if type(each) is kind])
    return tuple(found)


def with_contact(
    scene: Scene,
    decomposition: Decomposition,
    joints: tuple[Joint, ...],
    points: ContactPoints,
    prescribed: np.ndarray,
    further: tuple[RowGroup, ...] = (),
) -> RowGroups:
    """Return all groups of rows at contact points. Collective."""
    axes, glued = decomposition.axes, Glued(decomposition.gluing)
    normal = NormalRows.of(scene, points, axes)
    slips = TangentialRows.of(scene, points, prescribed, decomposition.comm, axes)
    return RowGroups(glued, joints, normal, slips, further)


def on_contact_rows(
    torn: TornSystem, points: ContactPoints, prescribed: np.ndarray, further: tuple[RowGroup, ...] = ()
) -> TornSystem:
    """Return a system with other contact points, those of bodies that have moved. Collective."""
    scene, decomposition = torn.scene, torn.decomposition
    groups = with_contact(scene, decomposition, torn.groups.joints, points, prescribed, further)
    rows = numbered(groups, decomposition, torn.numbering)
    owned, before = rows.numbering.owned, torn.numbering.owned
    # Each rank owns the same rows of equality.
    equality, kept = (np.flatnonzero(each < torn.n_equality) for each in (owned, before))
    picked = Csr((np.ones(len(kept)), (equality, kept)), shape=(len(owned), len(before)))
    right = np.zeros(groups.total)
    right[groups.rows_of(groups.normal)] = points.gap
    right = right[owned]
    right[equality] = torn.right[kept]
    slid = np.zeros((len(groups.slips.frictionless), scene.components - 1))
    return TornSystem(
        scene, decomposition, torn.subdomains, groups, rows.numbering, rows.B, picked @ torn.supported, right,
        slid, torn.free.on_contact_rows(picked, groups, owned),
    )  # fmt: skip


def _log_held(rows: TangentialRows, fixed: np.ndarray) -> None:
    held = int(rows.held(fixed).sum())
    if held:
        words = "%d of %d friction rows are left to the supports, which hold slip there"
        safe_log(_LOG.info, words, held, rows.count)


def numbered(groups: RowGroups, decomposition: Decomposition, known: DualNumbering | None) -> NumberedRows:
    """Number the multipliers and select the entries of B that act on this rank's subdomains. Collective."""
    comm, tearing = decomposition.comm, decomposition.tearing
    parts = [each.rows(tearing, decomposition.fixed) for each in groups]
    owner = once_a_machine(comm, lambda: np.concatenate([part.owner for part in parts]))
    row, copy, component, value = entries(parts)
    block = decomposition.blocks_of(copy)
    here = block >= 0
    row, column = row[here], tearing.components * block[here] + component[here]
    touched = np.unique(row)
    # The communication pattern is reused as long as no rank's share of the rows changes.
    stays = known is not None and known.serves(owner, touched)
    if comm.allreduce(int(not stays)) or known is None:
        known = DualNumbering(comm, owner, touched)
    shape = (len(known.local_rows), decomposition.torn_size)
    B = Csr((value[here], (known.local_index(row), column)), shape=shape)
    return NumberedRows(groups, known, B)
