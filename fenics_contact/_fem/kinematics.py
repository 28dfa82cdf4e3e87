"""Deformation at Gauss points, and volume changes in the mean of cells, against locking."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import scipy.sparse as sp

from fenics_contact import _dolfinx
from fenics_contact._base.csr import Csr
from fenics_contact._fem.composition import Composition
from fenics_contact._fem.deformed_forms import MEAN_FORMS
from fenics_contact._fem.templates import (
    UNSEEN,
    CellPolynomials,
    Templates,
    coefficient_shape,
    quadrature_degree,
)
from fenics_contact._kinematics.base import Gradients
from fenics_contact._kinematics.element import Element
from fenics_contact.materials.hyperelastic import has_mean_dilatation
from fenics_contact.materials.plastic import HistoryMaterial
from fenics_contact.mesh.cell_types import quadrature, shape_gradients, shape_values
from fenics_contact.mesh.quality import determinants


class Dilatation:
    """det F at the Gauss points of one mesh."""

    def __init__(self, space: _dolfinx.fem.FunctionSpace, element: Element, points: np.ndarray) -> None:
        """Evaluate the Jacobians of the undeformed cells."""
        self._positions, _ = quadrature(element.cell, quadrature_degree(element))
        self._points, self._cells = points, _dolfinx.vtk_cell_dofs(space)
        self._element = element
        self._undeformed = self._volumes(points)

    @cached_property
    def polynomials(self) -> CellPolynomials:
        """The polynomials of the undeformed cells."""
        return CellPolynomials(self._points, self._cells, self._element)

    def at(self, displacement: np.ndarray) -> np.ndarray:
        """Return det F, shape (n_cells, n_gauss), of linear simplices (n_cells, 1)."""
        moved = self._points + displacement.reshape(self._points.shape)
        return np.asarray(self._volumes(moved) / self._undeformed)

    def _volumes(self, points: np.ndarray) -> np.ndarray:
        """Return the volumes of cells per reference volume, (n_cells, n_gauss)."""
        return self._element.kinematics.volumes(points, self._cells, self._positions)


def least_of_cubics(*thirds: np.ndarray) -> float:
    """Return the smallest value between 0 and 1 of cubic functions, given at 0, 1/3, 2/3, 1, each (n,)."""
    coefficients = np.linalg.solve(np.vander(np.arange(4) / 3.0, increasing=True), np.stack(thirds))
    _, slope, half, third = coefficients
    with np.errstate(all="ignore"):  # straight lines and parabolas have no extremum, or one
        root = -half - np.copysign(np.sqrt(half**2 - 3.0 * third * slope), half)
        extrema = np.nan_to_num(np.stack([root / (3.0 * third), slope / root]), posinf=0.0, neginf=0.0)
    powers = np.clip(extrema, 0.0, 1.0) ** np.arange(4)[:, None, None]
    inside = np.einsum("kn,kmn->mn", coefficients, powers)
    return float(min(thirds[0].min(), thirds[-1].min(), inside.min()))


#: Bulk modulus at rest of what is not projected, by the shear modulus, in cells of type `UNSEEN`.
HELD = 0.02


def held_share(moduli: np.ndarray) -> float:
    """Return the share of a dilatation's variation in a cell that is not projected away, see `HELD`."""
    bulk, shear = moduli[:3, :3].sum() / 9.0, np.trace(moduli[3:, 3:]) / 3.0
    return float(np.sqrt(min(1.0, HELD * shear / bulk)))


class PointStrain:
    """Displacement gradients as they are at each point."""

    def averaged(self, tensors: np.ndarray) -> np.ndarray:
        """Return H itself."""
        return tensors

    def added(self, blocks: np.ndarray, tangent: np.ndarray) -> np.ndarray:
        """Return ∫ ∇v : A : ∇u of the cells as it is."""
        return blocks


POINT_STRAIN = PointStrain()


