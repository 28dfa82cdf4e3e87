"""Displacements in space whose value and gradient are expressions of others.

A material is written in terms of a displacement in space and its gradient. Where a body has other components
or coordinates it gets a stand-in, and what it makes of it is then written in the displacement of the body.
"""

from __future__ import annotations

import ufl
from ufl.algorithms import expand_derivatives, extract_coefficients
from ufl.algorithms.map_integrands import map_integrand_dags
from ufl.core.expr import Expr
from ufl.corealg.multifunction import MultiFunction

from fenics_contact import _dolfinx
from fenics_contact.errors import InvalidInputError

#: Cells on which stand-ins are written: any in space.
_IN_SPACE = "tetrahedron"


class LiftedCoefficient(ufl.Coefficient):
    """A displacement in space of which value and gradient are known as expressions."""

    value: Expr
    gradient: Expr


def stand_in(number: int, value: Expr, gradient: Expr) -> LiftedCoefficient:
    """Return a stand-in; ``number`` distinguishes those of one form."""
    made = LiftedCoefficient(_dolfinx.displacement_space(_IN_SPACE), number)
    made.value, made.gradient = value, gradient
    return made


def replaced(density: Expr, x: Expr) -> Expr:
    """Return what materials of space made of stand-ins, written on cells with the coordinates x."""
    return map_integrand_dags(_Replaced(x), expand_derivatives(ufl.as_ufl(density)))


class _Replaced(MultiFunction):  # type: ignore[misc]
    """Replaces stand-ins, their gradients and coordinates in space."""

    def __init__(self, x: Expr) -> None:
        super().__init__()
        self._place = x if len(x) == 3 else ufl.as_vector([x[0], x[1], 0])

    expr = MultiFunction.reuse_if_untouched

    def grad(self, o: Expr) -> Expr:
        (of,) = o.ufl_operands
        if not any(isinstance(each, LiftedCoefficient) for each in extract_coefficients(of)):
            return o
        if not isinstance(of, LiftedCoefficient):
            raise InvalidInputError(
                "materials of bodies of revolution may depend on the displacement and its gradient alone, "
                f"got the gradient of {of}: write them in terms of grad(u)"
            )
        return of.gradient

    def coefficient(self, o: Expr) -> Expr:
        return o.value if isinstance(o, LiftedCoefficient) else o

    def spatial_coordinate(self, o: Expr) -> Expr:
        return self._place if len(o) == 3 else o
