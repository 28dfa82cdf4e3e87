"""The area in which surfaces touch, and its width."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np

from fenics_contact._base.checks import GivenVector, naming_arguments, unit_vector
from fenics_contact._scene.pair_geometry import modulus_of
from fenics_contact._scene.pairs import pair_number
from fenics_contact._scene.parts import surface_of
from fenics_contact._scene.thickness import thickness_on
from fenics_contact._surfaces.facets import filled_at_corners, nodal_areas
from fenics_contact.materials.elastic import thickness_of
from fenics_contact.materials.plastic import has_history
from fenics_contact.results.contact import Status
from fenics_contact.results.state import State


@naming_arguments
def contact_area(state: State, pair: int | str = 0) -> float:
    """Return the area in which the surfaces of a pair touch, in the plane the length, [length²] or [length].

    On bodies of revolution it is that all around the axis, on plane ones with a thickness that of all of it.

    It is measured on the slave, on the deformed one where its material is made for large deformations.
    Its rim runs between closed and open nodes and is located by pressure and gap: at a distance d inside the
    rim of a smooth contact the pressure is K √d, at a distance d outside the gap is 4/3 K d^(3/2) / E* with
    the same K. The sum of closed nodes' areas would jump from node to node, by a quarter where only a few are
    closed. Where a modulus varies within a material, or metal may yield, the rim is placed half way between
    the nodes. Where the master ends, by mortar the part of the slave counts that faces it, by nodes half a
    facet beyond the last node that does. Collective.

    Args:
        state: The state.
        pair: Number of the contact pair in the scene, or its name: its slave, as in "lid bottom", or both
            surfaces.

    Raises:
        InvalidInputError: If the scene has no such pair.

    References:
        Johnson, K. L.: Contact Mechanics. Cambridge University Press (1985), sections 3.2 and 5.1.
    """
    contact = state.contact
    return _area(state, _slave_surface(state, pair, contact.pressure * (contact.status > 0), contact.gap))


def stick_area(state: State, pair: int | str = 0) -> float:
    """Return the area in which the surfaces of a pair stick, in the plane the length, [length²] or [length].

    As `contact_area`, with what friction could still transmit in place of the pressure, and slips and gaps in
    place of gaps: at a distance d inside the rim of a zone that sticks (Ψ − ‖τ‖)/A is K √d, at a distance d
    outside the slip is 4/3 K d^(3/2) / E* with the same K, in the plane; in space the slip is larger by up to
    1/(1 − ν). Collective; raises as `contact_area` does.

    References:
        Johnson, K. L.: Contact Mechanics. Cambridge University Press (1985), section 7.2.
    """
    contact = state.contact
    remaining = contact.slip_bound - np.linalg.norm(contact.friction_force, axis=1)
    inside = np.maximum(remaining, 0.0) / contact.area * (contact.status == Status.STICK)
    apart = np.linalg.norm(contact.slip, axis=1) + np.maximum(contact.gap, 0.0)
    return _area(state, _slave_surface(state, pair, inside, apart))


def _area(state: State, surface: _SlaveSurface) -> float:
    """Return the area within the rim."""
    measure, total, facing = state.scene.kinematics.measure, 0.0, np.where(surface.given, 0.0, surface.facing)
    for corners, weight in _simplices(surface.facets.shape[1]):
        facets = surface.facets[:, corners]
        edges = surface.places[facets[:, 1:]] - surface.places[facets[:, :1]]
        gram = np.linalg.det(edges @ np.swapaxes(edges, 1, 2))
        size = np.sqrt(np.maximum(gram, 0.0)) / (len(corners) - 1)
        share = surface.closed_share(facets)
        size = size * facing[facets].mean(axis=1)
        size = size * measure.around_closed(surface.places[facets, 0], surface.closed[facets], share)
        total += weight * float(size @ share)
    return surface.thickness * total


@naming_arguments
def contact_width(state: State, direction: GivenVector, pair: int | str = 0) -> float:
    """Return how far the area in which the surfaces of a pair touch reaches along a direction, [length].

    From its first to its last point, as `contact_area` locates its rim, with all that is open between them:
    the width of a roller's footprint, the diameter of a ball's; in a half model, half of it. Zero where
    nothing touches. Collective.

    Args:
        state: The state.
        direction: The direction, of any length, shape (dim,).
        pair: As for `contact_area`.

    Raises:
        InvalidInputError: If the scene has no such pair, or the direction does not fit the space.

    Example:
        >>> contact_width(state, (1, 0, 0), "tyre tread")  # doctest: +SKIP
    """
    along = np.array(unit_vector("the direction of a contact width", direction, state.scene.dim))
    contact = state.contact
    surface = _slave_surface(state, pair, contact.pressure * (contact.status > 0), contact.gap)
    ends = [surface.places[surface.closed] @ along]
    for corners, _ in _simplices(surface.facets.shape[1]):
        for first, second in combinations(corners, 2):
            ends.append(surface.rim(surface.facets[:, [first, second]]) @ along)
    reached = np.concatenate(ends)
    return float(np.ptp(reached)) if reached.size else 0.0


@dataclass(frozen=True)
class _SlaveSurface:
    """A slave surface, with what locates the rim of the contact on it.

    `places`: its nodes, deformed if its body deforms much; `pressure`: of closed nodes, zero at open ones;
    `spread`: E* times the gap of open nodes; `facing`: share of each node's area that faces the master, zero
    at nodes without a contact point; `given`: marks of nodes whose area is among those of their neighbours;
    `beyond`: how far contact reaches on the way to nodes without a contact point, relative to the distance;
    `thickness`: that of a plane body, one without.
    """

    places: np.ndarray
    facets: np.ndarray
    pressure: np.ndarray
    spread: np.ndarray
    facing: np.ndarray
    given: np.ndarray
    beyond: float
    thickness: float

    @cached_property
    def closed(self) -> np.ndarray:
        """Marks of the nodes that touch, shape (n,)."""
        return self.pressure > 0.0

    def reach(self, one: np.ndarray, other: np.ndarray) -> np.ndarray:
        """Return how far contact reaches from closed towards open nodes, relative to their distances."""
        length = np.linalg.norm(self.places[one] - self.places[other], axis=1)
        return _reach(self.pressure[one], self.spread[other], length)

    def rim(self, edges: np.ndarray) -> np.ndarray:
        """Return where the rim crosses edges, (n_edges, 2), of which one end is closed, (m, dim)."""
        crossed = edges[self.closed[edges].sum(axis=1) == 1]
        inner, outer = np.where(self.closed[crossed[:, :1]], crossed, crossed[:, ::-1]).T
        share = np.where(self.facing[outer] > 0.0, self.reach(inner, outer), self.beyond)[:, None]
        return np.asarray((1.0 - share) * self.places[inner] + share * self.places[outer])

    def closed_share(self, facets: np.ndarray) -> np.ndarray:
        """Return the share of simplices that touches, shape (n,).

        The rim cuts off one corner: a triangle whose sides are the parts of the edges that meet there.
        """
        inside = self.closed[facets]
        count = inside.sum(axis=1)
        share = (count == facets.shape[1]).astype(float)
        cut = np.flatnonzero((count > 0) & (count < facets.shape[1]))
        single = np.where(count == 1, 1, 0)[cut, None] == inside[cut]  # the corner that differs from others
        alone = np.argmax(single, axis=1)
        product = np.ones(len(cut))
        for step in range(1, facets.shape[1]):
            corner = facets[cut, alone]
            other = facets[cut, (alone + step) % facets.shape[1]]
            here = self.closed[corner]
            reach = self.reach(np.where(here, corner, other), np.where(here, other, corner))
            product *= np.where(here, reach, 1.0 - reach)
        share[cut] = np.where(self.closed[facets[cut, alone]], product, 1.0 - product)
        return share


def _slave_surface(state: State, which: int | str, inside: np.ndarray, apart: np.ndarray) -> _SlaveSurface:
    """Return the slave surface of a pair. Collective.

    `inside`: pressure of all contact points that touch, zero at others; `apart`: their gaps.
    """
    scene, contact = state.scene, state.contact
    pair = pair_number(scene.contacts, which)
    points, slave = contact.points, scene.contacts[pair].slave
    surface = surface_of(scene, slave, "faceted")
    nodes = state.torn.decomposition.tearing.global_nodes(slave.body, surface.nodes)
    # A point may have the areas of several nodes, as those on both sides of a sector.
    own, point = points.of_surface(pair, np.arange(points.count))
    place = np.searchsorted(nodes, own)
    # Nodes without a contact point are open without a gap: neighbouring contact reaches up to them.
    pressure, spread = np.zeros(len(nodes)), np.zeros(len(nodes))
    pressure[place] = inside[point]
    spread[place] = _modulus(state, pair) * np.maximum(apart[point], 0.0)
    whole = np.searchsorted(surface.nodes, scene.bodies[slave.body].mesh.surfaces[slave.name])
    known = np.isin(np.arange(len(nodes)), place)
    fill = scene.bodies[slave.body].mesh.hanging.filled(surface.nodes, known)
    pressure, spread = fill @ pressure, fill @ spread
    by_mortar = scene.contacts[pair].by_mortar
    if not by_mortar:
        pressure, spread = (filled_at_corners(whole, each) for each in (pressure, spread))
        spread = np.maximum(spread, 0.0)
    on_axis = scene.bodies[slave.body].on_axis[surface.nodes]
    if scene.axisymmetric and not by_mortar:
        pressure = np.maximum(scene.kinematics.measure.filled(whole, pressure, on_axis), 0.0)
    places = surface.points
    if scene.bodies[slave.body].deforms_much:
        places = places + state.gather_displacement(slave.body)[surface.nodes]
    # Nodes that supports hold have no contact point either; by mortar their neighbours have their areas.
    held = scene.fixed(slave.body)[surface.nodes].all(axis=1)
    given = held & by_mortar
    facing = held.astype(float)
    facing[place] = 1.0
    thickness = thickness_on(scene.bodies[slave.body], slave.name, "the slave")
    if by_mortar:
        areas = nodal_areas(surface.points, surface.facets, scene.kinematics.measure).ravel()
        of_nodes = fill.T @ np.bincount(surface.facets.ravel(), areas)
        whole_area = thickness * np.bincount(point, of_nodes[place], points.count)
        facing[place] = contact.nominal_area[point] / whole_area[point]
    facing = fill @ facing
    if not by_mortar:
        facing = np.maximum(filled_at_corners(whole, facing), 0.0)
    if scene.axisymmetric and not by_mortar:
        facing = np.clip(scene.kinematics.measure.filled(whole, facing, on_axis), 0.0, 1.0)
    facets, beyond = surface.facets[:, : surface.corners], 0.0 if by_mortar else 0.5
    return _SlaveSurface(places, facets, pressure, spread, facing, given, beyond, thickness)


def _modulus(state: State, pair: int) -> float:
    """Return the contact modulus E* of a pair, 1/E* = Σ M / (M² − λ²) over the bodies; NaN if unknown.

    M and λ are the means of the moduli C_iiii and C_iijj; for isotropic bodies λ is Lamé's.
    """
    from fenics_contact._accuracy.discretisation import moduli  # not before an area is asked for

    scene, forms = state.scene, state.torn.decomposition.forms
    if scene.axisymmetric:
        return modulus_of(scene, scene.contacts[pair]) or float("nan")
    compliance = 0.0
    for surface in scene.contacts[pair].surfaces:
        body = scene.bodies[surface.body]
        remembers = has_history(body.materials[0])
        if remembers or forms.varies(body.materials[0], body.element):
            return float("nan")
        dim = scene.dim
        own = moduli(forms, body.materials[0], body.element)[:: dim + 1, :: dim + 1]
        own = own / (thickness_of(body.materials[0]) or 1.0)
        along = np.trace(own) / dim
        across = (own.sum() - np.trace(own)) / (dim * (dim - 1))
        compliance += along / (along**2 - across**2)
    return float(1.0 / compliance)


def _simplices(corners: int) -> list[tuple[list[int], float]]:
    """Return the triangles that represent a facet, with their weights; quadrilaterals are cut both ways."""
    if corners < 4:
        return [(list(range(corners)), 1.0)]
    return [([k, (k + 1) % 4, (k + 2) % 4], 0.5) for k in range(4)]


def _reach(
    pressure: np.ndarray, spread: np.ndarray, length: np.ndarray, newton_steps: int = 60
) -> np.ndarray:
    """Return how far contact reaches from a closed towards an open node, relative to their distance.

    p = K √d and E* g = 4/3 K (L − d)^(3/2); with y = K^(−2/3): p² y³ + (3/4 E* g)^(2/3) y = L.
    `newton_steps`: Newton steps to the root of a cubic, from above: sufficient in practice for any ratio of
    its coefficients.
    """
    if np.isnan(spread).any():
        return np.full(len(length), 0.5)
    slope = (0.75 * spread) ** (2.0 / 3.0)
    root = np.cbrt(length / pressure**2)  # convex and increasing: Newton's method descends to the root
    for _ in range(newton_steps):
        root -= (pressure**2 * root**3 + slope * root - length) / (3.0 * pressure**2 * root**2 + slope)
    return np.asarray(np.clip(pressure**2 * root**3 / length, 0.0, 1.0))
