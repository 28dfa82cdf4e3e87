"""The equilibrium of a torn system with nonlinear materials: its relative residuals and its linearisation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.display import displayed
from fenics_contact._base.progress import PhaseTimer
from fenics_contact._fem.composition import composition
from fenics_contact._fem.kinematics import least_of_cubics
from fenics_contact._fem.mechanics import MaterialStep, Mechanics, Response
from fenics_contact._large_deformations.loading import DeadLoads, Loading, RigidStart
from fenics_contact._large_deformations.moving_contact import (
    NO_ROWS,
    AuxiliaryRows,
    Contact,
    ContactConfiguration,
    MovingContact,
    SymmetricLowRank,
    stiffened,
)
from fenics_contact._large_deformations.rigid_surfaces import (
    Motions,
    TurnedSurface,
    placed,
    spring_columns,
    tracked_stiffness,
)
from fenics_contact._large_deformations.tangent import TangentOperator, TangentSystem, linearised
from fenics_contact._large_deformations.tangent_step import TangentProblem
from fenics_contact._scene.scene import Scene
from fenics_contact.errors import ConvergenceError, together
from fenics_contact.feti.decomposition import Decomposition
from fenics_contact.feti.subdomain import SubdomainMesh, foundation_of
from fenics_contact.feti.torn import TornSystem
from fenics_contact.qp.reductions import Vector, global_max, global_min, global_sum
from fenics_contact.qp.solution import Residuals, contact_step

#: Forces below this fraction of those that would strain bodies by their displacement are none.
FORCE_FLOOR = 1e-4
#: Rounding of strains and of positions, relative to one and to the size of a body.
ROUNDED = 4.0 * float(np.finfo(float).eps)


def beyond(values: Vector, rounding: float | Vector) -> Vector:
    """Return how far values, of either sign, are beyond rounding."""
    return np.asarray(np.sign(values) * np.maximum(np.abs(values) - rounding, 0.0))


def relative_residuals(
    torn: TornSystem,
    natural: Vector,
    violation: float,
    forces: tuple[Vector, Vector, Vector, Vector],
    constraint_residual: Vector,
    displacement: Vector,
    largest: float,
    stiff: float,
    reach: float,
) -> Residuals:
    """Return the relative residuals of a configuration: forces out of balance as `coarse`. Collective.

    ``natural`` is λ − P(λ − ρ r), owned; ``forces`` are those out of balance, internal ones, Bᵀλ and loads,
    torn; small displacements are compared with the ``largest`` on the way, and none is worth more than a way
    as long as the ``reach`` of all bodies: those that nothing holds would be in balance far away.
    """
    comm, contact = torn.numbering.comm, torn.numbering.owned >= torn.n_equality
    lengths = displacement, constraint_residual[~contact], torn.right[~contact]
    squares = (x @ x for x in (*forces, *lengths, natural[contact]))
    *sums, count = global_sum(comm, *squares, len(displacement))
    unbalanced, internal, bound, load, moved, open_, given, wrong = np.sqrt(sums)
    moved = min(max(moved, given, largest), reach * np.sqrt(count))
    floor = FORCE_FLOOR * stiff * moved / np.sqrt(count)
    # Before anything acts, what is to act is all there is: a tool in a body at rest is no equilibrium.
    force = max(min(internal, bound) if internal > 0 else bound, load, floor) or max(unbalanced, wrong)
    ratio = 1.0 / force if force > 0.0 else 0.0
    return Residuals(
        wrong * ratio,
        open_ / moved if moved > 0.0 else 0.0,
        unbalanced * ratio,
        global_max(comm, violation) * ratio,
        force,
        moved,
    )


@displayed
@dataclass(frozen=True, eq=False)
class Configuration:
    """A displacement with the forces and the histories of materials that belong to it.

    `multiplier`: λ, owned; `largest`: size of the largest displacement that
    there has been, as in `Residuals.gluing_scale`: where bodies return to rest, residuals are relative to
    that; `diagonal`: of F on these rows, at a configuration near this one, owned; None where it is not known;
    `motions`: U, then θ, of rigid surfaces; zero where they are not among them; `contact`: the contact points
    whose rows the multiplier has.
    """

    displacement: Vector
    multiplier: Vector
    history: tuple[np.ndarray | None, ...]
    time: float
    largest: float
    contact: ContactConfiguration
    diagonal: Vector | None = None
    motions: Motions = field(default_factory=dict)

    def natural_step(self, caution: float = 1.0) -> Vector:
        """Return ρ of the natural map, owned, times a factor; zero where the diagonal of F is not known."""
        layout = self.contact.torn.layout
        if self.diagonal is None:
            return np.zeros(layout.size)
        return caution * contact_step(layout, self.diagonal)

    def on(self, contact: ContactConfiguration) -> Configuration:
        """Return the configuration with its forces on the rows of other contact points. Collective."""
        diagonal = self.diagonal
        if diagonal is not None:
            diagonal = contact.spread(diagonal, self.contact)
        forces = contact.carried(self.multiplier, self.contact)
        return replace(self, multiplier=forces, diagonal=diagonal, contact=contact)


@displayed
@dataclass(frozen=True, eq=False)
class ResidualState:
    """The equations at a configuration, under a load.

    `at`: the configuration; its history and its time are those before the load step; `growth`: that of loads
    with u; `unbalanced`: f(u) − f_int(u) − Bᵀλ of this rank, torn;
    `constraint_residual`: c − B u, owned: gaps, minus the slip, and openings of glued rows; `least_jacobian`:
    smallest det F of all bodies; 1 where none is strained much.
    """

    equations: Equations
    load: Loading
    at: Configuration
    responses: tuple[Response, ...]
    external: Vector
    growth: DeadLoads
    unbalanced: Vector
    constraint_residual: Vector
    residuals: Residuals
    least_jacobian: float

    def evaluate(
        self,
        displacement: Vector,
        multiplier: Vector,
        caution: float = 1.0,
        motions: Motions | None = None,
    ) -> ResidualState:
        """Return the equations after a Newton step from here, given λ on the present rows. Collective."""
        at = replace(
            self.at, displacement=displacement, multiplier=multiplier, motions=motions or self.at.motions
        )
        return self.equations.evaluate(self.load, at, caution, self.at.displacement)

    @property
    def contact(self) -> ContactConfiguration:
        """The contact points, with the system of their rows."""
        return self.at.contact

    @property
    def friction_work(self) -> float:
        """Work of friction Σ τ·slip since histories began their step, [force · length]. Collective."""
        _, friction = self.contact.at_points(self.at.multiplier)
        _, against = self.contact.at_points(self.constraint_residual)
        work = -float(np.sum(friction * against))
        slips = self.torn.groups.slips
        squares = np.sum(friction[slips.frictional] ** 2, axis=1)
        return work - float(slips.elastic_slip @ squares)

    @property
    def torn(self) -> TornSystem:
        """The system with load, supports and the rows of the contact points."""
        return self.contact.torn

    @property
    def loaded(self) -> TornSystem:
        """The system with the load as it is on the deformed bodies."""
        each = zip(self.torn.subdomains, self.torn.decomposition.parts, strict=True)
        subdomains = tuple(replace(subdomain, load=self.external[part]) for subdomain, part in each)
        return replace(self.torn, subdomains=subdomains)

    @property
    def history(self) -> tuple[np.ndarray | None, ...]:
        """Internal variables after the displacement, of each subdomain."""
        return tuple(response.history for response in self.responses)

    @property
    def _tangents(self) -> list[sp.csr_matrix]:
        """Growth of the internal forces with the displacement, less that of the loads, by subdomain.

        That of the loads is made symmetric; for the other part there are `passed_on` and rows of its own.
        """
        tangents = [response.stiffness for response in self.responses]
        return self.growth.taken_from(tangents, self.torn.decomposition)

    def _require_finite_tangents(self) -> None:
        """Reject tangents with NaN or infinity, which no factorisation survives. Collective."""
        with together(self.torn.numbering.comm):
            parts = zip(self.torn.subdomains, self.responses, strict=True)
            bad = {s.mesh.body for s, response in parts if not np.isfinite(response.stiffness.data).all()}
            if bad:
                raise ConvergenceError(
                    f"tangents must be finite, got NaN or infinity in body {min(bad)!r} at a smallest det F "
                    f"of {self.least_jacobian:.2g}: take smaller load steps, or check its energy or stress"
                )

    def linearised(self, timer: PhaseTimer, known: Linearisation | None) -> Linearisation:
        """Factor the tangents, with those of springs of tools. Collective."""
        sprung = self.load.turned if self.load.is_tracked else ()
        return self._factored(timer, {} if known is None else known.system.operators, sprung)

    def linearised_without_springs(self, timer: PhaseTimer) -> Linearisation:
        """Factor the tangents without those of springs of tools. Collective."""
        return self._factored(timer, {}, ())

    def _factored(
        self, timer: PhaseTimer, earlier: Mapping[int, TangentOperator], sprung: Sequence[TurnedSurface]
    ) -> Linearisation:
        self._require_finite_tangents()
        uneven = self.growth.unsymmetric(self.torn.decomposition, self.load.rim | self.contact.acting.rim)
        held = SymmetricLowRank(*spring_columns(sprung, self.contact.prescribed.size))
        turning = self.contact.turning(self.at.multiplier, uneven, held)
        torn, further = self.torn, NO_ROWS
        tangents = stiffened(torn, self._tangents, turning)
        if turning.count:
            torn = self.contact.with_rows_of(turning)
            further = AuxiliaryRows.of(torn, self.torn, turning)
        right = np.concatenate([self.constraint_residual, np.zeros(further.count)])
        if torn.free.count:
            load, stiffness = self.torn.free_imbalance(self.at.multiplier), None
            if self.torn.free.tracked:
                stiffness = tracked_stiffness(self.load.turned, self.torn, self.at.multiplier)
            torn = replace(torn, free=replace(torn.free, load=load, stiffness=stiffness))
        increments = linearised(torn, self.at.displacement, tangents, self.unbalanced, right)
        diagonal = self.at.diagonal
        if diagonal is not None:
            diagonal = np.concatenate([diagonal, np.ones(further.count)])
        by_stress = {
            subdomain.mesh.number: response.by_stress
            for subdomain, response in zip(torn.subdomains, self.responses, strict=True)
            if response.by_stress is not None
        }
        system = TangentSystem(increments, timer, diagonal=diagonal, earlier=earlier, by_stress=by_stress)
        return Linearisation(system, further)


@displayed
@dataclass(frozen=True, eq=False)
class Linearisation:
    """Factored tangents, with rows for the stiffness of forces that turn with their surfaces.

    `system`: the factored system; rows of turning forces come after all others.
    """

    system: TangentSystem
    further: AuxiliaryRows

    def release_factors(self) -> None:
        """Hand the factorisation to the next linearisation; do not use this one afterwards."""
        for operator in self.system.inverse.tangents:
            operator.release_factors()

    def of(self, evaluation: ResidualState) -> ResidualState:
        """Return the equations that were linearised with the diagonal of F that is known since."""
        diagonal = self.system.problem.diagonal[: len(evaluation.constraint_residual)]
        return replace(evaluation, at=replace(evaluation.at, diagonal=diagonal))

    def problem(self, evaluation: ResidualState) -> TangentProblem:
        """Return the problem of one Newton step from the configuration of the linearisation."""
        nothing, stiff = np.zeros(self.further.count), evaluation.equations.stiffness
        return TangentProblem(
            self.system.problem.with_law(self.system.torn.law),
            self.system.stiffness,
            np.concatenate([evaluation.at.multiplier, nothing]),
            np.concatenate([evaluation.constraint_residual, nothing]),
            self.further,
            1.0 / stiff if stiff > 0.0 else 1.0,
        )


@displayed
class Equations:
    """Internal forces of the bodies of a scene, with fixed meshes and numbering, and their contact."""

    def __init__(self, scene: Scene, decomposition: Decomposition) -> None:
        """Bind the forms of every subdomain, and prepare the surfaces of contact pairs. Collective."""
        self.decomposition, self.rigid_start = decomposition, RigidStart(scene, decomposition)
        forms = decomposition.forms
        forms.prepare_mechanics(scene)
        with together(decomposition.comm):
            self._mechanics = tuple(self._of(scene, number) for number in range(len(decomposition.meshes)))
        meshes = [body.mesh for body in scene.bodies.values()]
        moves = bool(scene.contacts) and scene.deforms_much
        self._beds = self._foundations(scene)
        self.contact = MovingContact(scene, decomposition) if moves else Contact()
        self._reach = max(float(np.abs(mesh.points).max()) for mesh in meshes)
        self._cell = max(float(mesh.volume / mesh.n_cells) ** (1.0 / scene.dim) for mesh in meshes)

    def _of(self, scene: Scene, number: int) -> Mechanics:
        mesh = self.decomposition.meshes[number]
        body = scene.bodies[mesh.body]
        points = mesh.by_input_node(body.mesh.points[mesh.nodes])
        parts = composition(body, mesh.cells)
        forms = self.decomposition.forms
        return mesh.answering(forms.mechanics(parts, body.element, mesh.space, points))

    def _with_free(self, torn: TornSystem, unbalanced: Vector, multiplier: Vector) -> Vector:
        """Return forces out of balance, on the first rank with those at free motions. Collective."""
        if torn.free.count == 0:
            return unbalanced
        there = torn.free_imbalance(multiplier)
        return np.append(unbalanced, there) if self.decomposition.comm.rank == 0 else unbalanced

    def _foundations(self, scene: Scene) -> tuple[_NoBed, ...]:
        """Return the foundations under each subdomain."""
        beds = (foundation_of(m, scene.bodies[m.body], scene.foundations) for m in self.decomposition.meshes)
        return tuple(_Bed(bed) if bed.nnz else _NoBed() for bed in beds)

    def _facts(self) -> dict[str, object]:
        return {"subdomains": f"{len(self._mechanics)} on this rank"}

    @cached_property
    def stiffness(self) -> float:
        """The largest entry of the tangents' diagonals at rest, [force / length]. Collective on first use."""
        return global_max(self.decomposition.comm, float(self.diagonal.max(initial=0.0)))

    @cached_property
    def diagonal(self) -> Vector:
        """The tangents' diagonals at rest, of this rank, torn, [force / length]. Collective on first use."""
        sizes = [mesh.size for mesh in self.decomposition.meshes]
        with together(self.decomposition.comm):
            pairs = zip(self._mechanics, sizes, strict=True)
            step = MaterialStep(duration=1.0)
            at_rest = [m.at(np.zeros(size), step).stiffness.diagonal() for m, size in pairs]
        return np.concatenate([np.zeros(0), *at_rest])

    def at_rest(self, load: Loading) -> Configuration:
        """Return the undeformed configuration without forces, where slip begins under a load. Collective."""
        nothing, displacement = (None,) * len(self._mechanics), np.zeros(self.decomposition.torn_size)
        # Slip begins where bodies are before supports and obstacles move.
        contact = self.contact.first(load.at_motions({}), displacement)
        forces = np.zeros(len(contact.torn.numbering.owned))
        return Configuration(displacement, forces, nothing, 0.0, 0.0, contact)

    def least_jacobian(self, displacement: Vector, moved: Vector) -> float:
        """Return the smallest det F on the straight way from a torn displacement by another. Collective."""
        comm, least = self.decomposition.comm, np.inf
        with together(comm):
            for mechanics, part in zip(self._mechanics, self.decomposition.parts, strict=True):
                ways = [displacement[part] + third / 3.0 * moved[part] for third in range(4)]
                least = min(least, least_of_cubics(*map(mechanics.jacobians, ways)))
        return global_min(comm, least)

    def evaluate(
        self, load: Loading, near: Configuration, caution: float = 1.0, origin: Vector | None = None
    ) -> ResidualState:
        """Search for the contact points at a displacement, and evaluate the equations there. Collective.

        Multipliers have the rows of the contact points of ``near``; ``caution`` is a factor on ρ of the
        natural map, ``origin`` the displacement before the last Newton step.
        """
        load = load.at_motions(near.motions)
        near = replace(near, displacement=placed(load.turned, load.torn, near.displacement))
        contact = self.contact.at(load, near.displacement, near.contact)
        near = replace(near.on(contact), motions=load.motions)
        return self.evaluate_at(load, near, caution, origin)

    def evaluate_at(
        self, load: Loading, at: Configuration, caution: float = 1.0, origin: Vector | None = None
    ) -> ResidualState:
        """Return forces, openings and residuals at contact points that are known. Collective."""
        comm, contact = self.decomposition.comm, at.contact
        torn = contact.torn
        with together(comm):
            each = zip(self._mechanics, self.decomposition.parts, at.history, strict=True)
            duration = load.time - at.time
            before = (None if origin is None else origin[part] for part in self.decomposition.parts)
            heat = load.heat or (None,) * len(self._mechanics)
            responses = tuple(
                m.at(at.displacement[part], MaterialStep(history, duration, start, warmer))
                for (m, part, history), start, warmer in zip(each, before, heat, strict=True)
            )
            moved = (at.displacement[part] for part in self.decomposition.parts)
            each_bed = zip(self._beds, responses, moved, strict=True)
            responses = tuple(bed.under(response, own) for bed, response, own in each_bed)
            external, growth = contact.acting.added(*load.at(at.displacement), at.displacement)
            responses = tuple(map(_following, responses, self.decomposition.meshes))
            external = self.decomposition.on_followed(external)
            growth = growth.followed(self.decomposition)
        internal = np.concatenate([np.zeros(0), *(response.force for response in responses)])
        bound = torn.B.T @ torn.numbering.to_local(at.multiplier)
        acting = external + torn.fluid.load
        # What is no more than rounding of strains and of positions is none.
        unbalanced = beyond(acting - internal - bound, ROUNDED * self.stiffness * self._cell)
        least = global_min(comm, min((r.least_jacobian for r in responses), default=1.0))
        open_ = contact.constraint_residual(at.displacement)
        open_ = torn.compliance.added(open_, at.multiplier)
        step, feasible = at.natural_step(caution), torn.law.feasible(at.multiplier)
        mapped = torn.compliance.contact.resolve(feasible, at.multiplier - step * open_, step)
        natural = beyond(at.multiplier - mapped, ROUNDED * self._reach * step)
        forces = self._with_free(torn, unbalanced, at.multiplier), internal, bound, acting
        residuals = relative_residuals(
            torn, natural, feasible.violation(at.multiplier), forces, open_, at.displacement, at.largest,
            self.stiffness, self._reach,
        )  # fmt: skip
        return ResidualState(self, load, at, responses, external, growth, unbalanced, open_, residuals, least)


def _following(response: Response, mesh: SubdomainMesh) -> Response:
    """Return a response to the displacement of nodes that do not hang."""
    following = mesh.following
    return replace(response, force=following.force(response.force)).with_matrices(following.stiffness)


class _NoBed:
    """No foundation under a subdomain."""

    def under(self, response: Response, displacement: Vector) -> Response:
        """Return a response with the springs of foundations, which stay as they are however far they move."""
        return response


@dataclass(frozen=True, eq=False)
class _Bed(_NoBed):
    """Foundations under a subdomain."""

    stiffness: sp.csr_matrix

    def under(self, response: Response, displacement: Vector) -> Response:
        force = self.stiffness @ displacement
        energy = None if response.energy is None else response.energy + 0.5 * float(displacement @ force)
        return replace(
            response,
            force=response.force + force,
            tangent=lambda: (response.stiffness + self.stiffness).tocsr(),
            energy=energy,
        )
