"""Picture of the von Mises stress in the deformed bodies, with sections through the contact."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.colors import Normalize

from fenics_contact.contact import State
from fenics_contact.errors import InvalidInputError
from fenics_contact.viz.colours import STRESS_MAP
from fenics_contact.viz.fields import Bodies, drawn_bodies, lengths, nodal, points_of
from fenics_contact.viz.obstacles import obstacles_of
from fenics_contact.viz.painting import paint
from fenics_contact.viz.paints import Paints
from fenics_contact.viz.picture import Picture, png_path
from fenics_contact.viz.units import Units
from fenics_contact.viz.words import checked_range, checked_reach, headline, nice_number, written

#: Apparent size of the largest displacement relative to the bodies.
VISIBLE = 0.03
#: The colours end at this quantile of the cells, as the peak under a contact would leave the rest in one
#: shade.
QUANTILE = 0.995


def plot_stress(
    state: State,
    path: str | Path | None = None,
    *,
    clim: tuple[float, float] | None = None,
    scale: float | None = None,
    sections: bool = True,
    reach: float | None = None,
    smooth: bool = True,
    title: str = "",
    units: Units | None = None,
    width: int = 1600,
) -> Picture:
    """Draw the von Mises stress on the deformed bodies. Collective.

    Below, two sections through the centre of the strongest contact, in true deformation: with magnified
    displacement bodies would overlap in contact. Plane bodies are shown in their plane, with a detail of the
    contact if it is small. Rigid obstacles are shaded in the plane; in space planes are shown as sheets,
    spheres and cylinders by their outlines, others not at all.

    Args:
        state: The state.
        path: PNG file to write, None to write none.
        clim: Range of the colours, [force / length²]; from zero to the 99.5 % quantile unless given. Give two
            pictures the same range to compare them.
        scale: Factor of the displacement in the upper picture; chosen and stated unless given, 1 where there
            are rigid obstacles.
        sections: Whether to draw the sections, if a contact carries force.
        reach: How far sections reach up and down from the contact's middle, [length]; chosen unless given.
        smooth: Whether to show nodal means instead of cell values.
        title: Text before the facts in the title.
        units: Names of the units, mm, N and MPa unless given.
        width: Width of the picture in pixels.

    Returns:
        The picture, which can be used like a path to its file.

    Raises:
        InvalidInputError: If an option or the name of the file cannot be used.
        MissingRequirementError: If this machine cannot render.

    Example:
        >>> plot_stress(state, "output/stress.png", clim=(0, 400), scale=50)  # doctest: +SKIP
        >>> plot_stress(state)  # in a notebook  # doctest: +SKIP
    """
    target = png_path(path)
    if scale is not None and not np.isfinite(scale):
        raise InvalidInputError(
            f"scale must be finite, got {scale}: give the factor of the displacement, such as 10"
        )
    checked_reach(reach)
    given = None if clim is None else checked_range(clim)
    bodies = drawn_bodies(state)
    # With magnified displacement bodies would penetrate rigid obstacles.
    chosen = 1.0 if obstacles_of(state) else chosen_scale(bodies)
    factor = chosen if scale is None else float(scale)
    shown, named = given or stress_range(bodies), units or Units()
    peak = max(float(body["von_mises"].max()) for body in bodies.values())
    largest = f"largest mean over a cell {written(peak)} {named.stress}"
    facts = f"von Mises stress, {largest}; displacement × {factor:g}"
    values = {
        name: nodal(body, "von_mises") if smooth else body["von_mises"] for name, body in bodies.items()
    }
    label, words = f"von Mises stress ({named.stress})", headline(title, facts)
    norm = Normalize(*shown)
    paints = Paints(values, STRESS_MAP, norm, label, words, factor, reach, named, width, told=True)
    return paint(state, bodies, paints, target, sections=sections)


def stress_range(bodies: Bodies) -> tuple[float, float]:
    """Return the default range of the colours, from zero to a round number above a high quantile."""
    top = float(np.quantile(np.concatenate([body["von_mises"] for body in bodies.values()]), QUANTILE))
    if top <= 0:
        return 0.0, 1.0
    step = 10.0 ** np.floor(np.log10(top)) / 2
    return 0.0, float(step * np.ceil(top / step))


def chosen_scale(bodies: Bodies) -> float:
    """Return the round factor, at least 1, that makes the displacement visible."""
    moved, extent = max(float(lengths(body).max()) for body in bodies.values()), np.ptp(points_of(bodies), 0)
    return max(1.0, nice_number(VISIBLE * float(extent.max()) / moved)) if moved > 0 else 1.0
