"""Products of the estimated errors of two displacements by the tangents of nonlinear materials.

With the tangent moduli A at the displacement u, in the mean over each cell, and gradients G recovered from u
and from another field w, such as an adjoint, the product of a cell is

    ∫ A (G u − ∇u) : (G w − ∇w).

Materials with a mean dilatation hardly change their volume, and what small changes of a recovered one are
multiplied by is large. There the direction N of changes of volume is left to the stresses S = P : N: with the
moduli Ã of what is across N, the stresses S and T of u and w, recovered as means S*, T* at nodes, and changes
of volume d = N : ∇u − mean in cells, of which these know the mean alone,

    ∫ Ã e_u : e_w − (S* − S) d_w − (T* − T) d_u + (S* − S)(T* − T) / A_NN.

On quadratic cells, whose stresses S are linear in each, the first term is all.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fenics_contact._accuracy.discretisation import ErrorProducts, Parts, recovered_fields
from fenics_contact._accuracy.recovery import find_sites
from fenics_contact._fem.separate_cells import CellTangent, SeparateCells
from fenics_contact.feti.subdomain import Subdomain
from fenics_contact.feti.torn import TornSystem
from fenics_contact.materials.hyperelastic import has_mean_dilatation
from fenics_contact.mesh.collapsed import as_hexahedra


@dataclass(frozen=True, eq=False)
class TangentCells:
    """The cells of a subdomain at a displacement, with what they resist there."""

    cells: SeparateCells
    tangent: CellTangent


def tangent_products(
    torn: TornSystem, known: Mapping[int, TangentCells], first: np.ndarray, second: np.ndarray
) -> ErrorProducts:
    """Estimate the products of the errors of two torn fields on each cell. Collective.

    `known`: number of each of this rank's subdomains -> its cells at the first field. Products of an error
    with itself are those of its own part alone; where a material is unstable, they are made positive.
    """
    bodies = torn.scene.bodies
    results = tuple(Parts(bodies) for _ in range(3))
    pairs = {part.mesh.number: (part, fields) for part, fields in recovered_fields(torn, first, second)}
    errors = {
        number: _Errors.of(torn, part, known[number], fields) for number, (part, fields) in pairs.items()
    }
    volumetric = _stress_errors(torn, known, errors)
    for number, (part, _) in pairs.items():
        for result, values in zip(results, errors[number].products(volumetric[number]), strict=True):
            result.add(part, values)
    return ErrorProducts(*(result.joined() for result in results))


@dataclass(frozen=True, eq=False)
class _Errors:
    """Errors of two gradients at the Gauss points of cells, with the directions of changes of volume.

    `errors`: shape (2, n_cells, n_gauss, m); `changes`: d, (2, n_cells, n_gauss); `direction`: N, that of the
    stress of a change of volume, zero where materials have no mean dilatation.
    """

    known: TangentCells
    errors: np.ndarray
    changes: np.ndarray
    direction: np.ndarray

    @classmethod
    def of(
        cls,
        torn: TornSystem,
        part: Subdomain,
        known: TangentCells,
        pairs: Sequence[tuple[np.ndarray, np.ndarray]],
    ) -> _Errors:
        body = torn.scene.bodies[part.mesh.body]
        nodes, cells = body.mesh.cells[part.mesh.cells], known.cells
        fields = [[as_hexahedra(each, nodes, body.mesh.dim) for each in pair] for pair in pairs]
        spatial = [cells.gradients(u) for u, _ in fields]
        weights = cells.weights / cells.weights.sum(axis=1, keepdims=True)
        components, dim = known.tangent.stress.shape[1:]
        shape = (*weights.shape, components * dim)
        plane = np.array([each[..., :components, :dim].reshape(shape) for each in spatial])
        recovered = np.array([cells.within(g).reshape(shape) for _, g in fields])
        centred = [each - np.einsum("nq,nqij->nij", weights, each)[:, None] for each in spatial]
        F = np.eye(3) + np.einsum("nq,nqij->nij", weights, spatial[0])
        kept = np.array([has_mean_dilatation(each) for each in body.materials])[
            body.material_of_cells[part.mesh.cells]
        ]
        N = np.where(kept[:, None, None], np.linalg.inv(F).transpose(0, 2, 1), 0.0)
        size = np.linalg.norm(N[:, :components, :dim], axis=(1, 2))
        N /= np.where(size > 0.0, size, 1.0)[:, None, None]
        changes = np.einsum("nij,fnqij->fnq", N, np.array(centred))
        # The mean of a cell's directions is the one that its stresses have.
        stressed = np.einsum("nab,nb->na", known.tangent.moduli, N[:, :components, :dim].reshape(len(N), -1))
        size = np.linalg.norm(stressed, axis=1)
        direction = stressed / np.where(size > 0.0, size, 1.0)[:, None]
        return cls(known, recovered - plane, changes, direction)

    @property
    def stresses(self) -> np.ndarray:
        """Return S and T of the cells, shape (2, n_cells)."""
        tangent, N = self.known.tangent, self.direction
        both = np.array([tangent.stress, tangent.change]).reshape(2, *N.shape)
        return np.asarray(np.einsum("fnm,nm->fn", both, N))

    def products(self, volumetric: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return those of the first error, of the second one, and of both, by cell.

        `volumetric`: S* − S and T* − T at the Gauss points, (2, n_cells, n_gauss).
        """
        moduli, N, w = self.known.tangent.moduli, self.direction, self.known.cells.weights
        along = np.einsum("nab,nb->na", moduli, N)
        stiff = np.einsum("na,na->n", N, along)
        soft = np.divide(1.0, stiff, out=np.zeros_like(stiff), where=stiff > 0.0)
        across = moduli - soft[:, None, None] * along[:, :, None] * along[:, None, :]
        shares = np.einsum("fnqa,na->fnq", self.errors, N)
        errors = self.errors - shares[..., None] * N[:, None]
        stressed = np.matmul(errors, across)
        own, other, both = (
            np.einsum("nqa,nqa,nq->n", stressed[i], errors[j], w) for i, j in ((0, 0), (1, 1), (0, 1))
        )
        (S, T), (d, f) = volumetric, self.changes
        both = both + np.einsum("nq,nq->n", w, soft[:, None] * S * T - S * f - T * d)
        pressed = [np.einsum("nq,nq->n", w, np.abs(2.0 * a * b)) for a, b in ((S, d), (T, f))]
        return np.abs(own) + pressed[0], np.abs(other) + pressed[1], both


