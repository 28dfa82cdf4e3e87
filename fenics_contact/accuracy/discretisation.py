"""How far a displacement is from that of a mesh without end: the recovery estimate of the discretisation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from mpi4py import MPI

from fenics_contact.accuracy.recovery import recovered_gradients
from fenics_contact.accuracy.sites import find_sites, nodal_displacement
from fenics_contact.accuracy.strain_energy import Forms, energy_of_difference, prepare
from fenics_contact.feti import TornSystem
from fenics_contact.feti.subdomain import Subdomain
from fenics_contact.scene import Body


@dataclass(frozen=True, eq=False)
class DiscretisationError:
    """Estimates of the discretisation error in the norm √∫ C ε : ε, [√(force · length)].

    Attributes:
        total: Of all bodies together.
        by_body: Body name -> its part; the sum of squares is that of `total`.
    """

    total: float
    by_body: Mapping[str, float]
    _comm: MPI.Comm = field(repr=False)
    _sizes: Mapping[str, int] = field(repr=False)
    _own: Mapping[str, tuple[np.ndarray, np.ndarray]] = field(repr=False)

    def by_cell(self, body: str) -> np.ndarray:
        """Return the part of each cell of a body in the body's order, shape (n_cells,), replicated.

        Collective.
        """
        values = np.zeros(self._sizes[body])
        cells, squares = self._own[body]
        values[cells] = np.sqrt(squares)
        return np.asarray(self._comm.allreduce(values))


def discretisation_error(torn: TornSystem, displacement: np.ndarray) -> DiscretisationError:
    """Estimate the discretisation error of a displacement. Collective.

    On each cell η² = ∫ C (ε* − ε) : (ε* − ε) with the strain ε of the displacement and the strain ε* of a
    recovered gradient, which is continuous within one material of one body (see `recovery`). Strains by
    temperature are in both and drop out. The estimate is asymptotically exact where the solution is smooth;
    it is no bound. It knows nothing of the geometry's error where facets stand for a curved surface, and
    nothing of a body of one cell.

    Args:
        torn: The torn system.
        displacement: This rank's torn displacement, shape (torn_size,), [length].

    Returns:
        The estimate.
    """
    scene, decomposition = torn.scene, torn.decomposition
    forms = prepare(decomposition, scene.bodies.values())
    sites = find_sites(torn)
    nodal = nodal_displacement(torn, displacement)
    gradients = recovered_gradients(sites, nodal[sites.node])
    cells: dict[str, list[np.ndarray]] = {name: [np.zeros(0, dtype=np.int64)] for name in scene.bodies}
    squares: dict[str, list[np.ndarray]] = {name: [np.zeros(0)] for name in scene.bodies}
    for subdomain, of_cells in zip(torn.subdomains, sites.of_cells, strict=True):
        mesh = subdomain.mesh
        cells[mesh.body].append(mesh.cells)
        body = scene.bodies[mesh.body]
        u = nodal[decomposition.tearing.global_nodes(mesh.body, mesh.nodes)]
        squares[mesh.body].append(_squares(subdomain, body, forms, u, gradients, of_cells))
    own = {name: (np.concatenate(cells[name]), np.concatenate(squares[name])) for name in scene.bodies}
    sums = decomposition.comm.allreduce(np.array([values.sum() for _, values in own.values()]))
    by_body = {name: float(np.sqrt(value)) for name, value in zip(own, sums, strict=True)}
    sizes = {name: body.mesh.n_cells for name, body in scene.bodies.items()}
    return DiscretisationError(float(np.sqrt(sums.sum())), by_body, decomposition.comm, sizes, own)


def _squares(
    subdomain: Subdomain,
    body: Body,
    forms: Forms,
    displacement: np.ndarray,
    gradients: np.ndarray,
    of_cells: np.ndarray,
) -> np.ndarray:
    """Return η² of the cells of one subdomain, shape (n_cells,), [force · length].

    Args:
        subdomain: The subdomain.
        body: Its body.
        forms: Forms of all materials.
        displacement: Displacement by block of the subdomain, shape (n, dim), [length].
        gradients: Recovered gradient of every site, shape (n_sites, dim, dim).
        of_cells: Sites of its cells, shape (n_cells, n_vertices).
    """
    mesh = subdomain.mesh
    order = np.argsort(mesh.nodes)
    block = order[np.searchsorted(mesh.nodes[order], body.mesh.cells[mesh.cells])]
    kind = body.material_of_cells[mesh.cells]
    result = np.zeros(len(mesh.cells))
    for number in np.unique(kind):
        # Where materials meet a node has several recovered gradients: one material at a time.
        cells, material = np.flatnonzero(kind == number), body.materials[number]
        by_block = np.zeros((len(mesh.nodes), *gradients.shape[1:]))
        by_block[block[cells]] = gradients[of_cells[cells]]
        form = forms[material, body.mesh.cell_type]
        result[cells] = energy_of_difference(form, material, subdomain, displacement, by_block)[cells]
    return result
