"""Pressure that follows the surface of a body under large deformations."""

from __future__ import annotations

from functools import partial

import numpy as np
import scipy.sparse as sp
import ufl
from ufl.core.expr import Expr

from fenics_contact import _dolfinx
from fenics_contact.fem.load_forms import Symbol, load_fields, load_key, load_name, numbers_of
from fenics_contact.fem.mean_dilatation import assembled
from fenics_contact.fem.templates import Templates, Written, surface_measure
from fenics_contact.scene import Pressure, Scene, Ufl, cofactor, deformation_gradient

#: The forms, by number of arguments less one.
FORMS = ("growth", "softening")


def prepare_following(templates: Templates, scene: Scene) -> None:
    """Compile the missing forms of a scene's following pressures. Collective."""
    for load in scene.following_pressures:
        cell_type = scene.bodies[load.body].mesh.cell_type
        for kind in FORMS:
            name = (f"{kind} of", *load_name(load, cell_type))
            templates.get(_key(kind, load, cell_type), name, partial(_written, kind, load, cell_type))


def _key(kind: str, load: Pressure, cell_type: str) -> tuple[object, ...]:
    return (kind, *load_key(load, (), cell_type))


def _written(kind: str, load: Pressure, cell_type: str) -> Written:
    (u,) = _dolfinx.field_symbols(cell_type, 1)
    space, symbol = u.ufl_function_space(), Symbol(load, cell_type)
    v, du = ufl.TestFunction(space), ufl.TrialFunction(space)
    normal = ufl.FacetNormal(_dolfinx.template(cell_type))

    def growth(along: Expr) -> Expr:
        change = cofactor(deformation_gradient(u)) - ufl.Identity(len(u))
        return -symbol.expression * ufl.dot(change * normal, along)

    density = growth(v)
    if kind == "softening":
        density = -ufl.derivative(growth(v), u, du)
    return density * surface_measure(cell_type), symbol.constants, (u, *symbol.coefficients)


class FollowingPressure:
    """A pressure on the surface of one mesh: how it changes as the surface moves.

    Of an even pressure the unsymmetric part of the stiffness is an integral along the edge of the surface: it
    cancels between neighbours, and does no work on edges that are held or slide in planes of symmetry.

    References:
        K. Schweizerhof, E. Ramm, Displacement dependent pressure loads in nonlinear finite element analyses,
        Comput. Struct. 18 (1984) 1099-1114.
    """

    def __init__(
        self,
        templates: Templates,
        load: Pressure,
        cell_type: str,
        space: _dolfinx.fem.FunctionSpace,
        points: np.ndarray,
        facets: tuple[np.ndarray, np.ndarray],
        acted: np.ndarray,
    ) -> None:
        """Bind the forms; arguments as in `FormLibrary.load`, of which the forms are prepared."""
        self._mesh = space.mesh
        self._points = points if isinstance(load.value, Ufl) else points - points[0]
        self._displacement = _dolfinx.fem.Function(space)
        fields = (self._displacement, *load_fields(load, space, points, acted))
        self._growth, self._softening = (
            templates[_key(kind, load, cell_type)].bind([space] * number, numbers_of(load), fields, facets)
            for number, kind in enumerate(FORMS, start=1)
        )

    def at(self, displacement: np.ndarray) -> tuple[np.ndarray, sp.csr_matrix]:
        """Return what the force is more than on the undeformed surface, and its stiffness.

        Args:
            displacement: By dof, shape (dim n,), [length].

        Returns:
            Force, shape (dim n,), [force]; less its growth with the displacement, shape (dim n, dim n),
            [force / length].
        """
        _dolfinx.update_coordinates(self._mesh, self._points)
        self._displacement.x.array[:] = displacement
        return (
            _dolfinx.assemble_vector(self._growth),
            assembled(self._softening, (displacement.size,) * 2),
        )
