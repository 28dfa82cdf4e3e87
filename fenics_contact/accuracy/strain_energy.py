"""Energy of what a recovered displacement gradient differs by from that of the displacement, by cell."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import partial
from typing import Any

import numpy as np
import ufl
from ufl.algorithms import expand_derivatives

from fenics_contact import _dolfinx
from fenics_contact.feti import Decomposition
from fenics_contact.feti.subdomain import Subdomain
from fenics_contact.feti.templates import Template, Written, scalar_constants, volume_measure
from fenics_contact.scene import Body, Material

#: Of the quadrature: gradients of both kinds are linear, or of first degree in each coordinate.
DEGREE = 2

#: Material and type of cells -> the compiled form.
Forms = Mapping[tuple[Material, str], Template]


def prepare(decomposition: Decomposition, bodies: Iterable[Body]) -> Forms:
    """Compile the forms of all materials, where they are not there yet. Collective."""
    forms = {}
    for body in bodies:
        cell_type = body.mesh.cell_type
        for material in body.materials:
            key = ("difference energy", material, cell_type)
            name = ("difference energy", type(material), cell_type)
            forms[material, cell_type] = decomposition.forms.templates.get(
                key, name, partial(_write, material, cell_type)
            )
    return forms


def _write(material: Material, cell_type: str) -> Written:
    """Return ∫ over each cell of the energy of G − ∇u, which is twice that of the strain: C e : e.

    A material knows displacements alone. Its energy is written for c·x − d with constants c and d, whose
    gradient is c; then c gives way to G − ∇u, and d to (G − ∇u)·x: materials may resist displacements too,
    and there are none here.
    """
    dim = _dolfinx.dimension(cell_type)
    template = _dolfinx.template(cell_type)
    u, *rows = _dolfinx.field_symbols(cell_type, dim + 1)
    q = ufl.TestFunction(_dolfinx.cellwise_space(cell_type))
    parameters = scalar_constants(cell_type, len(material.parameters))
    x = ufl.SpatialCoordinate(template)
    c, d = ufl.Constant(template, shape=(dim, dim)), ufl.Constant(template, shape=(dim,))
    trial = ufl.dot(c, x) - d
    density = expand_derivatives(material.stiffness(trial, trial, parameters))
    difference = ufl.as_tensor([[row[j] for j in range(dim)] for row in rows]) - ufl.grad(u)
    density = ufl.replace(density, {c: difference, d: ufl.dot(difference, x)})
    return density * q * volume_measure(cell_type, DEGREE), parameters, (u, *rows)


def energy_of_difference(
    form: Template, material: Material, subdomain: Subdomain, displacement: np.ndarray, gradient: np.ndarray
) -> np.ndarray:
    """Return ∫ C e : e with e the strain of G − ∇u on every cell of a subdomain, as if of one material.

    Args:
        form: The compiled form of the material.
        material: The material.
        subdomain: The subdomain.
        displacement: u by block of the subdomain's mesh, shape (n, dim), [length].
        gradient: G by block, shape (n, dim, dim), dimensionless.

    Returns:
        Shape (n_cells,), in the order of the subdomain's mesh, [force · length].
    """
    mesh = subdomain.mesh.space.mesh
    _dolfinx.update_coordinates(mesh, subdomain.points[np.argsort(subdomain.mesh.nodes)])
    columns = [displacement, *(gradient[:, k] for k in range(gradient.shape[1]))]
    fields = [_field(subdomain.mesh.space, values) for values in columns]
    space = _dolfinx.scalar_space(mesh, 0)
    values = _dolfinx.assemble_vector(form.bind([space], material.parameters, fields))
    return np.asarray(values[_dolfinx.cell_dofs(space).ravel()])


def _field(space: Any, values: np.ndarray) -> Any:
    field = _dolfinx.Function(space)
    field.x.array[:] = values.ravel()
    return field
