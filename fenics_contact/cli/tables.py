"""Tables of results."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from rich import box
from rich.table import Table

from fenics_contact.contact import State, Status, pairs_in_words
from fenics_contact.display import counted, force_units
from fenics_contact.linalg import ROUNDING
from fenics_contact.scene_file import SceneFile

if TYPE_CHECKING:
    from fenics_contact.scene_file import UnitNames


def state_facts(state: State, units: UnitNames) -> dict[str, str]:
    """Return a summary of a state as text, without energies that are not known. Collective."""
    counts, (force, energy) = state.counts, force_units(units.force, units.length, state.scene.dim)
    rows = {
        "unknowns": f"{counts['torn_unknowns']} in {counted(counts['subdomains'], 'subdomain')}",
        "work": f"{counted(counts['solver_steps'], 'step')}, "
        f"{counted(counts['f_products'], 'product')} with F",
        "residuals": f"natural {state.solution.natural_residual:.1e}, gluing "
        f"{state.solution.gluing_residual:.1e}",
        "strain energy": f"{state.energies.strain:.6g} {energy}",
        "total potential": f"{state.energies.total_potential:.6g} {energy}",
        "displacement": f"up to {_largest_displacement(state):.4g} {units.length}",
    }
    for number, words in enumerate(pairs_in_words(state.scene, state.contact, force, units.stress)):
        rows[f"contact {number}"] = words
    for number, motion in enumerate(state.rigid_motions()):
        rows[f"rigid surface {number}"] = str(motion).replace("[length]", units.length)
    if state.unheld:
        rows["held by nothing"] = " and ".join(map(str, state.unheld)) + ": stays where it is"
    if state.known_errors is not None:
        rows |= {f"error, {name}": words for name, words in state.known_errors.in_words.items()}
    rows["seconds"] = ", ".join(f"{name} {spent:.2f}" for name, spent in state.seconds.items())
    return {name: words for name, words in rows.items() if not words.startswith("nan")}


def step_row(number: int, name: str, state: State) -> tuple[str, ...]:
    """Return a row of `step_table`."""
    contact, counts = state.contact, state.counts
    return (
        str(number),
        name,
        str(counts["solver_steps"]),
        str(counts["f_products"]),
        *(str(contact.count(status)) for status in Status),
        f"{contact.normal_force.sum():.6g}",
        f"{_resultant(state):.6g}",
        f"{contact.pressure.max(initial=0.0):.5g}",
    )


def step_table(rows: Sequence[tuple[str, ...]], file: SceneFile) -> Table:
    """Return one row for every load step."""
    units = file.document.units
    force, _ = force_units(units.force, units.length, file.scene.dim)
    table = Table(
        title=f"{file.title}: load steps", title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False
    )
    table.add_column("", justify="right")
    table.add_column("step", no_wrap=True)
    for name in (
        "iterations", "products", "open", "stick", "slip", f"normal force\n({force})",
        f"friction\n({force})", f"largest pressure\n({units.stress})",
    ):  # fmt: skip
        table.add_column(name, justify="right")
    for row in rows:
        table.add_row(*row)
    return table


def _resultant(state: State) -> float:
    """Return the magnitude of the sum of all friction forces, zero below what the solver left, [force]."""
    contact = state.contact
    tangential = contact.force - contact.normal_force[:, None] * contact.points.normal
    size = float(np.linalg.norm(tangential.sum(axis=0)))
    left = max(ROUNDING, float(np.nan_to_num(state.solution.natural_residual)))
    return size if size > left * float(np.abs(contact.force).sum()) else 0.0


def _largest_displacement(state: State) -> float:
    moved = [np.linalg.norm(state.gather_displacement(name), axis=1).max() for name in state.scene.bodies]
    return float(max(moved))
