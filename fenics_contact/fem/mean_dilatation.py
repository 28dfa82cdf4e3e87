"""Volume energies of the dilatation of cells, against locking of nearly incompressible bodies."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fenics_contact import _dolfinx
from fenics_contact.fem.cell_polynomials import coefficient_shape
from fenics_contact.fem.composition import Composition
from fenics_contact.fem.deformation import Dilatation
from fenics_contact.fem.deformed_forms import MEAN_FORMS
from fenics_contact.fem.templates import Templates
from fenics_contact.scene import has_mean_dilatation

#: Part of the dilatation that a step led to, below which a foreseen one says nothing.
FLATTENED = 0.1


def assembled(form: _dolfinx.fem.Form, shape: tuple[int, int]) -> sp.csr_matrix:
    """Assemble a bilinear form on one rank."""
    indptr, indices, data = _dolfinx.assemble_csr(form)
    return sp.csr_matrix((data, indices, indptr), shape=shape)


def mean_fields(mesh: _dolfinx.mesh.Mesh, cell_type: str) -> list[_dolfinx.fem.Function]:
    """Return the fields of `MeanDilatation`: dilatations and pressures by coefficients, centres of cells."""
    shape, dim = coefficient_shape(cell_type), mesh.geometry.dim
    shapes = (shape, shape, (dim,))
    return [_dolfinx.fem.Function(_dolfinx.cellwise_space_on(mesh, each)) for each in shapes]


class MeanDilatation:
    """The dilatations θ in the cells of one mesh, which are polynomials, and their part of the tangent.

    With the polynomials ψ_i of a cell and M_ij = ∫ ψ_i ψ_j, the coefficients of θ = Π J and p = Π U'(θ) are
    M⁻¹ ∫ ψ J and M⁻¹ ∫ ψ U'(θ). With (D v)_i = ∫ ψ_i cof F : ∇v the tangent at fixed θ and p lacks
    (M⁻¹ D u) · H (M⁻¹ D v), H_ij = ∫ U''(θ) ψ_i ψ_j, summed over the cells. A constant θ is the mean of
    a cell.

    References:
        J. C. Simo, R. L. Taylor, K. S. Pister, Variational and projection methods for the volume constraint
        in finite deformation elasto-plasticity, Comput. Methods Appl. Mech. Eng. 51 (1985) 177-208.
    """

    def __init__(
        self,
        templates: Templates,
        parts: Composition,
        cell_type: str,
        fields: list[_dolfinx.fem.Function],
        dilatation: Dilatation,
    ) -> None:
        """Bind the forms.

        Args:
            templates: With the prepared forms.
            parts: Materials of the mesh.
            cell_type: Of the mesh.
            fields: Displacement, and the `mean_fields`, which `follow` sets.
            dilatation: Changes of volume on the mesh.
        """
        self._dilatation, self._polynomials = dilatation, dilatation.polynomials
        self._means, self._pressures, centres = fields[1:]
        self._size = fields[0].x.array.size
        space, cellwise = (field.function_space for field in fields[:2])
        self._cells = _dolfinx.cell_dofs(cellwise).ravel()
        centres.x.array.reshape(self._polynomials.centres.shape)[self._cells] = self._polynomials.centres
        self._change, self._pressure, self._modulus = (
            templates[kind, parts.materials, cell_type].bind(
                spaces, parts.parameters, fields, cells=parts.cells
            )
            for kind, spaces in zip(
                MEAN_FORMS, ([cellwise, space], [cellwise], [cellwise, cellwise]), strict=True
            )
        )
        self._own = _own_cells(parts, len(self._cells))
        self._inverse = self._block_diagonal(self._polynomials.inverse)

    def follow(self, displacement: np.ndarray) -> None:
        """Set dilatations and pressures to those of a displacement."""
        self._set(self._polynomials.coefficients(self._dilatation.at(displacement)[..., None])[..., 0])

    def foresee(self, origin: np.ndarray, displacement: np.ndarray) -> None:
        """Set the dilatations to those that a step was expected to lead to, θ + M⁻¹ D δu, and the pressures.

        Where that turns a cell inside out, or nearly so, to those that it led to.

        Args:
            origin: Displacement at the start of the step, that of the fields.
            displacement: That at its end.
        """
        shape = self._polynomials.centres.shape[0], -1
        change = (self._inverse @ (self._volume_changes() @ (displacement - origin))).reshape(shape)
        actual, before = (
            self._polynomials.coefficients(self._dilatation.at(u)[..., None])[..., 0]
            for u in (displacement, origin)
        )
        foreseen = before + change[self._cells]
        points, reached = self._polynomials.at(foreseen), self._polynomials.at(actual)
        possible = (points > FLATTENED * reached).all(axis=1)
        self._set(np.where(possible[:, None], foreseen, actual))

    def stiffness(self) -> sp.csr_matrix:
        """Return the growth of the stresses with the dilatations, shape (dim n, dim n)."""
        D = self._inverse @ self._volume_changes()
        return (D.T @ assembled(self._modulus, (D.shape[0],) * 2) @ D).tocsr()

    def least(self, displacement: np.ndarray) -> float:
        """Return the smallest θ at a Gauss point."""
        given = self._dilatation.at(displacement)[..., None]
        values = self._polynomials.at(self._polynomials.coefficients(given)[..., 0])
        return float(values[self._own].min(initial=1.0))

    def _set(self, coefficients: np.ndarray) -> None:
        """Set the dilatations, by cell, and the pressures."""
        self._means.x.array.reshape(coefficients.shape)[self._cells] = coefficients
        self._pressures.x.array[:] = self._inverse @ _dolfinx.assemble_vector(self._pressure)

    def _volume_changes(self) -> sp.csr_matrix:
        """Return D at the displacement of the fields, shape (n n_cells, dim n_nodes)."""
        return assembled(self._change, (self._inverse.shape[0], self._size))

    def _block_diagonal(self, blocks: np.ndarray) -> sp.csr_matrix:
        """Return a matrix by dof of the dilatations from a block for each cell."""
        ordered = np.empty_like(blocks)
        ordered[self._cells] = blocks
        count = np.arange(len(blocks) + 1)
        return sp.bsr_matrix((ordered, count[:-1], count)).tocsr()


def _own_cells(parts: Composition, count: int) -> np.ndarray:
    """Return the cells of materials with a mean dilatation."""
    if parts.cells is None:
        return np.arange(count)
    tagged = enumerate(parts.materials, start=1)
    return np.concatenate([parts.cells[tag] for tag, material in tagged if has_mean_dilatation(material)])
