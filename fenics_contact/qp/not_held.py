"""Bodies that contact and friction could hold as far as forces go, and do not as they deform."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from fenics_contact.errors import ConvergenceError, InfeasibleError
from fenics_contact.qp.equilibrium import find_equilibrium
from fenics_contact.qp.iterate import Start, apply_unless_zero, iterate_at
from fenics_contact.qp.problem import CountedOperator, DualProblem
from fenics_contact.qp.reductions import global_max
from fenics_contact.qp.rigid import fit_rigid_motions
from fenics_contact.qp.slip_law import SlipLaw, Tresca
from fenics_contact.qp.solution import SolverStep

if TYPE_CHECKING:
    from fenics_contact.qp.face_newton import FaceNewton

#: Friction may press surfaces together itself, where they wedge: at most so many times what else does, and so
#: many times where a solver has tried all it can.
WEDGED, HARDLY_WEDGED = 100.0, 2.0
#: Gaps can be trusted where jumps are smaller than this, and so large a part of the load is out of balance.
PLAIN = 1e-2


def require_contact(history: Sequence[SolverStep], count: int) -> None:
    """Refuse a problem whose contacts stay open while only they could balance the load.

    Args:
        history: Steps of Newton's method and rescues.
        count: So many last steps of Newton's method must agree.

    Raises:
        InfeasibleError: They do.
    """
    late = [step for step in history if "rescue" not in step.method][-count:]
    if len(late) == count and all(_lost(step) for step in late):
        raise InfeasibleError(
            "every loaded body must be held, but all contacts stay open, and "
            f"{100 * late[-1].residuals.coarse:.2g} % of the load drive motions that only contact or "
            "friction could hold: close the gaps, support the bodies or press them together"
        )


def _lost(step: SolverStep) -> bool:
    residuals = step.residuals
    return step.closed == 0 and residuals.natural == 0.0 and residuals.gluing < PLAIN < residuals.coarse


def require_friction_enough(
    problem: DualProblem, law: SlipLaw, solver: FaceNewton, wedged: float = WEDGED
) -> None:
    """Refuse a problem whose friction is far from holding what nothing else holds. Collective.

    The bodies are held in all motions that only friction resists, and solved without friction. If even
    ``wedged`` times the slip bounds of the forces found cannot balance the load, friction holds nothing, as
    where supports keep the surfaces apart. That is no proof, and asked only where a solver gets nowhere.

    Args:
        problem: The problem that is not solved.
        law: Its law.
        solver: Solves it without friction.
        wedged: By so many times friction may press surfaces together itself.

    Raises:
        InfeasibleError: Friction does not suffice.
    """
    layout, coarse = problem.layout, problem.coarse
    if global_max(problem.comm, float(law.growth.max(initial=0.0))) == 0.0:
        return
    rows = np.concatenate([layout.equality, layout.normal])
    entries = (np.ones(len(rows)), (rows, np.arange(len(rows))))
    pressing = coarse.restricted(sp.csr_matrix(entries, shape=(layout.size, len(rows))))
    unheld, _ = np.linalg.qr(pressing.gram.null_space)
    held = replace(problem, coarse=coarse.with_load(coarse.load - unheld @ (unheld.T @ coarse.load)))
    without = Tresca(layout, law.bound(np.zeros(layout.size)))
    multiplier = held.coarse.particular()
    operator = CountedOperator(problem.operator)
    product = apply_unless_zero(held, operator, multiplier)
    alpha = fit_rigid_motions(held, without, multiplier, product)
    start = Start(iterate_at(held, without, multiplier, product, alpha), operator)
    try:
        forces = solver.run(held, without, start).multiplier
    except (ConvergenceError, InfeasibleError):
        return
    found = find_equilibrium(problem, Tresca(layout, wedged * law.bound(forces)))
    if found.motion is not None:
        raise InfeasibleError(
            "friction needs surfaces that are pressed together, but without it they are pressed so little "
            f"that even {wedged:g} times the forces that it may then bear leave {100 * found.error:.2g} % of "
            "the load unbalanced: support bodies that only friction holds, press them, or raise the friction"
        )
