"""Pictures of a field in the deformed bodies, with sections through the contact."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pyvista as pv
from matplotlib.colors import Normalize

from fenics_contact.contact import State
from fenics_contact.errors import InvalidInputError
from fenics_contact.viz.colours import SIGNED_MAP, STRESS_MAP
from fenics_contact.viz.fields import (
    Bodies,
    component,
    contact_places,
    drawn_bodies,
    field_entries,
    lengths,
    linear,
    moved,
    nodal,
    points_of,
    rounded_up,
)  # fmt: skip
from fenics_contact.viz.obstacles import obstacles_of
from fenics_contact.viz.painting import paint
from fenics_contact.viz.paints import Paints
from fenics_contact.viz.picture import Picture, png_path
from fenics_contact.viz.section import Spot, strongest_contact
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
    if scale is not None:
        checked_scale(scale)
    checked_reach(reach)
    given = None if clim is None else checked_range(clim)
    bodies, obstacles = drawn_bodies(state), obstacles_of(state)
    # With magnified displacement bodies would penetrate rigid obstacles.
    factor = float(scale) if scale is not None else 1.0 if obstacles else chosen_scale(bodies)
    by_cell, named = np.concatenate([body["von_mises"] for body in bodies.values()]), units or Units()
    facts = f"von Mises stress, largest mean over a cell {written(float(by_cell.max()))} {named.stress}"
    values = {
        name: nodal(body, "von_mises") if smooth else body["von_mises"] for name, body in bodies.items()
    }
    norm = Normalize(*(given or (0.0, rounded_up(float(np.quantile(by_cell, QUANTILE))))))
    words = headline(title, f"{facts}; displacement × {factor:g}")
    label = f"von Mises stress ({named.stress})"
    paints = Paints(values, STRESS_MAP, norm, label, words, factor, reach, named, width)
    spot = contact_spot(state, bodies) if sections else None
    return paint(bodies, paints, target, obstacles=obstacles, spot=spot, comm=state.torn.decomposition.comm)


def plot_field(
    bodies: Mapping[str, pv.UnstructuredGrid],
    field: str = "von_mises",
    path: str | Path | None = None,
    *,
    scale: float = 1.0,
    title: str = "",
    units: Units | None = None,
    width: int = 1600,
) -> Picture:
    """Draw any field of bodies, such as those of `State.to_pyvista` or of a file of results.

    Args:
        bodies: Name -> body with its fields.
        field: Name of the field: that in the file, with the name of a component for stresses, as in
            "stress_xx" and "principal_stress_1", and for vectors, as in "displacement_x".
        path: PNG file to write, None to write none.
        scale: Factor of the displacement.
        title: Text before the facts in the title.
        units: Names of the units, mm, N and MPa unless given.
        width: Width of the picture in pixels.

    Returns:
        The picture, which can be used like a path to its file.

    Raises:
        InvalidInputError: If there is no such field, or an option or the name of the file cannot be used.
        MissingRequirementError: If this machine cannot render.
    """
    target, named = png_path(path), units or Units()
    checked_scale(scale)
    bodies = {name: linear(name, body) for name, body in bodies.items()}
    entries = {entry["name"]: entry for entry in field_entries([bodies], named)}
    if field not in entries:
        raise InvalidInputError(
            f"field must be one of {', '.join(entries)}, got {field!r}: choose one of them"
        )
    entry = entries[field]
    values = {name: component(body, entry) for name, body in bodies.items()}
    ends = entry["extremes"][0] or (-1.0, 2.0)
    label = f"{entry['label']} ({entry['unit']})" if entry["unit"] else entry["label"]
    facts = f"{entry['label']}, {written(ends[0])} to {written(ends[1])} {entry['unit']}".rstrip()
    colours = SIGNED_MAP if entry["colours"] == "signed" else STRESS_MAP
    words = headline(title, f"{facts}; displacement × {scale:g}")
    paints = Paints(
        values, colours, Normalize(*entry["range"]), label, words, float(scale), None, named, width
    )
    return paint(bodies, paints, target, obstacles=[])


def checked_scale(scale: float) -> None:
    """Raise unless a factor of the displacement is finite."""
    if not np.isfinite(scale):
        raise InvalidInputError(
            f"scale must be finite, got {scale}: give the factor of the displacement, such as 10"
        )


def contact_spot(state: State, bodies: Bodies) -> Spot | None:
    """Return the strongest contact of a state, None if no contact carries force."""
    if not np.any(state.contact.normal_force > 0):
        return None
    return strongest_contact(state.contact, contact_places(state, moved(bodies, 1.0)))


def chosen_scale(bodies: Bodies) -> float:
    """Return the round factor, at least 1, that makes the displacement visible."""
    largest = max((float(lengths(body).max()) for body in bodies.values()), default=0.0)
    extent = float(np.ptp(points_of(bodies), axis=0).max())
    return max(1.0, nice_number(VISIBLE * extent / largest)) if largest > 0 else 1.0
