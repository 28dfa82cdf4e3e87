"""The equilibrium of a torn system with nonlinear materials: its residuals and its linearisation."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from fenics_contact.display import displayed
from fenics_contact.errors import ConvergenceError, together
from fenics_contact.fem import Mechanics, Response, composition
from fenics_contact.feti import Decomposition, TornSystem
from fenics_contact.nonlinear.loading import Loading
from fenics_contact.nonlinear.meeting import Meeting
from fenics_contact.nonlinear.residuals import ROUNDED, Sizes, beyond
from fenics_contact.nonlinear.rigid_start import RigidStart
from fenics_contact.nonlinear.tangent_step import TangentProblem
from fenics_contact.nonlinear.tangent_system import TangentSystem, linearised
from fenics_contact.nonlinear.turning import NO_ROWS, FurtherRows, stiffened, unsymmetric_at, with_added
from fenics_contact.qp import (
    Residuals,
    SlipLaw,
    Vector,
    contact_step,
    global_max,
    global_min,
)
from fenics_contact.scene import Scene
from fenics_contact.timing import PhaseTimer


@displayed
@dataclass(frozen=True, eq=False)
class Configuration:
    """A displacement with the forces and the histories of materials that belong to it.

    Attributes:
        displacement: u of this rank, torn, shape (torn_size,), [length].
        multiplier: λ, owned, [force]; empty where nothing is known yet.
        history: Internal variables of each of this rank's subdomains; None without any.
        time: The time at which it was reached.
        largest: Size of the largest displacement that there has been, as in `Residuals.gluing_scale`: where
            bodies return to rest, residuals are relative to that.
        meeting: The contact points whose rows the multiplier has; None at the start.
    """

    displacement: Vector
    multiplier: Vector
    history: tuple[np.ndarray | None, ...]
    time: float
    largest: float
    meeting: Meeting | None

    def meeting_at(self, meeting: Meeting) -> Configuration:
        """Return the configuration with its forces on the rows of other contact points. Collective."""
        if self.meeting is None:
            multiplier: Vector = np.zeros(len(meeting.torn.numbering.owned))
        else:
            multiplier = meeting.carried(self.multiplier, self.meeting)
        return replace(self, multiplier=multiplier, meeting=meeting)


@displayed
@dataclass(frozen=True, eq=False)
class Evaluation:
    """The equations at a configuration.

    Attributes:
        meeting: The contact points, with the system of their rows.
        law: The law of friction there.
        at: The configuration.
        responses: Internal forces and tangents of this rank's subdomains.
        load: f(u) of this rank, torn, [force].
        softening: −∂f/∂u of this rank, torn; None where all loads are dead.
        rim: Marks of the nodes where neighbours do not balance the unsymmetric part of that, (n_nodes,).
        unbalanced: f(u) − f_int(u) − Bᵀλ of this rank, torn, [force].
        lacking: c − B u, owned, [length]: gaps, minus the slip, and openings of glued rows.
        residuals: Their size, relative.
        least_jacobian: Smallest det F of all bodies; 1 where none is strained much.
        stiff: Largest entry of the tangents' diagonals, [force / length].
    """

    meeting: Meeting
    law: SlipLaw
    at: Configuration
    responses: tuple[Response, ...]
    load: Vector
    softening: sp.csr_matrix | None
    rim: np.ndarray
    unbalanced: Vector
    lacking: Vector
    residuals: Residuals
    least_jacobian: float
    stiff: float

    @property
    def rubbing(self) -> float:
        """Work of friction Σ τ·slip since histories began their step, [force · length]. Collective."""
        _, friction = self.meeting.at_points(self.at.multiplier)
        _, against = self.meeting.at_points(self.lacking)
        return -float(np.sum(friction * against))

    @property
    def torn(self) -> TornSystem:
        """The system with load, supports and the rows of the contact points."""
        return self.meeting.torn

    @property
    def loaded(self) -> TornSystem:
        """The system with the load as it is on the deformed bodies."""
        each = zip(self.torn.subdomains, self.torn.decomposition.parts, strict=True)
        subdomains = tuple(replace(subdomain, load=self.load[part]) for subdomain, part in each)
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
        if self.softening is None:
            return tangents
        return with_added(self.torn.decomposition, tangents, (self.softening + self.softening.T) / 2)

    def _require_finite_tangents(self) -> None:
        """Reject tangents with NaN or infinity, which no factorisation survives. Collective."""
        with together(self.torn.numbering.comm):
            parts = zip(self.torn.subdomains, self.responses, strict=True)
            bad = {s.mesh.body for s, response in parts if not np.isfinite(response.stiffness.data).all()}
            if bad:
                raise ConvergenceError(
                    f"tangents must be finite, got NaN or infinity in body {min(bad)!r} at a smallest "
                    f"det F of {self.least_jacobian:.2g}: take smaller load steps, or check where the "
                    "energy or stress of its material has a derivative"
                )

    def passed_on(self, moved: Vector) -> Vector:
        """Return what neighbours and supports take of the unsymmetric part of the loads' growth. Collective.

        Args:
            moved: A change of the displacement of this rank, torn, shape (torn_size,), [length].

        Returns:
            Change of multipliers, owned, zero but in gluing rows and those of supports, [force].
        """
        torn = self.torn
        taken = np.zeros(len(self.lacking))
        if self.softening is None:
            return taken
        left = 0.5 * (self.softening.T - self.softening) @ moved
        flexibility = 1.0 / torn.decomposition.torn_stiffness
        # Of these rows B D⁻¹ Bᵀ is diagonal.
        size = torn.numbering.to_owned(torn.B.multiply(torn.B) @ flexibility)
        glued = torn.numbering.owned < torn.n_gluing
        taken[glued] = torn.jump(flexibility * left)[glued] / size[glued]
        return taken

    def linearised(self, timer: PhaseTimer, known: Linearisation | None) -> Linearisation:
        """Factor the tangents. Collective.

        Args:
            timer: Collects the wall time.
            known: That of a neighbouring configuration, or None.

        Raises:
            ConvergenceError: If the tangents are not finite, or have no factors.
        """
        self._require_finite_tangents()
        uneven = None
        if self.softening is not None:
            uneven = unsymmetric_at(self.torn.decomposition, self.softening, self.rim)
        turning = self.meeting.turning(self.at.multiplier, uneven)
        tangents = self._tangents
        torn, further = self.torn, NO_ROWS
        if turning is not None:
            if turning.normal is not None:
                tangents = stiffened(torn, tangents, turning.normal)
            if turning.count:
                torn = self.meeting.with_rows_of(turning)
                further = FurtherRows.of(torn, self.torn, turning)
        lacking = np.concatenate([self.lacking, np.zeros(further.count)])
        increments = linearised(torn, self.at.displacement, tangents, self.unbalanced, lacking)
        diagonal, operators = None, {}
        if known is not None:
            diagonal = self.meeting.carried(known.diagonal, known.meeting, spread=True)
            diagonal = np.concatenate([diagonal, np.ones(further.count)])
            operators = known.system.operators
        system = TangentSystem(increments, timer, diagonal=diagonal, earlier=operators)
        return Linearisation(system, self.meeting, further)


@displayed
@dataclass(frozen=True, eq=False)
class Linearisation:
    """Factored tangents, with rows for the stiffness of forces that turn with their surfaces.

    Attributes:
        system: The factored system; rows of turning forces come after all others.
        meeting: The contact points.
        further: The rows of turning forces.
    """

    system: TangentSystem
    meeting: Meeting
    further: FurtherRows

    def spend(self) -> None:
        """Leave the factors to the linearisation that comes next: this one is not applied any more."""
        for operator in self.system.inverse.tangents:
            operator.spend()

    @property
    def diagonal(self) -> Vector:
        """Of F on the rows of the meeting, owned."""
        return self.system.problem.diagonal[: len(self.meeting.torn.numbering.owned)]

    def natural_step(self, meeting: Meeting, caution: float) -> Vector:
        """Return ρ of the natural map on the rows of a meeting, owned, times a factor. Collective."""
        diagonal = meeting.carried(self.diagonal, self.meeting, spread=True)
        return caution * contact_step(meeting.torn.layout, diagonal)

    def problem(self, evaluation: Evaluation) -> TangentProblem:
        """Return the problem of one Newton step from the configuration of the linearisation."""
        nothing, further, torn = np.zeros(self.further.count), self.further, self.system.torn
        return TangentProblem(
            self.system.problem.with_law(torn.law),
            self.system.stiffness,
            np.concatenate([evaluation.at.multiplier, nothing]),
            np.concatenate([evaluation.lacking, nothing]),
            np.concatenate([np.zeros(len(evaluation.lacking)), further.compliance]),
            further.acting,
            further.felt,
            further.share,
            further.lacking,
            further.completed,
            np.ones(len(further.lacking)),
            1.0 / evaluation.stiff if evaluation.stiff > 0.0 else 1.0,
        )


@displayed
class Equations:
    """Internal forces of all bodies of a scene, whose meshes and numbering do not change.

    Attributes:
        decomposition: The subdomains.
        rigid_start: Moves bodies as their supports do.
    """

    def __init__(self, scene: Scene, decomposition: Decomposition) -> None:
        """Bind the forms of every subdomain. Collective."""
        self.decomposition, self.rigid_start = decomposition, RigidStart(scene, decomposition)
        forms = decomposition.forms
        forms.prepare_mechanics(scene)
        with together(decomposition.comm):
            self._mechanics = tuple(self._of(scene, number) for number in range(len(decomposition.meshes)))
        meshes = [body.mesh for body in scene.bodies.values()]
        self._reach = max(float(np.abs(mesh.points).max()) for mesh in meshes)
        self._cell = max(float(mesh.volume / mesh.n_cells) ** (1.0 / scene.dim) for mesh in meshes)

    def _of(self, scene: Scene, number: int) -> Mechanics:
        mesh = self.decomposition.meshes[number]
        body = scene.bodies[mesh.body]
        points = body.mesh.points[np.sort(mesh.nodes)]
        parts = composition(body, mesh.cells)
        return self.decomposition.forms.mechanics(parts, body.mesh.cell_type, mesh.space, points)

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
            at_rest = [m.at(np.zeros(size), duration=1.0).stiffness.diagonal() for m, size in pairs]
        return np.concatenate([np.zeros(0), *at_rest])

    def at_rest(self) -> Configuration:
        """Return the undeformed configuration without forces."""
        nothing = (None,) * len(self._mechanics)
        return Configuration(np.zeros(self.decomposition.torn_size), np.zeros(0), nothing, 0.0, 0.0, None)

    def least_jacobian(self, displacement: Vector) -> float:
        """Return the smallest det F at a torn displacement of all ranks. Collective."""
        comm = self.decomposition.comm
        with together(comm):
            each = zip(self._mechanics, self.decomposition.parts, strict=True)
            least = min((m.least_jacobian(displacement[part]) for m, part in each), default=1.0)
        return global_min(comm, least)

    def evaluate(
        self,
        meeting: Meeting,
        law: SlipLaw,
        at: Configuration,
        step: Vector,
        load: Loading,
        origin: Vector | None = None,
    ) -> Evaluation:
        """Return forces, openings and their residuals. Collective.

        Args:
            meeting: The contact points, with supports.
            law: Of friction.
            at: The configuration; its history and its time are those before the load step.
            step: ρ of the natural map, owned.
            load: What acts.
            origin: Displacement before the last Newton step, torn; None where there was none.
        """
        comm, torn = self.decomposition.comm, meeting.torn
        with together(comm):
            each = zip(self._mechanics, self.decomposition.parts, at.history, strict=True)
            duration = load.time - at.time
            responses = tuple(
                m.at(at.displacement[part], history, duration, None if origin is None else origin[part])
                for m, part, history in each
            )
            external, softening = load.at(at.displacement)
        internal = np.concatenate([np.zeros(0), *(response.force for response in responses)])
        bound = torn.B.T @ torn.numbering.to_local(at.multiplier)
        stiff, lacking = self.stiffness, meeting.lacking(at.displacement)
        # What is no more than rounding of strains and of positions is none.
        unbalanced = beyond(external - internal - bound, ROUNDED * stiff * self._cell)
        feasible = law.feasible(at.multiplier)
        mapped = feasible.project(at.multiplier - step * lacking)
        natural = beyond(at.multiplier - mapped, ROUNDED * self._reach * step)
        sizes = Sizes(natural, unbalanced, internal, bound, external, lacking, at.displacement, at.largest)
        residuals = sizes.residuals(torn, feasible.violation(at.multiplier), stiff)
        least = global_min(comm, min((r.least_jacobian for r in responses), default=1.0))
        return Evaluation(
            meeting,
            law,
            at,
            responses,
            external,
            softening,
            load.rim,
            unbalanced,
            lacking,
            residuals,
            least,
            stiff,
        )
