"""What was found in a state and what it cost, in words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from fenics_contact.contact.energies import Energies
from fenics_contact.contact.result import ContactResult, Status
from fenics_contact.display import counted
from fenics_contact.feti import DirectSolution
from fenics_contact.qp import Solution
from fenics_contact.scene import ContactPair, Scene

if TYPE_CHECKING:
    from fenics_contact.accuracy import StateErrors


def answer_in_words(
    contact: ContactResult,
    solution: Solution | DirectSolution,
    energies: Energies,
    counts: Mapping[str, int],
) -> dict[str, str]:
    """Return the size of a problem, its answer and the work of its solver, by name."""
    return {
        "unknowns": f"{counts['torn_unknowns']} in {counted(counts['subdomains'], 'subdomain')}",
        "contact": f"{counted(contact.points.count, 'point')}, {contact.counts_in_words}",
        "largest force": f"{np.linalg.norm(contact.force, axis=1).max(initial=0.0):.6g}",
        "strain energy": f"{energies.strain:.6g}",
        "total potential": f"{energies.total_potential:.6g}",
        "work": f"{counted(counts['solver_steps'], 'step')}, "
        f"{counted(counts['f_products'], 'product')} with F",
        "residuals": f"natural {solution.natural_residual:.1e}, gluing {solution.gluing_residual:.1e}",
    }


def errors_in_words(errors: StateErrors | None) -> dict[str, str]:
    """Return the errors of a state by name, or where to get them."""
    if errors is None:
        return {"errors": "not estimated yet: call state.estimate_errors()"}
    return {f"error, {name}": words for name, words in errors.in_words.items()}


def first_pairs(scene: Scene, contact: ContactResult, most: int = 8) -> dict[str, str]:
    """Return a summary of the first contact pairs, and how many there are beside, by name."""
    words = pairs_in_words(scene, contact)
    shown = {f"contact {number}": line for number, line in enumerate(words[:most])}
    more = len(words) - most
    return shown | ({"more": f"{more} further contact pairs"} if more > 0 else {})


def pairs_in_words(scene: Scene, contact: ContactResult, force: str = "", stress: str = "") -> list[str]:
    """Return a summary of each contact pair: points by status, resultants, largest pressure.

    Args:
        scene: The scene.
        contact: The result on its contact surfaces.
        force: Name of the unit of force.
        stress: Name of the unit of stress.
    """
    rows = []
    for number, pair in enumerate(scene.contacts):
        mine = contact.on_pair(number)
        pressing = contact.normal_force[mine, None] * contact.points.normal[mine]
        resultant = f"normal force {_size(pressing, force)}"
        if pair.has_friction:
            resultant += f", friction {_size(contact.force[mine] - pressing, force)}"
        pressure = f"{contact.pressure[mine].max(initial=0.0):.5g} {stress}".rstrip()
        if scene.deforms_much:
            nominal = contact.nominal_pressure[mine].max(initial=0.0)
            pressure += f", nominal {nominal:.5g} {stress}".rstrip()
        rows.append(
            f"{pair.place}: {counted(len(mine), 'point')}, {_kinds(pair, contact.status[mine])}; "
            f"{resultant}, pressure up to {pressure}"
        )
    return rows


def _size(forces: np.ndarray, unit: str) -> str:
    """Return the magnitude of the sum of forces, shape (n, dim), with its unit."""
    return f"{np.linalg.norm(forces.sum(axis=0)):.6g} {unit}".rstrip()


def _kinds(pair: ContactPair, status: np.ndarray) -> str:
    """Return the numbers of points by status; without friction open or closed."""
    counts = {kind.name.lower(): int(np.count_nonzero(status == kind)) for kind in Status}
    if not pair.has_friction:
        counts = {"open": counts["open"], "closed": len(status) - counts["open"]}
    return ", ".join(f"{count} {name}" for name, count in counts.items())
