"""Stress at the nodes, averaged around each node within one material.

The displacement gradient is recovered at each node from the displacements of the nodes around it (see
`accuracy.recovery`), which is more accurate than the means of the cells, above all on surfaces. Where
materials meet a node has a stress for each of them.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy.sparse as sp

from fenics_contact import _dolfinx
from fenics_contact.accuracy import Sites, find_sites, recovered_gradients
from fenics_contact.contact.cell_stress import COMPONENTS, CellStress, components_of, tensors
from fenics_contact.contact.fields import cells_of_body, displacement_function
from fenics_contact.fem import temperature_of
from fenics_contact.feti import TornSystem
from fenics_contact.scene import is_nonlinear


def nodal_stress(
    torn: TornSystem,
    displacement: np.ndarray,
    meshes: Mapping[str, _dolfinx.mesh.Mesh],
    stresses: Mapping[str, _dolfinx.fem.Function],
) -> dict[str, np.ndarray]:
    """Return the stress of all bodies at their nodes, material by material. Collective.

    Args:
        torn: The torn system.
        displacement: Displacement of all nodes, valid on those of this rank, shape (n_nodes, dim), [length].
        meshes: The bodies' meshes by name, see `body_mesh`.
        stresses: Mean stress of the cells of at least the bodies with nonlinear materials, by name.

    Returns:
        For each body, shape (n_materials, n_nodes, 3, 3), NaN where a node has no cell of the material,
        replicated, [force / length²].
    """
    found = {}
    for order in sorted({body.mesh.order for body in torn.scene.bodies.values()}):
        sites = find_sites(torn, order)
        gradients = recovered_gradients(sites, displacement[sites.node])
        for name, body in torn.scene.bodies.items():
            if body.mesh.order == order:
                if any(map(is_nonlinear, body.materials)):
                    own = _from_cells(torn, name, sites, stresses[name])
                else:
                    own = _at_sites(torn, name, sites, gradients, meshes[name])
                found[name] = _gathered(torn, name, sites, own)
    return found


def _from_cells(torn: TornSystem, name: str, sites: Sites, stress: _dolfinx.fem.Function) -> np.ndarray:
    """Return the components of the mean stress around the sites of a body, shape (n_sites, 6). Collective."""
    space = stress.function_space
    number = cells_of_body(space.mesh, torn.scene.bodies[name].mesh.cells)
    own = _dolfinx.cell_dofs(space).ravel()[: len(number)]
    return _around_sites(torn, name, sites, components_of(stress.x.array.reshape(-1, 3, 3)[own]), number)


def _at_sites(
    torn: TornSystem, name: str, sites: Sites, gradients: np.ndarray, mesh: _dolfinx.mesh.Mesh
) -> np.ndarray:
    """Return the components of the stress at the sites of a body, shape (n_sites, 6). Collective.

    It is affine in the gradient. Its coefficients are the stresses of unit gradients, averaged over the cells
    around a site; they are the same in all of them unless the material or the temperature varies.
    """
    body, dim = torn.scene.bodies[name], torn.dim
    temperature = temperature_of(torn.scene.loads, name)
    means = CellStress(mesh, body, torn.decomposition.comm, temperature)
    number = cells_of_body(mesh, body.mesh.cells)
    places = body.mesh.points - body.mesh.points.mean(axis=0)
    # A rotation has no stress: the gradients (i, j) and (j, i) have the same.
    pairs = [(i, j) for i in range(dim) for j in range(i, dim)]
    units = np.zeros((1 + len(pairs), dim, dim))
    units[np.arange(1, len(units)), [i for i, _ in pairs], [j for _, j in pairs]] = 1.0
    on_cells = [means.components(displacement_function(mesh, places @ unit.T)) for unit in units]
    around = _around_sites(torn, name, sites, np.hstack(on_cells), number)
    at_rest, *strained = np.split(around, len(units), axis=1)
    total = at_rest.copy()
    for (i, j), stress in zip(pairs, strained, strict=True):
        size = gradients[:, i, j] if i == j else gradients[:, i, j] + gradients[:, j, i]
        total += size[:, None] * (stress - at_rest)
    return total


def _around_sites(
    torn: TornSystem, name: str, sites: Sites, values: np.ndarray, number: np.ndarray
) -> np.ndarray:
    """Return the means of values on cells over the cells around each site, shape (n_sites, k). Collective.

    Args:
        torn: The torn system.
        name: The body.
        sites: The sites.
        values: On this rank's cells of the body, shape (n_owned, k).
        number: Number in the body of each of them, shape (n_owned,).
    """
    of_body = np.zeros((torn.scene.bodies[name].mesh.n_cells, values.shape[1] + 1))
    of_body[number] = np.pad(values, ((0, 0), (0, 1)), constant_values=1.0)
    total = np.zeros((sites.count, of_body.shape[1]))
    for mesh in torn.decomposition.meshes:
        if mesh.body == name:
            places = sites.of_cells[mesh.number]
            starts = np.arange(len(places) + 1) * places.shape[1]
            shape = (len(places), sites.count)
            around = sp.csr_matrix((np.ones(places.size), places.ravel(), starts), shape=shape).T
            total += around @ of_body[mesh.cells]
    total = sites.sharing.add_up(total)
    return np.asarray(total[:, :-1] / np.maximum(total[:, -1:], 1.0))


def _gathered(torn: TornSystem, name: str, sites: Sites, values: np.ndarray) -> np.ndarray:
    """Return values at the sites of a body by material and node, on every rank. Collective."""
    body, decomposition = torn.scene.bodies[name], torn.decomposition
    total = np.zeros((len(body.materials), body.mesh.n_nodes, len(COMPONENTS) + 1))
    for mesh in decomposition.meshes:
        if mesh.body == name:
            site, node = sites.of_cells[mesh.number], body.mesh.cells[mesh.cells]
            material = np.broadcast_to(body.material_of_cells[mesh.cells][:, None], node.shape)
            total[material, node, :-1] = values[site]
            total[material, node, -1] = 1.0
    total = decomposition.comm.allreduce(total)
    count = total[..., -1:]
    return tensors(np.where(count > 0, total[..., :-1] / np.maximum(count, 1.0), np.nan))