class MeanStrain(PointStrain):
    """Displacement gradients of small strain whose traces are the projections of their cells: B-bar.

    H̄ = H + (1 − s) (Π tr H − tr H) I / 3 with the projection Π on the polynomials of each cell, its mean or
    linear ones. Linear cells whose points must all keep their volume lock; these ask it of their cells alone.
    Forces and stiffness are the first and the second derivative of the same energy where there is one. The
    share s is zero unless deformations would be without energy then.

    References:
        T. J. R. Hughes, Generalization of selective integration procedures to anisotropic and nonlinear
        media, International Journal for Numerical Methods in Engineering 15 (1980).
    """

    def __init__(self, gradients: Gradients, polynomials: CellPolynomials, share: float = 0.0) -> None:
        """Project the divergence of each shape function."""
        self._gradients, self._polynomials, self._part = gradients, polynomials, 1.0 - share

    def averaged(self, tensors: np.ndarray) -> np.ndarray:
        """Return H̄ of H; of the stress on H̄ that which does the same work on H."""
        apart = self._apart(np.einsum("cqii->cq", tensors)[..., None])
        return np.asarray(tensors + apart[..., None] * np.eye(3))

    def _apart(self, traces: np.ndarray) -> np.ndarray:
        """Return what a third of traces lacks of their projections, shape (n_cells, n_gauss, k)."""
        return self._part / 3.0 * (self._polynomials.projected(traces) - traces)

    def added(self, blocks: np.ndarray, tangent: np.ndarray) -> np.ndarray:
        """Return ∫ ∇v̄ : A : ∇ū of the cells by ∫ ∇v : A : ∇u, in one row."""
        return np.asarray(blocks + self.blocks(tangent).ravel())

    def blocks(self, tangent: np.ndarray) -> np.ndarray:
        """Return what ∫ ∇v̄ : A : ∇ū has beside ∫ ∇v : A : ∇u, shape (n_cells, dim nodes, dim nodes)."""
        divergence = self._gradients.divergence
        flat = (*divergence.shape[:2], -1)
        apart = self._apart(divergence.reshape(flat))
        by_trace = np.einsum("cqijkk->cqij", tangent)
        from_trace = np.einsum("cqiikl->cqkl", tangent)
        both = np.einsum("cqii->cq", by_trace)
        left, right = (self._gradients.contracted(each).reshape(flat) for each in (by_trace, from_trace))
        right = right + both[..., None] * apart
        w = self._polynomials.weights[..., None]
        outer = (w * left).swapaxes(1, 2) @ apart
        return np.asarray(outer + (w * apart).swapaxes(1, 2) @ right)


