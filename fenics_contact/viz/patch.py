"""A contact surface projected to a plane, seen from its master, or unrolled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fenics_contact.contact import State, Status
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh import vector_areas
from fenics_contact.surfaces import filled_at_corners
from fenics_contact.viz.unrolling import Unrolling, unrolling_of
from fenics_contact.viz.view import Frame, View, face_on


@dataclass(frozen=True)
class ContactPatch:
    """The slave surface projected to a plane or unrolled, and its contact points.

    Attributes:
        unrolling: How the surface is unrolled instead, or None.
        places: All nodes of the surface in the picture, (n, 2).
        pressure: On all nodes of the surface, interpolated at the corners of quadratic triangles, (n,).
        slip: Of the contact points in the picture, (n_points, 2).
    """

    view: View
    unrolling: Unrolling | None
    name: str
    places: np.ndarray
    facets: np.ndarray
    pressure: np.ndarray
    points: np.ndarray
    status: np.ndarray
    slip: np.ndarray
    force: float
    rubs: bool
    hidden: int
    frame: Frame

    @property
    def slips(self) -> np.ndarray:
        """Which contact points slip against friction."""
        return (self.status == Status.SLIP) & self.rubs

    @property
    def behind(self) -> str:
        """What is not shown, "; 12 of 80 closed points face away", or ""."""
        closed = self.hidden + int(np.count_nonzero(self.status != Status.OPEN))
        return f"; {self.hidden} of {closed} closed points face away" if self.hidden else ""

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


def contact_patches(states: Sequence[State], pair: int, reach: float | None) -> list[ContactPatch]:
    """Show the slave surface of a pair in several states alike.

    It is projected to a plane. If facets that face away carry force it is unrolled, provided that it runs
    around an axis.
    """
    patches = [_patch(state, pair, reach, None) for state in states]
    behind = next((state for state, patch in zip(states, patches, strict=True) if patch.hidden), None)
    if behind is None:
        return patches
    contact, slave = behind.contact, behind.scene.contacts[pair].slave
    points, chosen = behind.scene.bodies[slave.body].mesh.points, behind.contact.on_pair(pair)
    places, force = behind.contact_places[chosen], contact.normal_force[chosen]
    unrolling = unrolling_of(points, behind.scene.facets(slave), places, force)
    return patches if unrolling is None else [_patch(state, pair, reach, unrolling) for state in states]


def _patch(state: State, pair: int, reach: float | None, unrolling: Unrolling | None) -> ContactPatch:
    """Unroll the slave surface, or project it to a plane without the facets that face away."""
    contact, slave = state.contact, state.scene.contacts[pair].slave
    mesh, facets = state.scene.bodies[slave.body].mesh, state.scene.facets(slave)
    chosen = contact.on_pair(pair)
    force = float(contact.normal_force[chosen].sum())
    weight = contact.normal_force[chosen] if force > 0 else np.ones(len(chosen))
    view = face_on(-weight @ contact.points.normal[chosen])
    if unrolling is None:
        facing = facets[vector_areas(mesh.points, facets) @ view.towards > 0]
        node, rows = np.unique(facing, return_inverse=True)
        places = view.project(mesh.points[node])
    else:
        node, places, rows = unrolling.unroll(mesh.points, facets)
    nodes, first = np.unique(node, return_index=True)
    numbers = state.torn.decomposition.tearing.global_nodes(slave.body, nodes)
    seen = np.isin(contact.points.slave[chosen], numbers)
    hidden = int(np.count_nonzero(~seen & (contact.normal_force[chosen] > 0)))
    chosen = chosen[seen]
    points = first[np.searchsorted(numbers, contact.points.slave[chosen])]
    pressure = np.zeros(mesh.n_nodes)
    pressure[node[points]] = contact.pressure[chosen]
    pressure = np.maximum(filled_at_corners(mesh.surfaces[slave.name], pressure)[node], 0.0)
    slip = contact.slip_in_space[chosen]
    return ContactPatch(
        view, unrolling, f"{slave.body}, {slave.name}", places, rows.reshape(-1, facets.shape[1]), pressure,
        points, contact.status[chosen],
        view.project(slip) if unrolling is None else unrolling.turn(slip, mesh.points[node[points]]),
        force, state.scene.contacts[pair].has_friction, hidden,
        _frame(places, points, pressure[points], contact.points.area[chosen], reach),
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
    border = 0.1 * min(half, float(np.ptp(places, axis=0).min()))
    low, high = places.min(axis=0) - border, places.max(axis=0) + border
    return Frame(np.maximum(middle - half, low), np.minimum(middle + half, high))
