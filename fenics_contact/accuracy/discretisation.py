"""Recovery-based estimate of the discretisation error of a displacement."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from fenics_contact._libraries import MPI
from fenics_contact.accuracy.moduli import moduli
from fenics_contact.accuracy.recovery import recovered_gradients
from fenics_contact.accuracy.sites import find_sites
from fenics_contact.accuracy.strain_energy import energy_of_difference
from fenics_contact.accuracy.varying_moduli import compile_energy, energy_on_subdomain
from fenics_contact.display import displayed
from fenics_contact.errors import InvalidInputError
from fenics_contact.fem import Template
from fenics_contact.feti import Subdomain, TornSystem, nodal_mean
from fenics_contact.scene import Body


@displayed
@dataclass(frozen=True, eq=False)
class DiscretisationError:
    """Estimates of the discretisation error in the norm √∫ C ε : ε, [√(force · length)].

    Attributes:
        total: That of all bodies together.
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

        Raises:
            InvalidInputError: If there is no such body.
        """
        if body not in self._sizes:
            raise InvalidInputError(
                f"body must be one of {sorted(self._sizes)}, got {body!r}: take a name of the scene"
            )
        values = np.zeros(self._sizes[body])
        cells, squares = self._own[body]
        values[cells] = np.sqrt(squares)
        return np.asarray(self._comm.allreduce(values))


def discretisation_error(torn: TornSystem, displacement: np.ndarray) -> DiscretisationError:
    """Estimate the discretisation error of a displacement. Collective.

    On each cell η² = ∫ C (ε* − ε) : (ε* − ε) with the strain ε of the displacement and the strain ε* of a
    recovered gradient, which is continuous within one material of one body (see `recovery`). Thermal strains
    are in both and cancel.

    It is not a bound. The ratio of estimate to error tends to 1 where the solution is smooth. It was measured
    between 0.7 and 1.1 for contact on two or more nodes, at 0.7 where clamped corners and edges between
    materials dominate, and at 0.9 for quadrilaterals that lock at ν = 0.499. A body one cell thick does not
    resolve how strains vary across it: there the estimate may be a quarter of the error; for a body of one
    cell it is meaningless. Where a mesh locks completely, the error exceeds the displacement and the estimate
    does not follow. The geometry error of facets on a curved surface is not included.

    Args:
        torn: The torn system.
        displacement: This rank's torn displacement, shape (torn_size,), [length]: that of a state is
            `State.conforming_displacement`. Where copies of a node differ, their mean is used.

    Returns:
        The estimate.
    """
    scene, comm = torn.scene, torn.decomposition.comm
    energies = {name: _Energies(torn, body) for name, body in scene.bodies.items()}
    nodal = nodal_mean(torn.decomposition, displacement)
    cells = {name: [np.zeros(0, dtype=np.int64)] for name in scene.bodies}
    squares = {name: [np.zeros(0)] for name in scene.bodies}
    for order in sorted({body.mesh.order for body in scene.bodies.values()}):
        sites = find_sites(torn, order)
        displacements = nodal[sites.node]
        gradients = recovered_gradients(sites, displacements)
        for subdomain in torn.subdomains:
            mesh = subdomain.mesh
            if mesh.number in sites.of_cells:
                of_cells = sites.of_cells[mesh.number]
                energy = energies[mesh.body].by_cell(subdomain, displacements[of_cells], gradients[of_cells])
                cells[mesh.body].append(mesh.cells)
                squares[mesh.body].append(energy)
    own = {name: (np.concatenate(cells[name]), np.concatenate(squares[name])) for name in scene.bodies}
    sums = comm.allreduce(np.array([values.sum() for _, values in own.values()]))
    by_body = {name: float(np.sqrt(value)) for name, value in zip(own, sums, strict=True)}
    sizes = {name: body.mesh.n_cells for name, body in scene.bodies.items()}
    return DiscretisationError(float(np.sqrt(sums.sum())), by_body, comm, sizes, own)


class _Energies:
    """Energies of differences of gradients in one body. Collective."""

    def __init__(self, torn: TornSystem, body: Body) -> None:
        forms, cell_type = torn.decomposition.forms, body.mesh.cell_type
        self._body = body
        self._ways: list[np.ndarray | Template] = [
            compile_energy(forms, material, cell_type)
            if forms.varies(material, cell_type)
            else moduli(forms, material, cell_type)
            for material in body.materials
        ]

    def by_cell(self, subdomain: Subdomain, displacement: np.ndarray, gradient: np.ndarray) -> np.ndarray:
        """Return ∫ C (g − ∇u) : (g − ∇u) over each cell of a subdomain, shape (n_cells,), [force · length].

        Args:
            subdomain: A subdomain of the body.
            displacement: u at the nodes of its cells, shape (n_cells, nodes of a cell, dim), [length].
            gradient: g there, shape (n_cells, nodes of a cell, dim, dim), dimensionless.
        """
        mesh, whole = subdomain.mesh, self._body.mesh
        nodes, kind = whole.cells[mesh.cells], self._body.material_of_cells[mesh.cells]
        result = np.zeros(len(nodes))
        # Where materials meet, a node has several recovered gradients: one material at a time.
        for number in np.unique(kind):
            cells, way = np.flatnonzero(kind == number), self._ways[number]
            u, g = displacement[cells], gradient[cells]
            if isinstance(way, np.ndarray):
                result[cells] = energy_of_difference(way, whole.cell_type, whole.points[nodes[cells]], u, g)
            else:
                order = np.argsort(mesh.nodes)
                blocks = order[np.searchsorted(mesh.nodes[order], nodes[cells])]
                material = self._body.materials[number]
                result[cells] = energy_on_subdomain(way, material, subdomain, blocks, u, g)[cells]
        # Moduli are insensitive to rotations, so some eigenvalues are zero up to rounding.
        return np.maximum(result, 0.0)
