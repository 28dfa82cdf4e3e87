"""Stress in the cells of a body: means of the tensor, of its von Mises equivalent, and principal stresses."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import ufl
from ufl.core.expr import Expr

from fenics_contact import _dolfinx
from fenics_contact._libraries import MPI
from fenics_contact.contact.fields import cells_of_body
from fenics_contact.errors import together
from fenics_contact.fem import (
    Composition,
    Constants,
    Temperature,
    Template,
    Written,
    integrate,
    scalar_constants,
    stress_in_space,
    volume_measure,
)
from fenics_contact.scene import Body, Material

#: The six components of a stress in VTK's order: xx, yy, zz, xy, yz, xz.
COMPONENTS = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))
#: Their names, as files and menus call them.
STRESS_COMPONENTS = tuple("xyz"[i] + "xyz"[j] for i, j in COMPONENTS)

#: Builds a number (UFL) from a stress, shape (3, 3), and constants.
OfStress = Callable[[Expr, Constants], Expr]


class CellMeans:
    """Means of a function of the stress over the cells of one body.

    The stress is that in space, for plane bodies with the component normal to the plane. Thermal stress is
    subtracted.
    """

    def __init__(
        self,
        mesh: _dolfinx.mesh.Mesh,
        body: Body,
        comm: MPI.Comm,
        temperature: Temperature,
        quantity: tuple[OfStress, int],
    ) -> None:
        """Compile the forms. Collective on ``comm``.

        Args:
            mesh: The body's mesh, see `body_mesh`.
            body: The body with its materials.
            comm: Communicator of the state.
            temperature: Temperature change of the body.
            quantity: The function of the stress, and how many constants it takes.
        """
        cell_type = body.mesh.cell_type
        self._parts = _composition(mesh, body)
        q = ufl.TestFunction(_dolfinx.cellwise_space(cell_type))
        with together(comm):
            form, constants, coefficients = _weighted(
                self._parts.materials, cell_type, q, temperature, quantity
            )
            self._fields = temperature.fields(mesh, body.mesh.points)
        self._form = Template(mesh.comm, form, constants, coefficients)
        self._numbers = temperature.numbers
        self._space = _dolfinx.scalar_space(mesh, 0)
        volume = Template(mesh.comm, q * volume_measure(cell_type, 2), ())
        self._volume = _dolfinx.assemble_vector(volume.bind([self._space], ()))

    def of(self, displacement: _dolfinx.fem.Function, values: tuple[float, ...] = ()) -> np.ndarray:
        """Return the means on this rank's cells, shape (n_owned,). Collective.

        Args:
            displacement: The displacement of the body.
            values: Values of the constants of the quantity.
        """
        numbers = (*values, *self._numbers, *self._parts.parameters)
        functions = [displacement, *self._fields]
        bound = self._form.bind([self._space], numbers, functions, cells=self._parts.cells)
        means = _dolfinx.assemble_vector(bound) / self._volume
        return np.asarray(means[_dolfinx.cell_dofs(self._space).ravel()[: len(means)]])


class CellStress(CellMeans):
    """Means of the stress over the cells of one body."""

    def __init__(
        self, mesh: _dolfinx.mesh.Mesh, body: Body, comm: MPI.Comm, temperature: Temperature
    ) -> None:
        """Compile the forms. Collective on ``comm``."""
        super().__init__(mesh, body, comm, temperature, (_weighted_sum, len(COMPONENTS)))

    def components(self, displacement: _dolfinx.fem.Function) -> np.ndarray:
        """Return the `COMPONENTS` of the stress on this rank's cells, shape (n_owned, 6). Collective."""
        chosen = np.eye(len(COMPONENTS))
        return np.stack([self.of(displacement, tuple(row)) for row in chosen], axis=1)


def von_mises(
    displacement: _dolfinx.fem.Function, body: Body, comm: MPI.Comm, temperature: Temperature = Temperature()
) -> _dolfinx.fem.Function:
    """Return the von Mises stress averaged over each cell, [force / length²], a piecewise constant Function.

    Collective on ``comm``.

    Args:
        displacement: The displacement Function of the body.
        body: The body with its materials.
        comm: Communicator of the state.
        temperature: Temperature change of the body.
    """
    mesh = displacement.function_space.mesh
    means = CellMeans(mesh, body, comm, temperature, (_equivalent, 0))
    return _dolfinx.cell_field(mesh, "von_mises", means.of(displacement))


