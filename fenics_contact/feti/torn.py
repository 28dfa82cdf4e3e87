"""The torn system of one geometry: subdomain matrices, contact points and this rank's part of B."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.checks import naming_arguments
from fenics_contact._base.display import displayed
from fenics_contact._fem.loads import as_tractions
from fenics_contact._pairing.points import (
    ContactPoints,
    closures_of,
    elastic_slip,
    friction_data,
    join_points,
    reach_of,
    shared_once,
    tied_once,
    without_tied,
)
from fenics_contact._pairing.search import find_contact_points, find_tied_points
from fenics_contact._scene.scene import Scene
from fenics_contact._scene.true_shapes import is_approximate
from fenics_contact.errors import together
from fenics_contact.errors.kinds import safe_log
from fenics_contact.feti.averages import nodal_mean_at
from fenics_contact.feti.constraints import ConstraintRows, constraint_rows
from fenics_contact.feti.contact_rows import Relations, normal_relations, tangential_relations, tied_relations
from fenics_contact.feti.decomposition import (
    Decomposition,
    DualNumbering,
    Rows,
    prescribed_along,
    stack,
)
from fenics_contact.feti.free_motions import NO_MOTIONS, FreeMotions, Measured, free_motions, without_held
from fenics_contact.feti.initial_gaps import check_no_penetration, gap_with_room
from fenics_contact.feti.preloads import (
    given_shortenings,
    once_at_sections,
    section_points,
    shortening_columns,
    with_shortenings,
)
from fenics_contact.feti.springs import SpringRows, spring_points, with_springs
from fenics_contact.feti.subdomain import Assembled, Subdomain, assemble
from fenics_contact.qp.cones import CoulombLaw, SlipLaw, Strengths, TrescaLaw
from fenics_contact.qp.layout import ContactLayout

if TYPE_CHECKING:
    from fenics_contact.qp.compliance import Closures, Compliance


def meeting_points(
    scene: Scene, decomposition: Decomposition, *, overlap: bool, told: bool = False
) -> tuple[ContactPoints, ContactPoints]:
    """Search for contact and tied points, only where the scene has pairs. Collective."""
    tearing, fixed, comm = decomposition.tearing, decomposition.fixed, decomposition.comm
    axes = decomposition.axes
    points = ties = join_points([], scene.components, tearing.n_nodes)
    if scene.contacts:
        points = find_contact_points(scene, fixed, comm, axes=axes, told=told)
        if not overlap:
            check_no_penetration(scene, points)
    if scene.ties:
        ties = find_tied_points(scene, fixed, comm, axes=axes, told=told)
        if len(scene.ties) > 1:
            ties = tied_once(ties, scene, fixed, axes)
        if scene.sectors:
            from fenics_contact._pairing.sectors import check_held_alike, joined_around

            with together(comm):
                check_held_alike(ties, scene, fixed, axes)
            ties = joined_around(ties, ties, scene, areas=False)
            points = joined_around(points, ties, scene)
        if scene.contacts:
            points = without_tied(points, ties, scene, fixed, axes, told=told or comm.rank > 0)
    if len(scene.contacts) > 1:
        points = shared_once(points, scene, told=told or comm.rank > 0)
    if scene.preloads:
        with together(comm):
            points = once_at_sections(points, scene, tearing)
            sections = section_points(scene, ties, tearing, fixed, axes)
        ties = join_points([ties, sections], scene.components, tearing.n_nodes)
    if scene.springs:
        with together(comm):
            ends = spring_points(scene, tearing)
            if any(body.mesh.followers for body in scene.bodies.values()):
                from fenics_contact._pairing.following import means_on_masters

                ends = means_on_masters(ends, scene)
        ties = join_points([ties, ends], scene.components, tearing.n_nodes)
    return points, ties


def check_apart(scene: Scene, decomposition: Decomposition) -> None:
    """Search for contact and reject bodies that overlap at the start. Collective."""
    if scene.contacts:
        fixed, axes = decomposition.fixed, decomposition.axes
        points = find_contact_points(scene, fixed, decomposition.comm, axes=axes, told=True)
        check_no_penetration(scene, points)


_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class FluidLoad:
    """What fluid between surfaces exerts.

    Attributes:
        load: On this rank's torn dofs, shape (torn_size,), [force].
        wet: Contact points where it is, replicated, shape (n_contact,).
        pressure: Its pressure at each of them, zero where it is not, shape (n_contact,), [force / length²].
    """

    load: np.ndarray
    wet: np.ndarray
    pressure: np.ndarray


@displayed
@dataclass(frozen=True)
class TornSystem:
    """min ½ uᵀK u − fᵀu + Σ Ψ_i ‖T_i u‖ subject to B_E u = c_E, B_N u ≤ c_N, distributed over ranks.

    Rows of B are numbered: gluing and Dirichlet rows, rows of ties, normal rows (one per contact point),
    tangential rows (dim − 1 per frictional point).

    Attributes:
        scene: The scene with the geometry of this system.
        decomposition: The part that does not depend on the geometry.
        subdomains: This rank's subdomains with their matrices.
        points: Contact points, replicated.
        ties: Points of the ties, replicated.
        n_equality: Number of gluing, Dirichlet and tie rows of all ranks.
        frictional: Numbers of the contact points with friction, replicated, shape (n_friction,).
        friction_coefficient: μ of each frictional point (zero under Tresca), replicated, shape (n_friction,).
        tresca_bound: Fixed slip bound of each frictional point, replicated, shape (n_friction,), [force].
        strengths: Slip bounds with limits or on curves in place of μ λ_N, whose μ is then the largest ratio,
            replicated; None where there are none.
        closures: Closures of the contact points under their forces, replicated; None where contact is exact.
        elastic_slip: Slip of sticking points per friction force, replicated, shape (n_friction,), [length /
            force]; None where there is none.
        numbering: Owners and exchange of multipliers.
        relations: The relative displacements in the rows of ties and contacts, in their order, replicated.
        B: This rank's part of B, shape (n_local_rows, torn_size); rows of ties and contacts act on free
            components only.
        supported: Contribution of prescribed displacements to the owned rows of ties and contacts, shape
            (n_owned,), zero on other rows, [length].
        right: c of the owned rows less the contribution of supports, shape (n_owned,), [length].
        slid: Tangential displacement of the points without friction, which have no such rows, at the origin
            of slip, replicated, shape (n_contact − n_friction, dim − 1), [length].
        fluid: Load and place of fluid between surfaces; None without any.
        springs: Springs between surfaces, the last rows of ties; None without any.
        constraints: Linear constraints, whose rows come after those of ties; None without any.
        free: The free motions of rigid surfaces and unknown shortenings of preloads, which add Q q to c.
    """

    scene: Scene
    decomposition: Decomposition
    subdomains: tuple[Subdomain, ...]
    points: ContactPoints
    ties: ContactPoints
    n_equality: int
    frictional: np.ndarray
    friction_coefficient: np.ndarray
    tresca_bound: np.ndarray
    strengths: Strengths | None
    closures: Closures | None
    elastic_slip: np.ndarray | None
    numbering: DualNumbering
    relations: tuple[Relations, ...]
    B: sp.csr_matrix
    supported: np.ndarray
    right: np.ndarray
    slid: np.ndarray
    free: FreeMotions
    fluid: FluidLoad | None = None
    springs: SpringRows | None = None
    constraints: ConstraintRows | None = None

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
        # Sections lie in the last rows of ties that do not give way.
        rows = self.numbering.owned < (self.first_sprung if self.scene.preloads else self.n_gluing)
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
        relative, compliance = self.relative(displacement), self.compliance
        if compliance is not None:
            relative = relative - compliance.given_way(multiplier)
        return np.where(sticks, self.right + self.supported, relative), self.sliding(displacement)

    def with_slip_from(self, relative: np.ndarray, slid: np.ndarray) -> TornSystem:
        """Return the system in which slip is measured from an earlier displacement.

        Args:
            relative: Its value of `relative`, owned, shape (n_owned,), [length].
            slid: Its value of `sliding`, replicated, shape (n_contact − n_friction, dim − 1), [length].
        """
        tangential = self.numbering.owned >= self.n_equality + self.points.count
        right = np.where(tangential, relative - self.supported, self.right)
        return replace(self, right=right, slid=slid)

    def of_ties(self, columns: sp.csr_matrix) -> sp.csr_matrix:
        """Return the owned rows of a matrix with a row for each row of ties, zero on other rows."""
        rows = self.numbering.owned - self.n_gluing
        here = (rows >= 0) & (rows < columns.shape[0])
        chosen = sp.csr_matrix(
            (np.ones(here.sum()), (np.flatnonzero(here), rows[here])), shape=(len(rows), columns.shape[0])
        )
        return (chosen @ columns).tocsr()

    @property
    def frictionless(self) -> np.ndarray:
        """Numbers of the contact points without friction, shape (n_contact − n_friction,)."""
        return np.setdiff1d(np.arange(self.points.count), self.frictional, assume_unique=True)

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
        supported = np.concatenate([relation.of_supports(change) for relation in self.measured])
        supported = np.concatenate([np.zeros(self.n_gluing), supported])
        right = -supported
        right[: self.n_gluing] = change.ravel()[self.decomposition.gluing.dof]
        owned = self.numbering.owned
        return replace(self, right=self.right + right[owned], supported=self.supported + supported[owned])

    def sliding(self, displacement: np.ndarray) -> np.ndarray:
        """Return the tangential displacement of points without friction, [length]. Collective.

        Args:
            displacement: Torn displacement of this rank, shape (torn_size,), [length].

        Returns:
            Shape (n_contact − n_friction, dim − 1), replicated.
        """
        chosen = self.frictionless
        jump = self.points.jump[chosen]
        nodes = np.unique(jump.indices)
        relative = jump[:, nodes] @ nodal_mean_at(self.decomposition, displacement, nodes)
        return np.asarray(np.einsum("nad,nd->na", self.points.tangents[chosen], relative))

    def driven_as(self, prescribed: np.ndarray) -> bool:
        """Return whether supports drive the same frictional points as in this system.

        Args:
            prescribed: Prescribed components of all nodes, NaN where free, shape (n_nodes, dim).
        """
        rows = self.relations[2]
        return rows.resting is not None and np.array_equal(rows.of_supports(prescribed) == 0.0, rows.resting)

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
        change = np.zeros(int(self.n_equality + self.points.count + self.tangential_rows.size))
        change[self.normal_rows] = gap - self.points.gap
        points = replace(self.points, gap=gap)
        return replace(self, points=points, right=self.right + change[self.numbering.owned])

    @property
    def components(self) -> int:
        """Displacement components of a node."""
        return self.decomposition.tearing.components

    @property
    def n_gluing(self) -> int:
        """Number of gluing and Dirichlet rows of all ranks."""
        return self.decomposition.gluing.rows.count

    @property
    def first_sprung(self) -> int:
        """Number of the first row of springs."""
        return self.after_ties - (0 if self.springs is None else self.springs.count)

    @property
    def after_ties(self) -> int:
        """Number of the first row of constraints, behind those of ties, sections and springs."""
        return self.n_gluing + self.relations[0].count

    @property
    def measured(self) -> tuple[Measured, ...]:
        """What all rows but gluing ones measure, in their order."""
        tied, normal, slips = self.relations
        return (tied, *(() if self.constraints is None else (self.constraints,)), normal, slips)

    @cached_property
    def give(self) -> np.ndarray | None:
        """C of rows of springs, zero on others, owned, (n_owned,), [length / force]; None without any."""
        if self.springs is None:
            return None
        result = np.zeros(len(self.numbering.owned))
        place = self.numbering.owned_index(np.arange(self.first_sprung, self.after_ties))
        result[place[place >= 0]] = self.springs.compliance[place >= 0]
        return result

    @property
    def normal_rows(self) -> np.ndarray:
        """Row number of every contact point's normal multiplier, shape (n_contact,)."""
        return self.n_equality + np.arange(self.points.count)

    @property
    def tangential_rows(self) -> np.ndarray:
        """Row numbers of every frictional point's tangential multipliers, shape (n_friction, dim - 1)."""
        start, width = self.n_equality + self.points.count, self.components - 1
        return start + np.arange(width * len(self.frictional)).reshape(-1, width)

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
        discs, layout, coefficient = self.owned_discs, self.layout, self.friction_coefficient
        if not np.any(coefficient > 0):
            return TrescaLaw(layout, self.tresca_bound[discs])
        strengths = None if self.strengths is None else self.strengths.part(discs)
        return CoulombLaw(layout, coefficient[discs], self.tresca_bound[discs], strengths)

    @property
    def compliance(self) -> Compliance | None:
        """By how much this rank's contact rows give way; None where none does."""
        if self.closures is None and self.elastic_slip is None:
            return None
        from fenics_contact.qp.compliance import Closures, Compliance  # of no use in exact contact

        owned, discs = self.numbering.owned_index(self.normal_rows) >= 0, self.owned_discs
        closures = self.closures or Closures.exact(self.points.area)
        slip = np.zeros(len(discs)) if self.elastic_slip is None else self.elastic_slip[discs]
        return Compliance(self.layout, closures.part(owned), slip)

    @property
    def reach(self) -> np.ndarray | float:
        """Distances of the contact points at which pressure begins, shape (n_contact,); zero by default."""
        return 0.0 if self.closures is None else reach_of(self.scene, self.points)

    def slip_bound(self, normal_force: np.ndarray) -> np.ndarray:
        """Return Ψ at normal forces of the frictional points, shape (n_friction,), [force]."""
        if self.strengths is not None:
            return self.tresca_bound + self.strengths.bound(normal_force)
        return np.asarray(self.tresca_bound + self.friction_coefficient * np.maximum(normal_force, 0))

    @property
    def load(self) -> np.ndarray:
        """This rank's torn load f, shape (torn_size,), [force]."""
        load = np.concatenate([subdomain.load for subdomain in self.subdomains])
        return load if self.fluid is None else load + self.fluid.load

    def with_fluid(self, pressure: np.ndarray, wet: np.ndarray) -> TornSystem:
        """Return the system with fluid that presses surfaces apart as normal forces do. Collective.

        `pressure`: at each contact point, shape (n_contact,), [force / length²]; `wet`: where it is,
        (n_contact,).
        """
        force = np.zeros(len(self.numbering.owned))
        place = self.numbering.owned_index(self.normal_rows)
        force[place[place >= 0]] = (pressure * self.points.area)[place >= 0]
        free = self.free
        if free.count:  # it presses tools that are free to move, too
            on_points = np.asarray(self.numbering.comm.allreduce(free.columns.T @ force))
            free = replace(free, load=free.load + on_points)
        return replace(self, fluid=FluidLoad(-self.force(force), wet, pressure), free=free)


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
    with together(comm):
        prescribed, _ = prescribed_along(scene, decomposition.tearing)
        free = free_motions(scene, decomposition.tearing)
    alike = previous if previous is not None and _meets_alike(scene, decomposition, previous) else None
    if alike is not None and alike.driven_as(prescribed):
        # Only loads and prescribed values changed: B stays the same object, which marks F as unchanged, too.
        system = replace(alike, scene=scene, subdomains=subdomains, fluid=None)
    else:
        system = _joined(scene, decomposition, subdomains, overlap, previous, prescribed)
    return _with_right_sides(system, prescribed, free)


