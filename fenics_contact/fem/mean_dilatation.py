"""Volume energies of the mean dilatation of each cell, against locking of nearly incompressible bodies."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import scipy.sparse as sp

from fenics_contact import _dolfinx
from fenics_contact.fem.composition import Composition
from fenics_contact.fem.deformation import Dilatation
from fenics_contact.fem.deformed_forms import MEAN_FORMS
from fenics_contact.fem.templates import Templates

#: Part of the mean dilatation that a step led to, below which a foreseen one says nothing.
FLATTENED = 0.1


def assembled(form: _dolfinx.fem.Form, shape: tuple[int, int]) -> sp.csr_matrix:
    """Assemble a bilinear form on one rank."""
    indptr, indices, data = _dolfinx.assemble_csr(form)
    return sp.csr_matrix((data, indices, indptr), shape=shape)


class MeanDilatation:
    """The mean dilatations θ of the cells of one mesh, and their part of the tangent.

    With θ_c = ∫ J dV / V_c and D v = ∫ cof F : ∇v dV on each cell, the tangent at fixed θ lacks
    Σ_c U''(θ_c) / V_c (D u)_c (D v)_c.

    References:
        J. C. Simo, R. L. Taylor, K. S. Pister, Variational and projection methods for the volume constraint
        in finite deformation elasto-plasticity, Comput. Methods Appl. Mech. Eng. 51 (1985) 177-208.
    """

    def __init__(
        self,
        templates: Templates,
        parts: Composition,
        cell_type: str,
        fields: tuple[_dolfinx.fem.Function, _dolfinx.fem.Function],
        dilatation: Dilatation,
    ) -> None:
        """Bind the forms.

        Args:
            templates: With the prepared forms.
            parts: Materials of the mesh.
            cell_type: Of the mesh.
            fields: Displacement and mean dilatations, which `follow` sets.
            dilatation: Changes of volume on the mesh.
        """
        self._means, self._dilatation = fields[1], dilatation
        self._size = fields[0].x.array.size
        space, cellwise = (field.function_space for field in fields)
        self._dofs = _dolfinx.cell_dofs(cellwise).ravel()
        self._change, self._modulus = (
            templates[kind, parts.materials, cell_type].bind(
                spaces, parts.parameters, fields, cells=parts.cells
            )
            for kind, spaces in zip(MEAN_FORMS, ([cellwise, space], [cellwise]), strict=True)
        )

    def follow(self, displacement: np.ndarray) -> None:
        """Set the mean dilatations to those of a displacement."""
        self._means.x.array[self._dofs] = self._dilatation.means(displacement)

    def foresee(self, origin: np.ndarray, displacement: np.ndarray) -> None:
        """Set the mean dilatations to those that a step was expected to lead to, θ_c + D δu / V_c.

        Where that turns a cell inside out, or nearly so, to those that it led to.

        Args:
            origin: Displacement at the start of the step, that of the fields.
            displacement: That at its end.
        """
        self.follow(displacement)
        reached = self._means.x.array.copy()
        self.follow(origin)
        foreseen = self._means.x.array + self._volume_changes() @ (displacement - origin) / self._volumes
        self._means.x.array[:] = np.where(foreseen > FLATTENED * reached, foreseen, reached)

    def stiffness(self) -> sp.csr_matrix:
        """Return the growth of the mean dilatations' stresses, shape (dim n, dim n)."""
        D = self._volume_changes()
        return (D.T @ sp.diags(_dolfinx.assemble_vector(self._modulus) / self._volumes**2) @ D).tocsr()

    def _volume_changes(self) -> sp.csr_matrix:
        """Return D at the displacement of the fields, shape (n_cells, dim n)."""
        return assembled(self._change, (len(self._dofs), self._size))

    @cached_property
    def _volumes(self) -> np.ndarray:
        """Undeformed volumes by dof of the mean dilatations, shape (n_cells,), [length^dim]."""
        volumes = np.empty(len(self._dofs))
        volumes[self._dofs] = self._dilatation.volumes
        return volumes
