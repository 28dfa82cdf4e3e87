"""A state as a few arrays, and back: the content of checkpoints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import astuple, replace

import numpy as np

from fenics_contact._fem.mechanics import History
from fenics_contact._large_deformations.equations import Configuration
from fenics_contact._large_deformations.loading import Loading
from fenics_contact._large_deformations.moving_contact import Contact, MovingContact
from fenics_contact.errors import InvalidInputError
from fenics_contact.feti.decomposition import Decomposition
from fenics_contact.feti.direct import DirectSolution
from fenics_contact.feti.dual import DualSystem
from fenics_contact.feti.torn import TornSystem
from fenics_contact.qp.problem import CountedOperator
from fenics_contact.qp.solution import DualSolution, iterate_at
from fenics_contact.results.deformed_state import DeformedState
from fenics_contact.results.linear_state import as_linear
from fenics_contact.results.state import State

Stored = Mapping[str, np.ndarray]


def with_stored_slip(torn: TornSystem, stored: Stored) -> TornSystem:
    """Return a system in which slip is measured from the same origin as for a stored state.

    Raises:
        InvalidInputError: If the arrays are those of another system.
    """
    require_rows(torn, stored)
    return torn.with_slip_from(stored["origin"][torn.numbering.owned], stored["slid"])


def require_rows(torn: TornSystem, stored: Stored) -> None:
    """Reject a stored state with other rows.

    Raises:
        InvalidInputError: If it has.
    """
    if stored["multiplier"].shape != (torn.numbering.total,):
        raise InvalidInputError(
            f"a stored state needs {torn.numbering.total} multipliers, got "
            f"{stored['multiplier'].size}: give the scene and the partition of that state"
        )


def stored_state(state: State) -> dict[str, np.ndarray]:
    """Return the arrays from which a state can be rebuilt, on any number of ranks. Collective.

    Returns:
        ``multiplier`` λ and ``origin``, from which slip is measured, of all rows in their order, shape
        (n_rows,), ``slid``, the same for points without friction, and ``motion``, the coefficients α of the
        rigid motions; all replicated. Empty for a state that was computed without multipliers. Of bodies with
        nonlinear materials what `stored_deformed` returns.
    """
    if isinstance(state.solution, DirectSolution):
        return {}
    if state.scene.is_nonlinear:
        from fenics_contact.results.deformed_state import DeformedState

        assert isinstance(state, DeformedState)
        return stored_deformed(state)
    torn, solution = state.torn, as_linear(state, "multipliers of rigid motions").dual_solution
    rows = np.arange(torn.numbering.total)
    return {
        "multiplier": torn.numbering.gather(solution.multiplier, rows),
        "origin": torn.numbering.gather(torn.right + torn.supported, rows),
        "slid": torn.slid,
        "motion": np.asarray(solution.alpha),
    }


def restored_solution(system: DualSystem, stored: Stored) -> DualSolution:
    """Compute the residuals of a stored multiplier. Collective; one product."""
    problem, law = system.problem, system.torn.law
    multiplier, motion = stored["multiplier"][system.torn.numbering.owned], stored["motion"]
    operator = CountedOperator(problem.operator)
    iterate = iterate_at(problem.with_law(law), multiplier, operator(multiplier), motion)
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


def stored_deformed(state: DeformedState) -> dict[str, np.ndarray]:
    """Return the arrays from which a state can be rebuilt, on any number of ranks. Collective.

    Torn displacements, multipliers and histories come back bit for bit; normals and slip are found again, to
    their last places. Fields on whole bodies may differ by a part of the openings at interfaces, which are
    below the tolerance: they are spread inside subdomains by tangents at the equilibrium, before by those of
    the last Newton step.

    Returns:
        ``displacement`` of all copies of the nodes, shape (n_copies, dim), ``multiplier`` λ of all rows, the
        ``history`` of materials of each body, with the time and the largest displacement, before the step of
        histories, the work of friction before it (``rubbed``), and the ``parts`` and ``snaps``; of moved
        bodies the facets on which nodes stand, where they stood, and the slip; else ``origin`` and ``slid``,
        from which slip is measured. All replicated.
    """
    decomposition, evaluation = state.torn.decomposition, state.equilibrium.evaluation
    comm, tearing, at = decomposition.comm, decomposition.tearing, evaluation.at
    numbering, rows = evaluation.torn.numbering, np.arange(evaluation.torn.numbering.total)
    here, block = decomposition.held
    copies = np.zeros((len(tearing.copy_subdomain), tearing.dim))
    copies[here] = at.displacement.reshape(-1, tearing.dim)[block]
    stored: dict[str, np.ndarray] = {
        "displacement": np.asarray(comm.allreduce(copies)),
        "multiplier": numbering.gather(at.multiplier, rows),
        "times": np.array([at.time, state.equilibrium.time, at.largest]),
        "parts": np.array(state.fractions),
        "since": np.array(state.since),
        "rubbed": np.array(state.energies.friction - evaluation.rubbing),
        "snaps": np.array([astuple(snap) for snap in state.snaps]),
    }
    pairs = zip(decomposition.meshes, at.history, strict=True)
    parts = [(mesh.body, mesh.cells, values) for mesh, values in pairs if values is not None]
    history = History.unloaded(state.scene).advanced(comm, parts)
    stored |= {f"history.{name}": values for name, values in history.values.items()}
    points, start = evaluation.contact.points, evaluation.contact.start
    if points is None or start is None:
        torn = evaluation.torn
        origin = numbering.gather(torn.right + torn.supported, rows)
        return stored | {"origin": origin, "slid": torn.slid}
    slip = np.array([state.contact.slip, state.contact.slip_before])
    return stored | points.stored(start) | {"slip": slip}


def stored_configuration(
    stored: Stored, load: Loading, contact: Contact, decomposition: Decomposition
) -> tuple[Configuration, Loading]:
    """Return the configuration of a stored state, with its contact points, and its load. Collective.

    Raises:
        InvalidInputError: If the arrays are those of another system.
    """
    tearing = decomposition.tearing
    count, given = len(tearing.copy_subdomain), stored["displacement"].shape
    if given != (count, tearing.dim):
        raise InvalidInputError(
            f"a stored state needs displacements of {count} nodes of its subdomains, got shape {given}: give "
            "the scene and the partition of that state"
        )
    here, block = decomposition.held
    by_block = np.zeros((len(here), tearing.dim))
    by_block[block] = stored["displacement"][here]
    displacement = by_block.ravel()
    history = tuple(
        stored[f"history.{mesh.body}"][mesh.cells] if f"history.{mesh.body}" in stored else None
        for mesh in decomposition.meshes
    )
    if isinstance(contact, MovingContact):
        found = contact.found_again(load, displacement, stored)
        require_rows(found.torn, stored)
    else:
        load = replace(load, torn=with_stored_slip(load.torn, stored))
        found = contact.at(load, displacement, None)
    begin, _, largest = stored["times"]
    multiplier = stored["multiplier"][found.torn.numbering.owned]
    return Configuration(displacement, multiplier, history, float(begin), float(largest), found), load