def with_points(torn: TornSystem, points: ContactPoints) -> TornSystem:
    """Return a system without fluid in which slip begins anew, with other contact points. Collective."""
    if points is torn.points:
        return torn
    scene, decomposition = torn.scene, torn.decomposition
    prescribed, _ = prescribed_along(scene, decomposition.tearing)
    system = _with_rows(
        scene, decomposition, torn.subdomains, (points, torn.ties), torn.numbering, prescribed,
        constraints=torn.constraints,
    )  # fmt: skip
    return _with_right_sides(system, prescribed, free_motions(scene, decomposition.tearing))


def with_points_inside(torn: TornSystem, other: TornSystem) -> TornSystem:
    """Return a system with points inside facets where another one has them. Collective."""
    return torn if other.points.are_at_nodes else with_points(torn, other.points)


def _with_right_sides(system: TornSystem, prescribed: np.ndarray, free: FreeMotions) -> TornSystem:
    """Return a system with what its rows measure at rest and under supports. Collective."""
    scene, decomposition, comm = system.scene, system.decomposition, system.decomposition.comm
    glued = decomposition.gluing.right_side(prescribed, decomposition.axes)
    with together(comm):
        soft = None if system.closures is None else system.closures.curve >= 0
        gap = gap_with_room(system.relations[1], decomposition.fixed, prescribed, soft) - system.reach
    supported = np.concatenate([relation.of_supports(prescribed) for relation in system.measured])
    tied, slip = np.zeros(system.relations[0].count), np.zeros(system.tangential_rows.size)
    supported = np.concatenate([np.zeros(len(glued)), supported])
    owned = system.numbering.owned
    if scene.preloads:
        drawn = shortening_columns(scene, system.relations[0])
        tied = drawn @ given_shortenings(scene)
    if system.springs is not None:
        tied[len(tied) - system.springs.count :] = system.springs.right
    if system.constraints is not None:
        with together(comm):
            system.constraints.require_consistent(scene.constraints, prescribed, free.columns)
        tied = np.concatenate([tied, system.constraints.right(scene.constraints)])
    right = np.concatenate([glued, tied, gap, slip]) - supported
    slid = np.zeros((len(system.frictionless), system.components - 1))
    if free.count:
        columns = free.of_rows(decomposition.gluing.dof, system.measured)
        with together(comm):
            columns = without_held(columns, system.measured, decomposition.fixed)
        free = replace(free, columns=columns[owned])
    else:
        free = replace(free, columns=sp.csr_matrix((len(owned), 0)))
    if scene.preloads:
        free = with_shortenings(free, scene, system.of_ties(drawn))
    return replace(system, supported=supported[owned], right=right[owned], slid=slid, free=free)


