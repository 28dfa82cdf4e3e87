"""A state as a few arrays, and back: what a checkpoint holds of an equilibrium."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fenics_contact.contact.equilibrium import find_state, state_of
from fenics_contact.contact.state import State
from fenics_contact.errors import InvalidInputError, collectively
from fenics_contact.feti import Decomposition, DirectSystem, DualSystem, build_torn_system
from fenics_contact.qp import Coulomb, CountedOperator, DualSolution, SlipLaw, Tresca
from fenics_contact.qp.iterate import iterate_at
from fenics_contact.scene import Scene
from fenics_contact.timing import PhaseTimer

Stored = Mapping[str, np.ndarray]


def stored_state(state: State) -> dict[str, np.ndarray]:
    """Return what a state can be built from again, on any number of ranks. Collective.

    Returns:
        ``multiplier`` λ and ``origin``, from which slip is measured, of all rows in their order, shape
        (n_rows,), ``slid``, the same for points without friction, and ``motion``, the coefficients α of the
        rigid motions; all replicated. Nothing for a state that was found without multipliers.
    """
    if isinstance(state.system, DirectSystem):
        return {}
    torn, solution = state.torn, state.dual_solution
    rows = np.arange(torn.numbering.total)
    return {
        "multiplier": torn.numbering.gather(solution.multiplier, rows),
        "origin": torn.numbering.gather(torn.right + torn.supported, rows),
        "slid": torn.slid,
        "motion": np.asarray(solution.alpha),
    }


@collectively("restored_state", lambda scene, decomposition, *_, **__: decomposition.comm)
def restored_state(
    scene: Scene,
    decomposition: Decomposition,
    stored: Stored,
    *,
    previous: State | None = None,
    timer: PhaseTimer | None = None,
) -> State:
    """Build a state from what `stored_state` returned: one product instead of a solve. Collective.

    Args:
        scene: The scene with coordinates, loads and supports of the state.
        decomposition: Its decomposition, with the same subdomains on any number of ranks.
        stored: The arrays.
        previous: State of a neighbouring geometry or load, whose matrices and factors are used again.
        timer: Collects the seconds.

    Returns:
        The state; its multiplier is that of the stored one, its residuals are recomputed.

    Raises:
        InvalidInputError: If the arrays are those of another system.
    """
    timer = timer or PhaseTimer()
    if not stored:
        return find_state(scene, decomposition, previous=previous, start_geometry=False, timer=timer)
    with timer.phase("assemble"):
        known = None if previous is None else previous.torn
        torn = build_torn_system(scene, decomposition, start_geometry=False, previous=known)
        owned = torn.numbering.owned
        if stored["multiplier"].shape != (torn.numbering.total,):
            raise InvalidInputError(
                f"a stored state needs {torn.numbering.total} multipliers, got "
                f"{stored['multiplier'].size}: give the scene and the partition that it was found with"
            )
        torn = torn.with_slip_from(stored["origin"][owned], stored["slid"])
    earlier = previous.system if previous is not None and isinstance(previous.system, DualSystem) else None
    system = DualSystem(torn, timer, previous=earlier)
    with timer.phase("state"):
        solution = _solution(system, stored["multiplier"][owned], stored["motion"])
        displacement = system.displacement(solution.multiplier, solution.alpha)
    return state_of(system, solution, displacement, timer)


def _solution(system: DualSystem, multiplier: np.ndarray, motion: np.ndarray) -> DualSolution:
    """Compute residuals of a known multiplier. Collective; one product."""
    problem, law = system.problem, _law(system)
    operator = CountedOperator(problem.operator)
    iterate = iterate_at(problem, law, multiplier, operator(multiplier), motion)
    return DualSolution(
        problem=problem,
        multiplier=multiplier,
        residual=iterate.residual,
        product=iterate.product,
        alpha=motion,
        slip_bound=law.bound(multiplier),
        residuals=iterate.residuals,
        reason="read from a checkpoint",
        iterations=0,
        products=operator.products,
        history=(),
    )


def _law(system: DualSystem) -> SlipLaw:
    discs, layout, torn = system.owned_discs(), system.problem.layout, system.torn
    tresca, coefficient = torn.tresca_bound[discs], torn.friction_coefficient[discs]
    if np.any(torn.friction_coefficient > 0):
        return Coulomb(layout, coefficient, tresca)
    return Tresca(layout, tresca)
