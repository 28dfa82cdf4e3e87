"""A contact surface projected to a plane, seen from its master."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.contact import State, Status
from fenics_contact.errors import InvalidInputError
from fenics_contact.surfaces import filled_at_corners
from fenics_contact.viz.view import Frame, View, face_on


@dataclass(frozen=True)
class ContactPatch:
    """The slave surface projected to a plane, and its contact points.

    Attributes:
        view: The direction of view.
        name: Body and surface.
        places: All nodes of the surface in the picture, (n, 2).
        facets: Rows of positions in ``places``.
        pressure: On all nodes of the surface, interpolated at the corners of quadratic triangles, (n,).
        points: Positions of the contact points in ``places``.
        status: Of the contact points.
        slip: Of the contact points in the picture, (n_points, 2).
        force: Normal force of the pair.
        rubs: Whether the pair has friction.
        frame: The visible frame.
    """

    view: View
    name: str
    places: np.ndarray
    facets: np.ndarray
    pressure: np.ndarray
    points: np.ndarray
    status: np.ndarray
    slip: np.ndarray
    force: float
    rubs: bool
    frame: Frame

    @property
    def slips(self) -> np.ndarray:
        """Which contact points slip against friction."""
        return (self.status == Status.SLIP) & self.rubs

    @property
    def largest_slip(self) -> float:
        """Their largest slip, [length]."""
        return float(np.linalg.norm(self.slip[self.slips], axis=1).max(initial=0.0))


def checked_pair(state: State, pair: int) -> None:
    """Reject a number that no contact pair of the scene has."""
    if not 0 <= pair < len(state.scene.contacts):
        raise InvalidInputError(
            f"pair must number one of the scene's {len(state.scene.contacts)} contact pairs from 0, got "
            f"{pair}: draw a scene with contact"
        )


def contact_patch(state: State, pair: int, reach: float | None) -> ContactPatch:
    """Project the slave surface of a pair to a plane; facets that face away from the viewer are omitted.

    Args:
        state: The state.
        pair: Number of the contact pair.
        reach: Extent around the contact's centre, [length], or None.
    """
    contact, slave = state.contact, state.scene.contacts[pair].slave
    mesh, facets = state.scene.bodies[slave.body].mesh, state.scene.facets(slave)
    chosen = contact.on_pair(pair)
    force = float(contact.normal_force[chosen].sum())
    weight = contact.normal_force[chosen] if force > 0 else np.ones(len(chosen))
    view = face_on(-weight @ contact.points.normal[chosen])
    corners = mesh.points[facets]
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    nodes, local = np.unique(facets[outward @ view.towards > 0], return_inverse=True)
    numbers = state.torn.decomposition.tearing.global_nodes(slave.body, nodes)
    chosen = chosen[np.isin(contact.points.slave[chosen], numbers)]
    points = np.searchsorted(numbers, contact.points.slave[chosen])
    pressure = np.zeros(mesh.n_nodes)
    pressure[nodes[points]] = contact.pressure[chosen]
    pressure = np.maximum(filled_at_corners(mesh.surfaces[slave.name], pressure)[nodes], 0.0)
    places = view.project(mesh.points[nodes])
    frame = _frame(places, points, pressure[points], contact.points.area[chosen], reach)
    return ContactPatch(
        view, f"{slave.body}, {slave.name}", places, local.reshape(-1, facets.shape[1]), pressure, points,
        contact.status[chosen], view.project(contact.slip_in_space[chosen]), force,
        state.scene.contacts[pair].has_friction, frame,
    )  # fmt: skip


def _frame(
    places: np.ndarray, points: np.ndarray, pressure: np.ndarray, area: np.ndarray, reach: float | None
) -> Frame:
    """Return a square around the closed points with a margin of two facets.

    Unless its size is given, it is limited to slightly more than the surface.
    """
    closed = pressure > 0 if np.any(pressure > 0) else np.ones(len(points), dtype=bool)
    low, high = places[points[closed]].min(axis=0), places[points[closed]].max(axis=0)
    middle = (low + high) / 2
    if reach is not None:
        return Frame(middle - reach, middle + reach)
    half = float(np.max(high - low)) / 2 + 2.5 * float(np.sqrt(area[closed].mean()))
    border = 0.1 * min(half, float(np.ptp(places, axis=0).max()) / 2)
    low, high = places.min(axis=0) - border, places.max(axis=0) + border
    return Frame(np.maximum(middle - half, low), np.minimum(middle + half, high))
