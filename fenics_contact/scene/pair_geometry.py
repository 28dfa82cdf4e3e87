"""Between which surfaces the gaps of contact pairs are measured, and the error of flat facets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from fenics_contact.display import displayed
from fenics_contact.scene.approach import displacement_along, force_along, hertz_approach, modulus_of
from fenics_contact.scene.chosen_discretisation import in_words
from fenics_contact.scene.pairs import ContactPair, Surface
from fenics_contact.scene.true_surfaces import surface_of
from fenics_contact.surface_shapes import Joined, Placed, SurfaceShape, evaluate_shape
from fenics_contact.surfaces import FacetedSurface, heights, project

if TYPE_CHECKING:
    from fenics_contact.scene.parts import SceneParts

#: Number of slave nodes that are examined, those nearest to the master.
MOST = 2000


@displayed
@dataclass(frozen=True)
class PairGeometry:
    """Between which surfaces the gaps of a contact pair are measured, and the error of flat facets.

    Attributes:
        slave: The slave's surface: the name of its shape (``"Torus"``), ``"reconstructed"``, ``"flat"`` where
            a surface through the nodes is that of the facets, or ``"facets"`` where these were requested.
        master: The same of the master; of a rigid obstacle the name of its class.
        height: Largest height of the true surface over the middles of its facets, [length], where the gap
            exceeds the smallest one by no more than the approach; everywhere if that is unknown. Of the
            master and, with mortar contact, also of the slave; zero on obstacles, as nodes lie on true
            surfaces, and where the pair gives all gaps.
        approach: Estimate of how far the bodies come closer, [length]: by Hertz's theory under the largest
            resultant of the loads on one body, or by the largest displacement along the normal that a support
            prescribes, if that is larger. None if neither is known.
        discretisation: Where contact is enforced, and why, see `ContactPair.reason`.
        given: What the pair gives in place of measured gaps, in words, see `ContactPair.given_gap`.
    """

    slave: str
    master: str
    height: float
    approach: float | None
    discretisation: str
    given: str = ""

    @property
    def share(self) -> float | None:
        """Error of the facets relative to the approach; None if that is unknown."""
        return None if not self.approach else self.height / self.approach

    def __str__(self) -> str:
        """Describe it in one line."""
        parts = f"{self.slave} on {self.master}", self.discretisation, self.given, "facets "
        words = "; ".join(filter(None, parts))
        if self.height == 0.0:
            return words + "miss nothing"
        share = self.share
        known = "of an unknown part" if share is None else f"{100 * share:.2g} %"
        by = "" if self.approach is None else f" (about {self.approach:.2g})"
        return words + f"miss it by up to {self.height:.2g}, {known} of the approach{by}"


@dataclass(frozen=True)
class _Meeting:
    """Nodes of a slave that face the master.

    Attributes:
        node: Which of the slave's, shape (n,).
        normal: Normals of the gaps, shape (n, dim).
        gap: Gaps, shape (n,), [length].
        facet: Facets of the master that they meet, shape (n,); none on an obstacle.
    """

    node: np.ndarray
    normal: np.ndarray
    gap: np.ndarray
    facet: np.ndarray


def pair_geometry(scene: SceneParts, pair: ContactPair) -> PairGeometry:
    """Return between which surfaces the gaps of a pair are measured."""
    geometry = "best" if pair.geometry == "faceted" else pair.geometry
    slave = surface_of(scene, pair.slave, geometry)
    name = _name(scene, pair, pair.slave, slave)
    if not isinstance(pair.master, Surface):
        met = _meeting_obstacle(slave, pair.master)
        approach = _approach(scene, pair, slave, met)
        return PairGeometry(name, _shape_name(pair.master), 0.0, approach, in_words(pair), pair.given_gap)
    master = surface_of(scene, pair.master, geometry)
    met = _meeting(slave, master)
    approach = _approach(scene, pair, slave, met)
    near = met.gap <= met.gap.min(initial=np.inf) + (np.inf if approach is None else approach)
    height = _largest_height(master, np.unique(met.facet[near]))
    if pair.by_mortar:
        touching = np.flatnonzero(np.isin(slave.facets, met.node[near]).any(axis=1))
        height = max(height, _largest_height(slave, touching))
    if pair.gives_all_gaps:
        height = 0.0
    names = name, _name(scene, pair, pair.master, master)
    return PairGeometry(*names, height, approach, in_words(pair), pair.given_gap)


def _name(scene: SceneParts, pair: ContactPair, surface: Surface, faceted: FacetedSurface) -> str:
    if pair.geometry == "faceted":
        return "facets"
    shape = scene.bodies[surface.body].mesh.origin.shapes.get(surface.name)
    if pair.geometry == "best" and shape is not None:
        return _shape_name(shape)
    return "flat" if faceted.relief is None else "reconstructed"


def _shape_name(shape: SurfaceShape) -> str:
    if isinstance(shape, Placed):
        return _shape_name(shape.shape)
    if isinstance(shape, Joined):
        return " and ".join(sorted({_shape_name(part) for part in shape.shapes}))
    return type(shape).__name__


def _meeting(slave: FacetedSurface, master: FacetedSurface) -> _Meeting:
    away, _ = cKDTree(master.points).query(slave.points)
    chosen = np.sort(np.argsort(away)[:MOST])
    hit = project(slave.points[chosen], slave.normals[chosen], master)
    return _Meeting(chosen[hit.point], hit.normal, hit.gap, hit.facet)


def _meeting_obstacle(slave: FacetedSurface, obstacle: SurfaceShape) -> _Meeting:
    normal = evaluate_shape(obstacle, "normals", slave.points)
    facing = np.flatnonzero(np.einsum("nd,nd->n", slave.normals, normal) < 0)
    gap = evaluate_shape(obstacle, "distance", slave.points[facing])
    return _Meeting(facing, normal[facing], gap, np.zeros(len(facing), dtype=np.int64))


def _approach(scene: SceneParts, pair: ContactPair, slave: FacetedSurface, met: _Meeting) -> float | None:
    """Return the estimate of `PairGeometry.approach`."""
    if len(met.node) == 0:
        return None
    middle = np.argmin(met.gap)
    normal, node = met.normal[middle], met.node[middle]
    sizes = [displacement_along(scene, normal)]
    force, modulus = force_along(scene, normal), modulus_of(scene, pair)
    if force is not None and modulus is not None:
        # Each plane of symmetry through the contact halves the force.
        whole = force * 2.0 ** np.count_nonzero(slave.mirrored[node])
        sizes.append(hertz_approach(whole, modulus, slave.points[met.node], met.normal, met.gap) or 0.0)
    return max(sizes) or None


def _largest_height(surface: FacetedSurface, facets: np.ndarray) -> float:
    middle = 1.0 / 3.0 if surface.corners == 3 else 0.0
    local = np.full((len(facets), surface.dim - 1), middle)
    return float(np.abs(heights(surface, facets, local).value).max(initial=0.0))
