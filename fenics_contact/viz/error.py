"""Picture of the discretisation error of a state."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.colors import LogNorm

from fenics_contact.accuracy import discretisation_error
from fenics_contact.contact import State
from fenics_contact.errors import InvalidInputError
from fenics_contact.viz.colours import ERROR_MAP
from fenics_contact.viz.fields import drawn_bodies
from fenics_contact.viz.obstacles import obstacles_of
from fenics_contact.viz.painting import paint
from fenics_contact.viz.paints import Paints
from fenics_contact.viz.picture import Picture, png_path
from fenics_contact.viz.stress import contact_spot
from fenics_contact.viz.units import Units
from fenics_contact.viz.words import checked_range, checked_reach, headline, written

#: Smallest lower end of the colours relative to their upper end: smaller errors do not matter.
SPAN = 1e-4


def plot_error(
    state: State,
    path: str | Path | None = None,
    by_cell: Mapping[str, np.ndarray] | None = None,
    *,
    clim: tuple[float, float] | None = None,
    sections: bool = True,
    reach: float | None = None,
    title: str = "",
    units: Units | None = None,
    width: int = 1600,
) -> Picture:
    """Draw each cell's part of the discretisation error, on a logarithmic scale. Collective.

    The squares of the cells' parts, relative to the energy norm √(uᵀK u) of the displacement, add up to the
    square of the relative error in the title. An efficient mesh shows a uniform colour; dark cells should be
    refined. Bodies are shown in true deformation, with sections through the strongest contact as in
    `plot_stress`.

    Args:
        state: The state.
        path: PNG file to write, None to write none.
        by_cell: Body name -> part of each cell relative to that norm, shape (n_cells,); estimated unless
            given, see `accuracy.discretisation_error`.
        clim: Range of the colours, positive; up to the largest part and down to a ten thousandth of it, or
            the smallest, unless given. Give two pictures the same range to compare them.
        sections: Whether to draw the sections, if a contact carries force.
        reach: How far sections reach up and down from the contact's middle, [length]; chosen unless given.
        title: Text before the facts in the title.
        units: Names of the units, mm, N and MPa unless given.
        width: Width of the picture in pixels.

    Returns:
        The picture, which can be used like a path to its file.

    Raises:
        InvalidInputError: If the number of parts is not that of the cells, or an option or the name of the
            file cannot be used.
        MissingRequirementError: If this machine cannot render.
    """
    target = png_path(path)
    checked_reach(reach)
    given = None if clim is None else checked_range(clim)
    if given is not None and given[0] <= 0:
        raise InvalidInputError(f"clim of a logarithmic scale must be positive, got {clim}: try (1e-5, 1e-2)")
    if by_cell is None:
        estimate = discretisation_error(state.torn, state.conforming_displacement)
        size = np.sqrt(2 * state.energies.strain) or np.inf  # a body at rest has no error
        by_cell = {name: estimate.by_cell(name) / size for name in state.scene.bodies}
    parts = {name: _checked(name, body.mesh.n_cells, by_cell) for name, body in state.scene.bodies.items()}
    every = np.concatenate(list(parts.values()))
    total, top = float(np.linalg.norm(every)), float(every.max()) or 1.0
    ends = given or (min(max(float(every.min()), SPAN * top), top / 10), top)
    facts = f"estimated discretisation error {written(100 * total, 3)} % in energy norm, by cell"
    bodies, named = drawn_bodies(state), units or Units()
    shown = {name: np.repeat(part, bodies[name].n_cells // len(part)) for name, part in parts.items()}
    words, label = headline(title, facts), "part of a cell, relative"
    paints = Paints(shown, ERROR_MAP, LogNorm(*ends), label, words, 1.0, reach, named, width)
    spot = contact_spot(state, bodies) if sections else None
    comm = state.torn.decomposition.comm
    return paint(bodies, paints, target, obstacles=obstacles_of(state), spot=spot, comm=comm)


def _checked(name: str, cells: int, by_cell: Mapping[str, np.ndarray]) -> np.ndarray:
    part = np.asarray(by_cell[name], dtype=np.float64) if name in by_cell else np.zeros(0)
    if part.shape != (cells,) or not np.all(np.isfinite(part) & (part >= 0)):
        smallest = f", the smallest {part.min()}" if part.size else ""
        raise InvalidInputError(
            f"by_cell[{name!r}] must hold {cells} numbers, one per cell, finite and not negative, got "
            f"{f'shape {part.shape}{smallest}' if name in by_cell else 'none'}: give the by_cell(body) of an "
            "estimate, divided by the norm of the displacement"
        )
    return part
