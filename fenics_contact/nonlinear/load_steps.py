"""Automatic load steps: from one load to the next as fast as Newton's method follows."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from fenics_contact.display import displayed
from fenics_contact.errors import ConvergenceError, InvalidInputError, tell
from fenics_contact.nonlinear.equations import Configuration, Equations, Linearisation
from fenics_contact.nonlinear.loading import Loading
from fenics_contact.nonlinear.meeting import Contact, Meeting
from fenics_contact.nonlinear.newton import NonlinearEquilibrium, TangentNewton
from fenics_contact.qp import SolverStep
from fenics_contact.timing import PhaseTimer

if TYPE_CHECKING:
    from fenics_contact.pairing import MaterialPoints

_LOG = logging.getLogger(__name__)

#: Newton steps of an easy load step: the next one is twice as long.
EASY = 6


@displayed
@dataclass(frozen=True, eq=False)
class Path:
    """The equilibria from one load to the next.

    Attributes:
        load: What acts at the end.
        end: The last equilibrium.
        begun: Where bodies met at the start; None where that is not known.
        start: Where nodes stood on their masters then, or where they were first found; None where contact is
            that of the undeformed bodies.
        fractions: Parts of the load at which equilibria were found, the last one being 1.
        history: One line for each Newton step of all parts, those of parts that were cut included.
        products: Applications of F.
        factorisations: Factored tangents, counting all subdomains as one.
    """

    load: Loading
    end: NonlinearEquilibrium
    begun: Meeting | None
    start: MaterialPoints | None
    fractions: tuple[float, ...]
    history: tuple[SolverStep, ...]
    products: int
    factorisations: int


class PathEndsError(ConvergenceError):
    """A load step that cannot be cut any further.

    Attributes:
        path: The way up to there; None if there is no equilibrium after the start.
    """

    def __init__(self, message: str, history: Sequence[SolverStep], path: Path | None) -> None:
        """Store how far the path went."""
        super().__init__(message, history)
        self.path = path


@displayed
@dataclass(frozen=True)
class AutomaticSteps:
    """Load steps that are halved where Newton's method fails, and doubled after easy ones.

    Attributes:
        newton: Solves each of them.
        first: First part of the load that is tried, in (0, 1].
        smallest: Smallest part of the load; a step that fails there ends the path.
    """

    newton: TangentNewton = field(default_factory=TangentNewton)
    first: float = 1.0
    smallest: float = 1.0 / 256

    def __post_init__(self) -> None:
        """Check the parts.

        Raises:
            InvalidInputError: If they are not in (0, 1], or the smallest is larger than the first.
        """
        if not 0.0 < self.smallest <= self.first <= 1.0:
            raise InvalidInputError(
                "the smallest and first part of a load step must be in (0, 1] and the smallest not larger "
                f"than the first, got {self.smallest!r} and {self.first!r}: give parts such as 1/256 and 1"
            )

    def follow(
        self,
        equations: Equations,
        contact: Contact,
        before: Loading | None,
        target: Loading,
        start: Configuration,
        timer: PhaseTimer,
        known: Linearisation | None = None,
    ) -> Path:
        """Return the equilibrium at a load, with the path to it. Collective.

        Args:
            equations: Internal forces.
            contact: How the bodies meet.
            before: What acts at the start; None for bodies at rest without loads.
            target: What acts at the end.
            start: The configuration at the start.
            timer: Collects the wall time.
            known: A linearisation near the start, or None.

        Raises:
            PathEndsError: The smallest step fails.
        """
        first = target.removed() if before is None else before
        # Slip begins where bodies are before supports and obstacles move.
        at = start if start.meeting else start.meeting_at(contact.at(first, start.displacement, None, None))
        assert at.meeting is not None
        torn, begun, stood = first.torn, at.meeting, at.meeting.stood
        end: NonlinearEquilibrium | None = None
        reached, part, longest = 0.0, self.first, contact.longest_part(first, target)
        fractions, history, products, factorisations = list[float](), list[SolverStep](), 0, 0

        def walked() -> Path:
            assert end is not None
            return Path(
                target.between(first, reached),
                end,
                begun,
                stood,
                tuple(fractions),
                tuple(history),
                products,
                factorisations,
            )

        while reached < 1.0:
            part = (1.0 - reached) / np.ceil((1.0 - reached) / min(part, longest) - 1e-9)
            fraction = 1.0 if reached + part > 1.0 - 1e-12 else reached + part
            load = target.between(first, fraction)
            if begun.points is None:
                slipped = torn.relative(at.displacement), torn.sliding(at.displacement)
                load = replace(load, torn=load.torn.with_slip_from(*slipped))
            try:
                found = self.newton.solve(equations, contact, load, at, timer, known)
            except ConvergenceError as failure:
                history += [replace(line, outer=len(fractions)) for line in failure.history]
                products += failure.history[-1].products if failure.history else 0
                factorisations += len(failure.history)
                part *= 0.5
                if part < self.smallest:
                    raise PathEndsError(
                        f"the load can be followed up to {reached:.3g} of this step, but a further "
                        f"{2 * part:.1e} of it fails: {failure}",
                        history,
                        None if end is None else walked(),
                    ) from failure
                tell(_LOG.info, "load step cut to %.3g: %s", part, failure)
                continue
            history += [replace(line, outer=len(fractions)) for line in found.history]
            products, factorisations = products + found.products, factorisations + found.factorisations
            fractions.append(fraction)
            at, torn, end, reached = found.configuration, load.torn, found, fraction
            new = found.evaluation.meeting.start
            stood = new if stood is None or new is None else stood.extended(new)
            known = found.linearisation
            part *= 2.0 if len(found.history) <= EASY else 1.0
        return walked()
