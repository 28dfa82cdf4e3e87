"""A state of bodies that deform much as arrays: the content of a checkpoint of a load history."""

from __future__ import annotations

from dataclasses import astuple, replace

import numpy as np

from fenics_contact.contact.deformed_state import DeformedState
from fenics_contact.contact.stored_rows import Stored, require_rows, with_stored_slip
from fenics_contact.errors import InvalidInputError
from fenics_contact.fem import History
from fenics_contact.feti import Decomposition
from fenics_contact.nonlinear import Configuration, Contact, Loading, MovingContact


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

    Args:
        stored: What `stored_deformed` returned.
        load: What acts.
        contact: How the bodies meet.
        decomposition: The subdomains.

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