def _meets_alike(scene: Scene, decomposition: Decomposition, known: TornSystem) -> bool:
    """Return whether two scenes have the same meshes, pairs and held components, whatever fluid is there."""
    rest = [
        [*each.ties, *each.springs, *(c.key for c in each.constraints), *(p.key for p in each.preloads)]
        for each in (scene, known.scene)
    ]
    same = scene.has_meshes_of(known.scene) and known.decomposition is decomposition
    return same and known.points.are_at_nodes and rest[0] == rest[1] and contacts_alike(scene, known.scene)


def contacts_alike(scene: Scene, other: Scene) -> bool:
    """Return whether two scenes have the same contact pairs, whatever fluid is in them."""
    pairs = [
        [c if c.fluid is None else replace(c, fluid=None) for c in each.contacts] for each in (scene, other)
    ]
    return pairs[0] == pairs[1]


def _joined(
    scene: Scene,
    decomposition: Decomposition,
    subdomains: tuple[Subdomain, ...],
    overlap: bool,
    previous: TornSystem | None,
    prescribed: np.ndarray,
) -> TornSystem:
    """Search for contact and build B; the right side is left empty. Collective."""
    told = previous is not None and previous.scene.has_surfaces_of(scene)
    met = meeting_points(scene, decomposition, overlap=overlap, told=told)
    known = None if previous is None else previous.numbering
    kept = constraint_rows(scene, decomposition, None if previous is None else previous.constraints)
    if kept is not None:
        from fenics_contact.feti.periodic import once_at_periodic_edges

        with together(decomposition.comm):
            points, ties = met
            ties = once_at_periodic_edges(ties, kept, scene, prescribed, areas=False)
            met = once_at_periodic_edges(points, kept, scene, prescribed), ties
    system = _with_rows(scene, decomposition, subdomains, met, known, prescribed, constraints=kept)
    if decomposition.comm.rank == 0:
        _log_held(system.relations[2], decomposition.fixed)
    return system


