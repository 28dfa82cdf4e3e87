"""Bodies that expand by heat under large deformations: materials feel F / θ with a thermal stretch θ.

Of a displacement u they get a stand-in whose gradient is (I + ∇u) / θ − I, in space also in the plane, of
test functions one whose gradient is ∇v / θ; see `materials.stand_ins`. An energy θ³ W(F / θ) then has
the work θ³ ∂W : δF / θ.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import ufl
from ufl.core.expr import Expr

from fenics_contact.materials.elastic import can_expand
from fenics_contact.materials.hyperelastic import is_nonlinear
from fenics_contact.materials.plastic import has_history

if TYPE_CHECKING:
    from fenics_contact._kinematics.element import Element
    from fenics_contact.materials.stand_ins import LiftedCoefficient


def heat_expands(material: Any) -> bool:
    """Return whether forms of a material have its thermal stretch: it has an energy and expands."""
    return is_nonlinear(material) and can_expand(material) and not has_history(material)


def thermal_split(stretch: Expr, displacement: Expr, *others: Expr) -> tuple[LiftedCoefficient, ...]:
    """Return stand-ins for a displacement and for other fields, test functions among them."""
    from fenics_contact.materials.stand_ins import stand_in  # others go without

    gradient = (ufl.Identity(3) + _in_space(displacement)) / stretch - ufl.Identity(3)
    gradients = [gradient, *(_in_space(each) / stretch for each in others)]
    nowhere = ufl.as_vector([0, 0, 0])
    return tuple(stand_in(number, nowhere, each) for number, each in enumerate(gradients))


def on_stretched(density: Expr, element: Element) -> Expr:
    """Return what a material made of stand-ins, in displacements on the cells."""
    from fenics_contact.materials.stand_ins import replaced

    return replaced(density, element.x)


def _in_space(field: Expr) -> Expr:
    """Return the gradient of a field, 3 x 3."""
    gradient = getattr(field, "gradient", None)
    if gradient is not None:
        return gradient  # of a stand-in
    G = ufl.grad(field)
    if G.ufl_shape == (3, 3):
        return G
    return ufl.as_tensor([[G[0, 0], G[0, 1], 0], [G[1, 0], G[1, 1], 0], [0, 0, 0]])
