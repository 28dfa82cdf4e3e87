"""The energy of a difference of gradients for moduli that vary in space: by compiled forms."""

from __future__ import annotations

from functools import partial

import numpy as np
import ufl
from ufl.algorithms import expand_derivatives

from fenics_contact import _dolfinx
from fenics_contact.fem import FormLibrary, Template, Written, scalar_constants, volume_measure
from fenics_contact.feti import Subdomain
from fenics_contact.scene import Material

#: Degree of the quadrature on linear cells, where both gradients are of first degree in each coordinate; it
#: is doubled on quadratic ones.
DEGREE = 2


def compile_energy(forms: FormLibrary, material: Material, cell_type: str) -> Template:
    """Compile the energy of a material unless that was done. Collective."""
    key = ("energy of a difference", material, cell_type)
    name = ("energy of a difference", type(material), cell_type)
    return forms.templates.get(key, name, partial(_write, material, cell_type))


def _write(material: Material, cell_type: str) -> Written:
    """Return ∫ C (g − ∇u) : (g − ∇u) over each cell, with the rows of g and u as coefficients.

    A material is defined for displacements only. Its energy is written for c·x − d with constants c and d,
    whose gradient is c; then c is replaced by g − ∇u, and d by (g − ∇u)·x, so that the displacement is zero:
    materials may resist displacements, too.
    """
    dim = _dolfinx.dimension(cell_type)
    u, *rows = _dolfinx.field_symbols(cell_type, dim + 1)
    q = ufl.TestFunction(_dolfinx.cellwise_space(cell_type))
    parameters = scalar_constants(cell_type, len(material.parameters))
    x = ufl.SpatialCoordinate(_dolfinx.template(cell_type))
    c, d = (_dolfinx.constant_symbol(cell_type, shape) for shape in ((dim, dim), (dim,)))
    trial = ufl.dot(c, x) - d
    density = expand_derivatives(material.stiffness(trial, trial, parameters))
    difference = ufl.as_tensor([[row[j] for j in range(dim)] for row in rows]) - ufl.grad(u)
    density = ufl.replace(density, {c: difference, d: ufl.dot(difference, x)})
    return density * q * volume_measure(cell_type, DEGREE), parameters, (u, *rows)


def energy_on_subdomain(
    form: Template,
    material: Material,
    subdomain: Subdomain,
    blocks: np.ndarray,
    displacement: np.ndarray,
    gradient: np.ndarray,
) -> np.ndarray:
    """Return ∫ C (g − ∇u) : (g − ∇u) over every cell of a subdomain, as if all were of one material.

    Args:
        form: The compiled form of the material.
        material: The material.
        subdomain: The subdomain.
        blocks: Block of each node of some cells, shape (n, nodes of a cell); elsewhere the result is
            undefined.
        displacement: u at these nodes, shape (n, nodes of a cell, dim), [length].
        gradient: g there, shape (n, nodes of a cell, dim, dim), dimensionless.

    Returns:
        Shape (n_cells,), in the order of the subdomain's mesh, [force · length].
    """
    space = subdomain.mesh.space
    mesh, dim = space.mesh, subdomain.mesh.dim
    _dolfinx.update_coordinates(mesh, subdomain.points[np.argsort(subdomain.mesh.nodes)])
    fields = []
    for values in (displacement, *(gradient[:, :, k] for k in range(dim))):
        fields.append(_dolfinx.fem.Function(space))
        fields[-1].x.array.reshape(-1, dim)[blocks] = values
    of_cells = _dolfinx.scalar_space(mesh, 0)
    energies = _dolfinx.assemble_vector(form.bind([of_cells], material.parameters, fields))
    return np.asarray(energies[_dolfinx.cell_dofs(of_cells).ravel()])