def meeting_at(
    torn: TornSystem,
    points: ContactPoints,
    prescribed: np.ndarray,
    further: Sequence[tuple[Rows, sp.csr_matrix]] = (),
) -> TornSystem:
    """Return a system with other contact points, those of bodies that have moved. Collective.

    `prescribed`: prescribed components of all nodes, NaN where free, shape (n_nodes, dim); `further`: rows
    after all others, with their columns on all components of nodes, shape (n_nodes · dim, n).
    """
    ties, known = torn.ties, torn.numbering
    system = _with_rows(
        torn.scene, torn.decomposition, torn.subdomains, (points, ties), known, prescribed,
        [rows for rows, _ in further], torn.constraints,
    )  # fmt: skip
    owned = system.numbering.owned
    right, supported = np.zeros((2, len(owned)))
    equality = owned < torn.n_equality  # each rank owns the same of these
    right[equality] = torn.right[torn.numbering.owned < torn.n_equality]
    supported[equality] = torn.supported[torn.numbering.owned < torn.n_equality]
    normal = (owned >= torn.n_equality) & (owned < torn.n_equality + points.count)
    right[normal] = points.gap[owned[normal] - torn.n_equality]
    slid = np.zeros((len(system.frictionless), system.components - 1))
    there = np.flatnonzero(torn.numbering.owned < torn.n_equality)
    entries = np.ones(len(there)), (np.flatnonzero(equality), there)
    rows = sp.csr_matrix(entries, shape=(len(owned), len(torn.numbering.owned)))
    columns = sp.hstack([each for _, each in further], format="csr") if further else None
    free = torn.free.met_anew(rows, torn.n_equality, system.relations[1:], columns, owned)
    return replace(system, right=right, supported=supported, slid=slid, free=free)


