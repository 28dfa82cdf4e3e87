"""The balance of all forces on the bodies of a scene."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact._libraries import MPI
from fenics_contact.checks import GivenVector
from fenics_contact.contact.nodal_forces import NodalForces, by_node
from fenics_contact.contact.reactions import point_load
from fenics_contact.contact.resultant import Resultant, point_of, resultant, table
from fenics_contact.display import displayed
from fenics_contact.feti import TornSystem
from fenics_contact.linalg import ROUNDING
from fenics_contact.scene import RigidSurface, Surface


@displayed
@dataclass(frozen=True, eq=False)
class Balance:
    """Forces and moments on all bodies together, about one point, and what is missing to equilibrium.

    Moments on bodies of small strain are those of the undeformed geometry, as in their linear theory, on
    bodies that deform much those of the deformed one. The imbalance is
    governed by the equilibrium of the multipliers with the load (``State.solution.coarse_residual``), which
    every step of a solver keeps to rounding; for one body without multipliers by the rounding of its
    factorisation, which is larger in slender bodies. It says that no force was forgotten, not how accurate
    the forces are. That is governed by the tolerance of the solver, and by the mesh.

    Attributes:
        loads: Of the loads.
        reactions: Of all supports.
        obstacles: Of rigid obstacles.
        gaps: Of contacts and ties between bodies: both sides together have no force, but a moment where
            friction, a tie or a mean over facets transmits forces across a gap between the meshes, or where
            one body has moments about undeformed places and the other about deformed ones.
        beds: Of materials that resist rigid motions, such as elastic beds; zero otherwise.
        force_scale: Largest sum of the sizes of the nodal forces of one of these, [force]; where nothing acts
            a force below which bodies count as free of forces.
        moment_scale: Largest sum of the sizes of nodal forces times their distances from the point,
            [force·length]; never zero by symmetry, as are the moments of forces that point at the point.
    """

    loads: Resultant
    reactions: Resultant
    obstacles: Resultant
    gaps: Resultant
    beds: Resultant
    force_scale: float
    moment_scale: float

    @property
    def parts(self) -> dict[str, Resultant]:
        """All parts by name."""
        return {name: getattr(self, name) for name in ("loads", "reactions", "obstacles", "gaps", "beds")}

    @property
    def total(self) -> Resultant:
        """The sum of all parts, zero in equilibrium."""
        forces, moments = zip(*((part.force, part.moment) for part in self.parts.values()), strict=True)
        return Resultant(np.sum(forces, axis=0), np.sum(moments, axis=0), self.loads.about)

    @property
    def imbalance(self) -> float:
        """The larger of the total force and moment, each relative to its scale, dimensionless."""
        return self._relative(self.total)

    def _relative(self, part: Resultant) -> float:
        force, moment = np.linalg.norm(part.force), np.linalg.norm(np.atleast_1d(part.moment))
        return float(max(force / (self.force_scale or 1.0), moment / (self.moment_scale or 1.0)))

    def __str__(self) -> str:
        """Return a table of all parts that are not zero, their total and the imbalance."""
        shown = {name: part for name, part in self.parts.items() if self._relative(part) > ROUNDING}
        shown["total"] = self.total
        scales = self.force_scale, self.moment_scale
        lines = table([(name,) for name in shown], tuple(shown.values()), scales)
        return f"{lines}\nimbalance {self.imbalance:.1e}"


def rounding_force(torn: TornSystem, displacement: np.ndarray) -> float:
    """Return a force far above what rounding makes of a displacement, and far below one that strains by it.

    Collective.

    Args:
        torn: The system, of linear materials.
        displacement: u of this rank, torn, shape (torn_size,), [length].
    """
    comm = torn.decomposition.comm
    stiff = max((float(part.stiffness.diagonal().max()) for part in torn.subdomains), default=0.0)
    square, count = comm.allreduce(np.array([displacement @ displacement, displacement.size]))
    return float(np.sqrt(ROUNDING * square / count) * comm.allreduce(stiff, op=MPI.MAX))


def force_balance(
    torn: TornSystem, forces: NodalForces, about: GivenVector | np.ndarray | None, least: float
) -> Balance:
    """Return the balance of all forces, about a point or the middle of the box around all bodies.

    Args:
        torn: The system.
        forces: Forces of all nodes.
        about: The point, or None.
        least: A force below which bodies count as free of forces, [force].
    """
    point = _middle(forces.places) if about is None else point_of(about, torn.dim)
    parts = _parts(torn, forces)
    resultants = {name: resultant(force, forces.places, point) for name, force in parts.items()}
    for support in torn.scene.supports:
        if isinstance(support, RigidSurface):  # the load at its point comes in through its nodes
            resultants["loads"] += point_load(support, point)
            resultants["reactions"] -= point_load(support, point)
    arms = forces.places - point
    sizes = [np.linalg.norm(force, axis=1) for force in parts.values()]
    reach = np.linalg.norm(arms, axis=1)
    return Balance(
        **resultants,
        force_scale=float(max(least, *(size.sum() for size in sizes))),
        moment_scale=float(max(least * reach.max(), *(size @ reach for size in sizes))),
    )


def _parts(torn: TornSystem, forces: NodalForces) -> dict[str, np.ndarray]:
    """Return the nodal forces of each part, shape (n_nodes, dim)."""
    between = np.array([isinstance(pair.master, Surface) for pair in torn.scene.contacts], dtype=bool)
    meets_body = between[torn.points.pair]
    tied = by_node(torn.ties, forces.tie, np.arange(torn.ties.count))
    return {
        "loads": forces.load,
        "reactions": forces.reaction,
        "obstacles": by_node(torn.points, forces.contact, np.flatnonzero(~meets_body)),
        "gaps": by_node(torn.points, forces.contact, np.flatnonzero(meets_body)) + tied,
        "beds": forces.bed,
    }


def _middle(places: np.ndarray) -> np.ndarray:
    """Return the middle of the box around all bodies, shape (dim,)."""
    return np.asarray(0.5 * (places.min(axis=0) + places.max(axis=0)))
