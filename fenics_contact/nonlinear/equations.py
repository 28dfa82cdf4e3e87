"""The equilibrium of a torn system with nonlinear materials: its residuals and its linearisation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from fenics_contact.display import displayed
from fenics_contact.errors import together
from fenics_contact.fem import Mechanics, Response, composition
from fenics_contact.feti import Decomposition, TornSystem
from fenics_contact.nonlinear.tangent_step import TangentProblem
from fenics_contact.nonlinear.tangent_system import TangentSystem, linearised
from fenics_contact.qp import (
    CoulombLaw,
    Residuals,
    SlipLaw,
    Vector,
    contact_step,
    global_max,
    global_min,
    global_sum,
)
from fenics_contact.scene import Scene
from fenics_contact.timing import PhaseTimer

#: Forces below this fraction of those that would strain bodies by their displacement are none.
FORCE_FLOOR = 1e-4


@displayed
@dataclass(frozen=True, eq=False)
class Configuration:
    """A displacement with the forces and the histories of materials that belong to it.

    Attributes:
        displacement: u of this rank, torn, shape (torn_size,), [length].
        multiplier: λ, owned, [force].
        history: Internal variables of each of this rank's subdomains; None without any.
    """

    displacement: Vector
    multiplier: Vector
    history: tuple[np.ndarray | None, ...]


@displayed
@dataclass(frozen=True, eq=False)
class Evaluation:
    """The equations at a configuration.

    Attributes:
        torn: The system with the load and the supports of the moment.
        at: The configuration.
        responses: Internal forces and tangents of this rank's subdomains.
        unbalanced: f − f_int(u) − Bᵀλ of this rank, torn, [force].
        lacking: c − B u, owned, [length]: gaps, minus the slip, and openings of glued rows.
        residuals: Their size, relative.
        least_jacobian: Smallest det F of all bodies; 1 where none is strained much.
    """

    torn: TornSystem
    at: Configuration
    responses: tuple[Response, ...]
    unbalanced: Vector
    lacking: Vector
    residuals: Residuals
    least_jacobian: float

    @property
    def history(self) -> tuple[np.ndarray | None, ...]:
        """Internal variables after the displacement, of each subdomain."""
        return tuple(response.history for response in self.responses)

    def linearised(self, timer: PhaseTimer, known: TangentSystem | None) -> TangentSystem:
        """Factor the tangents. Collective."""
        tangents = [response.stiffness for response in self.responses]
        torn = linearised(self.torn, self.at.displacement, tangents, self.unbalanced, self.lacking)
        return TangentSystem(torn, timer, known=known)


@displayed
class Equations:
    """Internal forces of all bodies of a scene, whose meshes and numbering do not change.

    Attributes:
        decomposition: The subdomains.
    """

    def __init__(self, scene: Scene, decomposition: Decomposition) -> None:
        """Bind the forms of every subdomain. Collective."""
        self.decomposition = decomposition
        forms = decomposition.forms
        forms.prepare_mechanics(scene)
        with together(decomposition.comm):
            self._mechanics = tuple(self._of(scene, number) for number in range(len(decomposition.meshes)))

    def _of(self, scene: Scene, number: int) -> Mechanics:
        mesh = self.decomposition.meshes[number]
        body = scene.bodies[mesh.body]
        points = body.mesh.points[np.sort(mesh.nodes)]
        parts = composition(body, mesh.cells)
        return self.decomposition.forms.mechanics(parts, body.mesh.cell_type, mesh.space, points)

    def _facts(self) -> dict[str, object]:
        return {"subdomains": f"{len(self._mechanics)} on this rank"}

    @cached_property
    def _parts(self) -> list[slice]:
        ends = self.decomposition.tearing.dim * self.decomposition.block_offset
        return [slice(int(a), int(b)) for a, b in pairwise(ends)]

    def at_rest(self, torn: TornSystem) -> Configuration:
        """Return the undeformed configuration without forces."""
        nothing = (None,) * len(self._mechanics)
        size = self.decomposition.torn_size
        return Configuration(np.zeros(size), np.zeros(len(torn.numbering.owned)), nothing)

    def least_jacobian(self, displacement: Vector) -> float:
        """Return the smallest det F at a torn displacement of all ranks. Collective."""
        comm = self.decomposition.comm
        with together(comm):
            each = zip(self._mechanics, self._parts, strict=True)
            least = min((m.least_jacobian(displacement[part]) for m, part in each), default=1.0)
        return global_min(comm, least)

    def evaluate(self, torn: TornSystem, law: SlipLaw, at: Configuration, step: Vector) -> Evaluation:
        """Return forces, openings and their residuals. Collective.

        Args:
            torn: The system with load, supports and origin of slip.
            law: Of friction.
            at: The configuration; its history is that before the load step.
            step: ρ of the natural map, owned.
        """
        comm, numbering = self.decomposition.comm, torn.numbering
        with together(comm):
            each = zip(self._mechanics, self._parts, at.history, strict=True)
            responses = tuple(m.at(at.displacement[part], history) for m, part, history in each)
        internal = np.concatenate([np.zeros(0), *(response.force for response in responses)])
        bound = torn.B.T @ numbering.to_local(at.multiplier)
        unbalanced, lacking = torn.load - internal - bound, torn.right - torn.jump(at.displacement)
        stiff = max((float(r.stiffness.diagonal().max()) for r in responses), default=0.0)
        residuals = _residuals(torn, law, at, step, (unbalanced, internal, bound), lacking, stiff)
        least = global_min(comm, min((r.least_jacobian for r in responses), default=1.0))
        return Evaluation(torn, at, responses, unbalanced, lacking, residuals, least)


def _residuals(
    torn: TornSystem,
    law: SlipLaw,
    at: Configuration,
    step: Vector,
    forces: Sequence[Vector],
    lacking: Vector,
    stiff: float,
) -> Residuals:
    """Return the relative residuals: forces out of balance as `coarse`. Collective."""
    comm, contact = torn.numbering.comm, torn.numbering.owned >= torn.n_equality
    mapped = law.feasible(at.multiplier).project(at.multiplier - step * lacking)
    error, u = (at.multiplier - mapped)[contact], at.displacement
    sums = global_sum(
        comm,
        *(x @ x for x in (*forces, torn.load, u, lacking[~contact], torn.right[~contact], error)),
        len(u),
    )
    unbalanced, internal, bound, load, moved, open_, given, natural = np.sqrt(sums[:8])
    moved = max(moved, given)
    floor = FORCE_FLOOR * global_max(comm, stiff) * moved / np.sqrt(sums[8])
    force = max(min(internal, bound) if internal > 0 else bound, load, floor)
    violation = global_max(comm, law.feasible(at.multiplier).violation(at.multiplier))
    ratio = 1.0 / force if force > 0.0 else 0.0
    return Residuals(
        natural * ratio,
        open_ / moved if moved > 0.0 else 0.0,
        unbalanced * ratio,
        violation * ratio,
        force,
        moved,
    )


def law_of(torn: TornSystem) -> SlipLaw:
    """Return the law of friction of this rank's discs."""
    discs = torn.owned_discs
    return CoulombLaw(torn.layout, torn.friction_coefficient[discs], torn.tresca_bound[discs])


def tangent_problem(system: TangentSystem, law: SlipLaw, evaluation: Evaluation) -> TangentProblem:
    """Return the problem of one Newton step."""
    problem = system.problem.with_law(law)
    return TangentProblem(problem, system.stiffness, evaluation.at.multiplier, evaluation.lacking)


def natural_step(system: TangentSystem, caution: float) -> Vector:
    """Return ρ of the natural map, owned, made smaller by a factor."""
    return caution * contact_step(system.problem.layout, system.problem.diagonal)


def advanced(at: Configuration, displacement: Vector, multiplier: Vector) -> Configuration:
    """Return another displacement and multiplier after the same history."""
    return replace(at, displacement=displacement, multiplier=multiplier)
