"""Bodies of revolution: materials of space in a half plane (r, z).

A material is written in terms of a displacement in space and its gradient. Of a body of revolution it gets a
stand-in with three components, along the radius, the axis and the circumference, which stand for x, y and z.
What it makes of it is then written in the displacement (u_r, u_z) of the plane: the gradient of the stand-in
becomes [[u_r,r, u_r,z, −u_θ / r], [u_z,r, u_z,z, 0], [u_θ,r, u_θ,z, u_r / r]], where without torsion u_θ = 0.
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


class StandIn(ufl.Coefficient):
    """A displacement in space of which value and gradient are known as expressions in the plane.

    Attributes:
        value: Vector of three components.
        gradient: Tensor, 3 x 3.
    """

    value: Expr
    gradient: Expr


def stand_in(number: int, value: Expr, gradient: Expr) -> StandIn:
    """Return a stand-in; ``number`` distinguishes those of one form."""
    made = StandIn(_dolfinx.displacement_space(_IN_SPACE), number)
    made.value, made.gradient = value, gradient
    return made


def stand_ins(cell_type: str, fields: tuple[Expr, ...]) -> tuple[StandIn, ...]:
    """Return a stand-in for each of some displacements in the plane."""
    r, twists = ufl.SpatialCoordinate(_dolfinx.template(cell_type))[0], _dolfinx.has_torsion(cell_type)
    return tuple(
        stand_in(
            number,
            ufl.as_vector([u[0], u[1], u[2] if twists else 0]),
            _of_revolution(ufl.grad(u), u[0] / r, u[2] / r if twists else 0),
        )
        for number, u in enumerate(fields)
    )


def strained(gradient: Expr, hoop: Expr | float) -> StandIn:
    """Return a stand-in with the derivatives by r and z and a hoop strain, and without displacement."""
    return stand_in(0, ufl.as_vector([0, 0, 0]), _of_revolution(gradient, hoop, 0))


def in_plane(density: Expr, cell_type: str) -> Expr:
    """Return what materials of space made of stand-ins, written on the cells."""
    return map_integrand_dags(_Replaced(cell_type), expand_derivatives(ufl.as_ufl(density)))


def _of_revolution(gradient: Expr, hoop: Expr | float, turn: Expr | float) -> Expr:
    """Return the gradient in space; ``turn`` is u_θ / r."""
    twisted = gradient.ufl_shape[0] == 3
    around = [gradient[2, 0], gradient[2, 1], hoop] if twisted else [0, 0, hoop]
    return ufl.as_tensor(
        [
            [gradient[0, 0], gradient[0, 1], -turn if twisted else 0],
            [gradient[1, 0], gradient[1, 1], 0],
            around,
        ]
    )


class _Replaced(MultiFunction):  # type: ignore[misc]
    """Replaces stand-ins, their gradients and coordinates in space."""

    def __init__(self, cell_type: str) -> None:
        super().__init__()
        x = ufl.SpatialCoordinate(_dolfinx.template(cell_type))
        self._place = x if len(x) == 3 else ufl.as_vector([x[0], x[1], 0])

    expr = MultiFunction.reuse_if_untouched

    def grad(self, o: Expr) -> Expr:
        (of,) = o.ufl_operands
        if not any(isinstance(each, StandIn) for each in extract_coefficients(of)):
            return o
        if not isinstance(of, StandIn):
            raise InvalidInputError(
                "materials of bodies of revolution may depend on the displacement and its gradient alone, "
                f"got the gradient of {of}: write them in terms of grad(u)"
            )
        return of.gradient

    def coefficient(self, o: Expr) -> Expr:
        return o.value if isinstance(o, StandIn) else o

    def spatial_coordinate(self, o: Expr) -> Expr:
        return self._place if len(o) == 3 else o