def stress(
    displacement: _dolfinx.fem.Function, body: Body, comm: MPI.Comm, temperature: Temperature
) -> _dolfinx.fem.Function:
    """Return the mean stress of each cell, a piecewise constant Function of shape (3, 3). Collective."""
    mesh = displacement.function_space.mesh
    components = CellStress(mesh, body, comm, temperature).components(displacement)
    return _dolfinx.cell_field(mesh, "stress", tensors(components))


def principal_stress(stress: _dolfinx.fem.Function, cells: np.ndarray) -> _dolfinx.fem.Function:
    """Return the principal stresses σ₁ ≥ σ₂ ≥ σ₃ of a cellwise stress, a Function of shape (3,). Collective.

    Args:
        stress: The stress of a body.
        cells: Node numbers of all cells of the body, shape (n_cells, nodes of a cell).
    """
    mesh = stress.function_space.mesh
    own = _dolfinx.cell_dofs(stress.function_space).ravel()[: len(cells_of_body(mesh, cells))]
    return _dolfinx.cell_field(mesh, "principal_stress", principal(stress.x.array.reshape(-1, 3, 3)[own]))


def principal(tensor: np.ndarray) -> np.ndarray:
    """Return the eigenvalues of symmetric tensors, shape (..., 3, 3), largest first, shape (..., 3)."""
    return np.linalg.eigvalsh(tensor)[..., ::-1]


def von_mises_of(tensor: np.ndarray) -> np.ndarray:
    """Return the von Mises stress of symmetric tensors, shape (..., 3, 3)."""
    deviator = tensor - np.trace(tensor, axis1=-2, axis2=-1)[..., None, None] / 3 * np.eye(3)
    return np.asarray(np.sqrt(1.5 * (deviator**2).sum(axis=(-2, -1))))


def tensors(components: np.ndarray) -> np.ndarray:
    """Return symmetric tensors, shape (..., 3, 3), of their `COMPONENTS`, shape (..., 6)."""
    full = np.empty((*components.shape[:-1], 3, 3))
    for number, (i, j) in enumerate(COMPONENTS):
        full[..., i, j] = full[..., j, i] = components[..., number]
    return full


def components_of(tensor: np.ndarray) -> np.ndarray:
    """Return the `COMPONENTS` of symmetric tensors, shape (..., 6), of shape (..., 3, 3)."""
    return np.stack([tensor[..., i, j] for i, j in COMPONENTS], axis=-1)


def _equivalent(stress: Expr, _: Constants) -> Expr:
    deviator = stress - ufl.tr(stress) / 3 * ufl.Identity(3)
    return ufl.sqrt(1.5 * ufl.inner(deviator, deviator))


def _weighted_sum(stress: Expr, weights: Constants) -> Expr:
    terms = [weight * stress[place] for weight, place in zip(weights, COMPONENTS, strict=True)]
    return sum(terms[1:], terms[0])


def _weighted(
    materials: tuple[Material, ...],
    cell_type: str,
    q: Expr,
    temperature: Temperature,
    quantity: tuple[OfStress, int],
) -> Written:
    """Return ∫ of a quantity times q dx (a form), its constants and its coefficients."""
    (u,) = _dolfinx.field_symbols(cell_type, 1)
    change, numbers, fields = temperature.write(cell_type)
    of_stress, count = quantity
    weights = scalar_constants(cell_type, count)

    def density(material: Material, constants: tuple[ufl.Constant, ...]) -> Expr:
        return of_stress(stress_in_space(material, u, constants, change), weights) * q

    form, constants = integrate(materials, cell_type, density, volume_measure(cell_type, 2))
    return form, (*weights, *numbers, *constants), [u, *fields]


def _composition(mesh: _dolfinx.mesh.Mesh, body: Body) -> Composition:
    """Return all materials of a body's mesh on every rank, wherever their cells are."""
    count = len(body.materials)
    if count == 1:
        return Composition(body.materials)
    number = body.material_of_cells[cells_of_body(mesh, body.mesh.cells)]
    return Composition(body.materials, {k + 1: np.flatnonzero(number == k) for k in range(count)})