def _with_rows(
    scene: Scene,
    decomposition: Decomposition,
    subdomains: tuple[Subdomain, ...],
    met: tuple[ContactPoints, ContactPoints],
    known: DualNumbering | None,
    prescribed: np.ndarray,
    further: Sequence[Rows] = (),
    constraints: ConstraintRows | None = None,
) -> TornSystem:
    """Build B for contact points and tied ones; the right side is left empty. Collective."""
    points, ties = met
    has_friction, coefficient, tresca, strengths = friction_data(scene, points, decomposition.comm)
    frictional, elastic = np.flatnonzero(has_friction), elastic_slip(scene, points)
    gluing, tearing, fixed = decomposition.gluing.rows, decomposition.tearing, decomposition.fixed
    axes = decomposition.axes
    tied = tied_relations(ties, scene.ties, fixed, axes)
    springs = SpringRows.of(scene) if scene.springs else None
    tied = tied if springs is None else with_springs(tied, springs)
    slips = tangential_relations(points, frictional, prescribed, axes)
    relations = (tied, normal_relations(points, axes), slips)
    parts = [relation.rows(tearing, fixed) for relation in relations]
    parts[1:1] = [] if constraints is None else [constraints.rows(tearing)]
    equality = sum(part.count for part in (gluing, *parts[:-2]))
    rows = stack([gluing, *parts, *further])
    numbering, B = _own_part(rows, decomposition, known)
    return TornSystem(
        scene, decomposition, subdomains, points, ties, equality, frictional,
        coefficient[frictional], tresca[frictional],
        None if strengths is None else strengths.part(frictional), closures_of(scene, points),
        None if elastic is None else elastic[frictional], numbering, relations, B,
        np.zeros(0), np.zeros(0), np.zeros((0, scene.components - 1)), NO_MOTIONS, springs=springs,
        constraints=constraints,
    )  # fmt: skip


def _log_held(rows: Relations, fixed: np.ndarray) -> None:
    held = int(rows.held(fixed).sum())
    if held:
        words = "%d of %d friction rows are left to the supports, which hold slip there"
        safe_log(_LOG.info, words, held, rows.count)


def _own_part(
    rows: Rows, decomposition: Decomposition, known: DualNumbering | None
) -> tuple[DualNumbering, sp.csr_matrix]:
    """Number the multipliers and select the entries of B that act on this rank's subdomains. Collective."""
    block = decomposition.copy_block[rows.copy]
    here = block >= 0
    row, column = rows.row[here], decomposition.tearing.components * block[here] + rows.component[here]
    touched, comm = np.unique(row), decomposition.comm
    # The communication pattern is reused as long as no rank's share of the rows changes.
    stays = known is not None and known.serves(rows.owner, touched)
    if comm.allreduce(int(not stays)) or known is None:
        known = DualNumbering(comm, rows.owner, touched)
    shape = (len(known.local_rows), decomposition.torn_size)
    return known, sp.csr_matrix((rows.value[here], (known.local_index(row), column)), shape=shape)
