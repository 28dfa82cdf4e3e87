"""Drawing a field on the bodies of a state, in the plane or in space."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import BinaryIO

import numpy as np

from fenics_contact.contact import State
from fenics_contact.viz.fields import Moved
from fenics_contact.viz.painting_in_plane import contact_window, draw_in_plane
from fenics_contact.viz.painting_in_space import draw_in_space
from fenics_contact.viz.paints import Paints
from fenics_contact.viz.picture import Picture, draw_picture
from fenics_contact.viz.places import contact_places
from fenics_contact.viz.section import strongest_contact


def paint(
    state: State, bodies: Mapping[str, Moved], paints: Paints, path: Path | None, *, sections: bool
) -> Picture:
    """Draw a field on all bodies, with details of the strongest contact. Collective.

    Args:
        state: The state.
        bodies: Its bodies.
        paints: The field.
        path: PNG file to write, or None.
        sections: Draw the details too, if a contact carries force.
    """
    places = contact_places(state, {name: body.deformed(1.0) for name, body in bodies.items()})
    touching = sections and bool(np.any(state.contact.normal_force > 0))

    def draw(paper: BinaryIO) -> None:
        if state.scene.dim == 2:
            window = contact_window(state.contact, places, paints.reach) if touching else None
            draw_in_plane(state.scene, bodies, window, paper, paints)
            return
        spot = strongest_contact(state.contact, places) if touching else None
        draw_in_space(state.scene, bodies, spot, paper, paints)

    return draw_picture(state.torn.decomposition.comm, path, draw)