def _stress_errors(
    torn: TornSystem, known: Mapping[int, TangentCells], errors: Mapping[int, _Errors]
) -> dict[int, np.ndarray]:
    """Return S* − S and T* − T at the Gauss points of each subdomain's cells. Collective.

    S* is the mean at each node of the cells of its material around it, by their volumes; zero on quadratic
    cells.
    """
    result = {number: np.zeros_like(each.changes) for number, each in errors.items()}
    bodies = torn.scene.bodies.values()
    if not any(has_mean_dilatation(each) for body in bodies for each in body.materials):
        return result
    sites = find_sites(torn, 1)
    sums, mine = np.zeros((sites.count, 3)), {n: sites.of_cells[n] for n in errors if n in sites.of_cells}
    for number, nodes in mine.items():
        volume = known[number].cells.weights.sum(axis=1)
        values = volume[:, None] * np.column_stack([*errors[number].stresses, np.ones(len(volume))])
        np.add.at(sums, nodes, values[:, None])
    sums = sites.sharing.add_up(sums)
    means = sums[:, :2] / sums[:, 2:]
    for number, nodes in mine.items():
        there = known[number].cells.within(means[nodes])
        marked = errors[number].direction.any(axis=1)
        missed = there.transpose(2, 0, 1) - errors[number].stresses[..., None]
        result[number] = np.where(marked[:, None], missed, 0.0)
    return result
