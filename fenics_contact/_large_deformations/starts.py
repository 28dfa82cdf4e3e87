"""The ends of a load step: where bodies are, or where their supports take them, and the next equilibrium."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from fenics_contact._base.display import displayed
from fenics_contact._large_deformations.equations import Configuration, Linearisation, ResidualState
from fenics_contact.errors import ConvergenceError
from fenics_contact.feti.torn import TornSystem
from fenics_contact.qp.reductions import Vector, global_max, global_sum
from fenics_contact.qp.solution import SolverStep

#: Friction short of its bound by less than this part of the largest one counts as slipping.
SLIDING = 1e-2
#: Relative residual where supports take bodies above which they are pressed rather than drawn.
PRESSED = 0.5


@dataclass(frozen=True)
class Effort:
    """What Newton's method has taken.

    Attributes:
        history: One line for each Newton step.
        products: Applications of F.
        factorisations: Factored tangents, counting all subdomains as one.
    """

    history: tuple[SolverStep, ...] = ()
    products: int = 0
    factorisations: int = 0

    @classmethod
    def until(cls, failure: ConvergenceError) -> Effort:
        """Return the effort of a load step that has failed."""
        history = tuple(failure.history)
        return cls(history, history[-1].products if history else 0, len(history))

    def followed_by(self, other: Effort, outer: int = 0) -> Effort:
        """Return the sum of two efforts, with the number of the solve in the lines of the second."""
        lines = (replace(line, products=self.products + line.products, outer=outer) for line in other.history)
        factorisations = self.factorisations + other.factorisations
        return Effort((*self.history, *lines), self.products + other.products, factorisations)


@displayed
@dataclass(frozen=True, eq=False)
class NonlinearEquilibrium:
    """The end of a load step.

    Attributes:
        evaluation: The equations there; all residuals are below the tolerance.
        linearisation: The last one, from a little before.
        effort: What it has taken.
    """

    evaluation: ResidualState
    linearisation: Linearisation
    effort: Effort

    @property
    def time(self) -> float:
        """When it is reached."""
        return self.evaluation.load.time

    @property
    def configuration(self) -> Configuration:
        """The configuration, with histories up to date: the next load step begins here."""
        found = self.evaluation
        at = replace(found.at, history=found.history, contact=found.contact.from_here())
        return replace(at, time=self.time, largest=found.residuals.gluing_scale)

    def continued(self, origin: Configuration) -> Configuration:
        """Return the configuration within a step of histories that began at another one."""
        largest = self.evaluation.residuals.gluing_scale
        return replace(self.evaluation.at, history=origin.history, time=origin.time, largest=largest)


def starts(
    evaluated: Callable[[Configuration], ResidualState], at: Configuration, moved: Vector | None
) -> tuple[ResidualState, Configuration | None]:
    """Return the equations where Newton's method starts, and where else if its first step fails. Collective.

    Bodies that touch nothing, there as here, start where their supports take them as rigid ones. So do bodies
    that slide: with their forces, on surfaces that are found where they come to lie, they are in equilibrium
    but for what lies under them. Where points stick or are pressed, the tangent knows better where bodies go.
    """
    contact = at.contact
    touching = contact is not None and _acts(contact.torn, at.multiplier)
    if moved is None or (contact is not None and touching and not _slides(contact.torn, at.multiplier)):
        return evaluated(at), None
    try:
        there = evaluated(replace(at, displacement=moved))
    except ConvergenceError:
        return evaluated(at), None
    if touching:
        return (there, at) if there.residuals.worst < PRESSED else (evaluated(at), None)
    if _acts(there.torn, there.torn.law.feasible(there.at.multiplier).project(-there.constraint_residual)):
        return evaluated(at), None
    return there, None


def _acts(torn: TornSystem, forces: Vector) -> bool:
    """Return whether any row of contact has a force. Collective."""
    touching = torn.numbering.owned >= torn.n_equality
    return global_sum(torn.numbering.comm, np.count_nonzero(forces[touching]))[0] > 0.0


def _slides(torn: TornSystem, multiplier: Vector) -> bool:
    """Return whether all friction is at its bound. Collective."""
    comm, bound = torn.numbering.comm, torn.law.bound(multiplier)
    friction = np.linalg.norm(multiplier[torn.layout.tangential], axis=1)
    largest = global_max(comm, float(bound.max(initial=0.0)))
    return global_max(comm, float((bound - friction).max(initial=0.0))) <= SLIDING * largest
