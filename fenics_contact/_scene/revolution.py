"""What holds of bodies of revolution in a scene: their axis, and what goes with torsion."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from fenics_contact._scene.body import Body
from fenics_contact._scene.checks import check_alike
from fenics_contact._scene.supports import AnySupport
from fenics_contact.errors import InvalidInputError
from fenics_contact.materials.hyperelastic import is_nonlinear


def require_all_or_none(bodies: Mapping[str, Body], deforming: Mapping[str, Body]) -> None:
    """Raise if only some bodies are bodies of revolution, or only some of these may twist.

    `deforming`: those that carry no motion of a tool.
    """
    turned = {name: body.axisymmetric for name, body in bodies.items()}
    check_alike("be bodies of revolution", turned, "give all of them axisymmetric=True")
    twisting = {name: body.torsion for name, body in deforming.items()}
    check_alike("be able to twist", twisting, "give all of them torsion=True")


def hold_axis(body: Body, name: str, prescribed: np.ndarray) -> None:
    """Prescribe that a body moves along its axis there, if it has one; reject supports that prescribe more.

    `prescribed`: what supports prescribe, NaN where free, shape (n_nodes, components), changed in place.
    """
    axis = body.on_axis
    for component, what in body.kinematics.held_on_axis.items():
        moved = np.abs(np.nan_to_num(prescribed[axis, component])).max(initial=0.0)
        if moved > 0.0:
            raise InvalidInputError(
                f"the {what} is zero on the axis of revolution, supports of body {name!r} prescribe up to "
                f"{moved:.3g} there: leave it free or zero"
            )
        prescribed[axis, component] = 0.0


def require_simple_torsion(
    bodies: Iterable[Body], supports: Iterable[AnySupport], others: Mapping[str, bool]
) -> None:
    """Reject what bodies of revolution that may twist do not go with.

    `others`: whether a scene has what else it must not have, by words for what is needed.
    """
    used = {
        "linear materials": any(is_nonlinear(m) for body in bodies for m in body.materials),
        "no rollers": any(support.rollers for support in supports),
        **others,
    }
    for needed, given in used.items():
        if given:
            raise InvalidInputError(
                f"torsion=True needs {needed}, this scene has others: leave it out, or take bodies in space"
            )