class GaussPoints:
    """The Gauss points of one mesh: those of the package's forms on cells of this type, or of a degree."""

    def __init__(
        self,
        space: _dolfinx.fem.FunctionSpace,
        element: Element,
        points: np.ndarray,
        degree: int = 0,
    ) -> None:
        """Evaluate the gradients of the shape functions."""
        cell = element.cell
        positions, weights = quadrature(cell, degree or quadrature_degree(element))
        reference = shape_gradients(cell, positions)
        self._values = shape_values(cell, positions)
        self._shape, self._cells = points.shape, _dolfinx.vtk_cell_dofs(space)
        self._points, self._element = points, element
        jacobian = np.einsum("cai,qaj->cqij", points[self._cells], reference)
        kinematics, first = element.kinematics, points[self._cells, 0] @ self._values.T
        self._weights = kinematics.measure.around(first) * (weights * determinants(jacobian))
        self._gradients = kinematics.gradients(reference @ np.linalg.inv(jacobian), self._values, first)

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of cells and of points in each."""
        return self._weights.shape[0], self._weights.shape[1]

    @property
    def weights(self) -> np.ndarray:
        """Volumes that belong to the points, shape (n_cells, n_gauss)."""
        return self._weights

    def within(self, values: np.ndarray) -> np.ndarray:
        """Return values at the points by those at the nodes of cells, (n_cells, nodes of a cell, ...)."""
        return np.einsum("qa,na...->nq...", self._values, values)

    def gradient(self, displacement: np.ndarray) -> np.ndarray:
        """Return ∂u_i/∂X_j in three dimensions, zero out of the plane, shape (n_cells, n_gauss, 3, 3)."""
        return self._gradients.of(displacement.reshape(self._shape)[self._cells])

    def interpolated(self, nodal: np.ndarray) -> np.ndarray:
        """Return a scalar field at the points, (n_cells, n_gauss), of its values by block, (n,)."""
        return np.asarray(nodal[self._cells] @ self._values.T)

    def force(self, stress: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Return ∫ P : ∇v over some cells by dof, shape (dim n,), [force]."""
        nodal = self._gradients.part(cells).force(self._weights[cells], stress)
        return np.bincount(self._dofs[cells].ravel(), nodal.ravel(), minlength=int(np.prod(self._shape)))

    def strain_of(self, material: HistoryMaterial, cells: np.ndarray) -> PointStrain:
        """Return the strain of a material in some cells."""
        return self.mean_strain(cells, material.moduli) if has_mean_dilatation(material) else POINT_STRAIN

    def mean_strain(self, cells: np.ndarray, moduli: np.ndarray) -> MeanStrain:
        """Return the means of changes of volume in some cells."""
        share = held_share(moduli) if self._element.cells in UNSEEN else 0.0
        return MeanStrain(self._gradients.part(cells), self._polynomials.of(cells), share)

    def stiffness(
        self, tangent: np.ndarray, cells: np.ndarray, strain: PointStrain = POINT_STRAIN
    ) -> np.ndarray:
        """Return ∫ ∇v : A : ∇u over some cells: entries of the matrix of `assembled`."""
        blocks = self._gradients.part(cells).blocks(self._weights[cells], tangent).ravel()
        entries = strain.added(blocks, tangent)
        _, _, places = self._pattern
        return np.bincount(places[cells].ravel(), entries, minlength=self.entries)

    def assembled(self, entries: np.ndarray) -> sp.csr_matrix:
        """Return the matrix with entries from `stiffness`; its pattern is the same whatever is zero in it."""
        indptr, indices, _ = self._pattern
        return Csr((entries, indices, indptr), shape=(len(indptr) - 1,) * 2)

    def with_others(self, entries: np.ndarray, others: sp.csr_matrix) -> np.ndarray:
        """Return entries from `stiffness` with those of another matrix on the same mesh."""
        indptr, indices, _ = self._pattern
        size, entries = len(indptr) - 1, entries.copy()
        rows = np.repeat(np.arange(size), np.diff(others.indptr))
        own = np.repeat(np.arange(size), np.diff(indptr)) * size + indices
        entries[np.searchsorted(own, rows * size + others.indices)] += others.data
        return entries

    @property
    def entries(self) -> int:
        """Number of entries of the matrix."""
        return len(self._pattern[1])

    @cached_property
    def _polynomials(self) -> CellPolynomials:
        """Those on which changes of volume are projected."""
        return CellPolynomials(self._points, self._cells, self._element)

    @cached_property
    def _dofs(self) -> np.ndarray:
        """Dofs of each cell, shape (n_cells, dim nodes of a cell)."""
        dim = self._shape[1]
        return np.asarray((dim * self._cells[..., None] + np.arange(dim)).reshape(len(self._cells), -1))

    @cached_property
    def _pattern(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Row starts and columns of the matrix, and for each cell where its entries belong."""
        size, dofs = int(np.prod(self._shape)), self._dofs.astype(np.int64)
        keys, places = np.unique(dofs[:, :, None] * size + dofs[:, None, :], return_inverse=True)
        indptr = np.searchsorted(keys, np.arange(size + 1) * size)
        return indptr, keys % size, places.reshape(len(dofs), -1)


def assembled(form: _dolfinx.fem.Form, shape: tuple[int, int]) -> sp.csr_matrix:
    """Assemble a bilinear form on one rank."""
    indptr, indices, data = _dolfinx.assemble_csr(form)
    return Csr((data, indices, indptr), shape=shape)


def mean_fields(mesh: _dolfinx.mesh.Mesh, element: Element) -> list[_dolfinx.fem.Function]:
    """Return the fields of `MeanDilatation`: dilatations and pressures by coefficients, centres of cells."""
    shape, dim = coefficient_shape(element), mesh.geometry.dim
    shapes = (shape, shape, (dim,))
    return [_dolfinx.fem.Function(_dolfinx.cellwise_space_on(mesh, each)) for each in shapes]


class PointDilatation:
    """Dilatations as they are at each point."""

    def follow(self, displacement: np.ndarray) -> None:
        """Set nothing."""

    def foresee(self, origin: np.ndarray, displacement: np.ndarray) -> None:
        """Set nothing."""

    def added(self, stiffness: sp.csr_matrix) -> sp.csr_matrix:
        """Return a tangent as it is."""
        return stiffness

    def at(self, displacement: np.ndarray) -> np.ndarray:
        """Return none but those at the points."""
        return np.zeros(0)


class MeanDilatation(PointDilatation):
    """The dilatations θ in the cells of one mesh, which are polynomials, and their part of the tangent.

    With the polynomials ψ_i of a cell and M_ij = ∫ ψ_i ψ_j, the coefficients of θ = Π J and p = Π U'(θ) are
    M⁻¹ ∫ ψ J and M⁻¹ ∫ ψ U'(θ). With (D v)_i = ∫ ψ_i cof F : ∇v the tangent at fixed θ and p lacks (M⁻¹ D u)
    · H (M⁻¹ D v), H_ij = ∫ U''(θ) ψ_i ψ_j, summed over the cells. A constant θ is the mean of a cell.

    References:
        J. C. Simo, R. L. Taylor, K. S. Pister, Variational and projection methods for the volume constraint
        in finite deformation elasto-plasticity, Comput. Methods Appl. Mech. Eng. 51 (1985) 177-208.
    """

    def __init__(
        self,
        templates: Templates,
        parts: Composition,
        element: Element,
        fields: list[_dolfinx.fem.Function],
        dilatation: Dilatation,
    ) -> None:
        """Bind the forms."""
        self._dilatation, self._polynomials = dilatation, dilatation.polynomials
        self._means, self._pressures, centres = fields[1:4]
        self._size = fields[0].x.array.size
        space, cellwise = (field.function_space for field in fields[:2])
        self._cells = _dolfinx.cell_dofs(cellwise).ravel()
        centres.x.array.reshape(self._polynomials.centres.shape)[self._cells] = self._polynomials.centres
        self._change, self._pressure, self._modulus = (
            templates[kind, parts.materials, element].bind(
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

    def foresee(self, origin: np.ndarray, displacement: np.ndarray, flattened: float = 0.1) -> None:
        """Set the dilatations to those that a step was expected to lead to, θ + M⁻¹ D δu, and the pressures.

        Where that turns a cell inside out, or nearly so, to those that it led to. `flattened`: part of the
        dilatation that a step led to, below which a foreseen one says nothing.
        """
        shape = self._polynomials.centres.shape[0], -1
        change = (self._inverse @ (self._volume_changes() @ (displacement - origin))).reshape(shape)
        actual, before = (
            self._polynomials.coefficients(self._dilatation.at(u)[..., None])[..., 0]
            for u in (displacement, origin)
        )
        foreseen = before + change[self._cells]
        points, reached = self._polynomials.at(foreseen), self._polynomials.at(actual)
        possible = np.all(points > flattened * reached, axis=1)
        self._set(np.where(possible[:, None], foreseen, actual))

    def added(self, stiffness: sp.csr_matrix) -> sp.csr_matrix:
        """Return a tangent with the growth of the stresses with the dilatations, shape (dim n, dim n)."""
        D = self._inverse @ self._volume_changes()
        return (stiffness + (D.T @ assembled(self._modulus, (D.shape[0],) * 2) @ D).tocsr()).tocsr()

    def at(self, displacement: np.ndarray) -> np.ndarray:
        """Return θ at the Gauss points of cells that have it, shape (n,)."""
        given = self._dilatation.at(displacement)[..., None]
        values = self._polynomials.at(self._polynomials.coefficients(given)[..., 0])
        return np.asarray(values[self._own].ravel())

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
    tagged = enumerate(parts.materials, start=1)
    return np.concatenate([parts.cells_of(tag, count) for tag, each in tagged if has_mean_dilatation(each)])
