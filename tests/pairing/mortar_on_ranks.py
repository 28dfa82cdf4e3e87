"""Mortar coupling on several ranks; run under mpirun, stores what every rank got."""

from __future__ import annotations

import sys

import numpy as np
from mpi4py import MPI

from fenics_contact._pairing.coupling_derivatives import CouplingDerivatives
from fenics_contact._pairing.mortar.coupling import mortar_coupling
from fenics_contact._pairing.mortar.derivatives import mortar_pulled_back
from fenics_contact._surfaces.facets import FacetedSurface, faceted_surface
from fenics_contact.errors import InvalidInputError
from tests.pairing.mortar_surfaces import plate

Numbers = dict[str, np.ndarray]


def pairs() -> dict[str, tuple[FacetedSurface, FacetedSurface]]:
    """Surfaces to couple; the last have fewer slave facets than there are ranks."""
    return {
        kind + str(cells): (
            plate(kind, cells, up=False, height=0.1, skew=1.0),
            plate(kind, 5, low=0.2, high=1.4, turn=0.3),
        )
        for kind in ("edges", "triangles", "quads")
        for cells in (6, 1)
    }


def collect(comm: MPI.Comm) -> Numbers:
    """Couple all pairs, and differentiate that, with the ranks' work shared."""
    numbers, rng = {}, np.random.default_rng(5)
    for name, (slave, master) in pairs().items():
        coupling = mortar_coupling(slave, master, comm)
        numbers[name + " node"], numbers[name + " area"] = coupling.node, coupling.area
        numbers[name + " weight"], numbers[name + " gap"] = coupling.weight.toarray(), coupling.gap
        count = len(coupling.node)
        by = CouplingDerivatives(
            rng.standard_normal(count), rng.standard_normal((count, 1)),
            rng.standard_normal((len(master.nodes), 1)), coupling.normal, rng.standard_normal(count),
        )  # fmt: skip
        by_slave, by_master = mortar_pulled_back(slave, master, coupling, by, comm)
        numbers[name + " by slave"], numbers[name + " by normals"] = by_slave.points, by_slave.normals
        numbers[name + " by master"] = by_master.points
    return numbers


def message_for_a_folded_facet(comm: MPI.Comm) -> str:
    """Couple a slave whose second facet is folded, which one rank alone meets."""
    points = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0], [1.2, 0.2, 0]])
    slave = faceted_surface(points, np.array([[3, 2, 1, 0], [1, 2, 5, 4]]))
    try:
        mortar_coupling(slave, plate("quads", 2), comm)
    except InvalidInputError as error:
        return str(error)
    return "nothing was raised"


if __name__ == "__main__":
    world = MPI.COMM_WORLD
    numbers, message = collect(world), message_for_a_folded_facet(world)
    everywhere = world.gather((numbers, message), root=0)
    if everywhere is not None:
        for mine, _ in everywhere[1:]:
            assert all(np.array_equal(mine[key], numbers[key]) for key in numbers), "ranks differ"
        np.savez(sys.argv[1], messages=np.array([text for _, text in everywhere]), **numbers)
