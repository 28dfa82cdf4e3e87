"""Internal forces and tangent of hyperelastic materials."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import scipy.sparse as sp
import ufl
from ufl.core.expr import Expr

from fenics_contact import _dolfinx
from fenics_contact.fem.composition import Composition, integrate, material_sets
from fenics_contact.fem.deformation import Dilatation
from fenics_contact.fem.mechanics import Response
from fenics_contact.fem.templates import Constants, Templates, Written, volume_measure
from fenics_contact.scene import HistoryMaterial, Material, Scene, is_nonlinear

#: What is compiled for every set of materials with a nonlinear one among them, by number of arguments.
FORMS = ("energy", "internal force", "tangent")


class HyperelasticMechanics:
    """`Mechanics` of materials with an energy; linear ones among them stay small-strain."""

    def __init__(
        self,
        templates: Templates,
        parts: Composition,
        cell_type: str,
        space: _dolfinx.fem.FunctionSpace,
        points: np.ndarray,
    ) -> None:
        """Bind the forms; arguments as in `FormLibrary.mechanics`."""
        nodes, dofs = _dolfinx.node_dofs(space)
        by_block = np.empty_like(points)
        by_block[dofs] = points[nodes]
        self._mesh, self._points = space.mesh, points
        self._dilatation = Dilatation(space, cell_type, by_block)
        self._displacement = _dolfinx.fem.Function(space)
        self._energy, self._force, self._tangent = (
            templates[kind, parts.materials, cell_type].bind(
                [space] * number, parts.parameters, [self._displacement], mesh=space.mesh, cells=parts.cells
            )
            for number, kind in enumerate(FORMS)
        )

    def at(
        self, displacement: np.ndarray, history: np.ndarray | None = None, duration: float = 0.0
    ) -> Response:
        """Assemble; see `Mechanics.at`."""
        _dolfinx.update_coordinates(self._mesh, self._points)
        self._displacement.x.array[:] = displacement
        indptr, indices, data = _dolfinx.assemble_csr(self._tangent)
        return Response(
            force=_dolfinx.assemble_vector(self._force),
            stiffness=sp.csr_matrix((data, indices, indptr), shape=(displacement.size,) * 2),
            energy=_dolfinx.assemble_scalar(self._energy),
            least_jacobian=self.least_jacobian(displacement),
        )

    def least_jacobian(self, displacement: np.ndarray) -> float:
        """Return the smallest det F; see `Mechanics.least_jacobian`."""
        return float(self._dilatation.at(displacement).min())


def prepare_mechanics(templates: Templates, scene: Scene) -> None:
    """Compile the missing forms of a scene's nonlinear materials. Collective."""
    for body in scene.bodies.values():
        for materials in material_sets(body):
            others = [material for material in materials if not isinstance(material, HistoryMaterial)]
            if others and any(map(is_nonlinear, materials)):
                _prepare(templates, materials, body.mesh.cell_type)


def _prepare(templates: Templates, materials: tuple[Material, ...], cell_type: str) -> None:
    for kind in FORMS:
        name = (kind, *(type(material) for material in materials), cell_type)
        templates.get((kind, materials, cell_type), name, partial(_written, kind, materials, cell_type))


def _written(kind: str, materials: tuple[Material, ...], cell_type: str) -> Written:
    V = _dolfinx.displacement_space(cell_type)
    du, v = ufl.TrialFunction(V), ufl.TestFunction(V)
    (u,) = _dolfinx.field_symbols(cell_type, 1)

    def integrand(material: Material, constants: Constants) -> Expr | None:
        if isinstance(material, HistoryMaterial):
            return None  # what it answers is added to the assembled forms
        return _energy(material, u, constants) if kind == "energy" else _work(material, u, v, constants)

    form, constants = integrate(materials, cell_type, integrand, volume_measure(cell_type))
    return ufl.derivative(form, u, du) if kind == "tangent" else form, constants, (u,)


def _energy(material: Any, u: Expr, constants: Constants) -> Expr:
    """Return the energy per undeformed volume."""
    if is_nonlinear(material):
        return material.density(_gradient(u), constants)
    return material.stiffness(u, u, constants) / 2


def _work(material: Any, u: Expr, v: Expr, constants: Constants) -> Expr:
    """Return the work of the stresses on v per undeformed volume."""
    if is_nonlinear(material):
        return ufl.inner(material.first_piola(_gradient(u), constants), ufl.grad(v))
    return material.stiffness(u, v, constants)


def _gradient(u: Expr) -> Expr:
    """Return F = I + ∇u."""
    return ufl.Identity(len(u)) + ufl.grad(u)
