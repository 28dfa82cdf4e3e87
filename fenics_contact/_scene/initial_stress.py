"""Stresses that bodies have before they are loaded: which components they may have, and their sum."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from fenics_contact._scene.body import Body
from fenics_contact._scene.loads import InitialStress
from fenics_contact.errors import InvalidInputError
from fenics_contact.materials.elastic import Transverse
from fenics_contact.materials.hyperelastic import is_nonlinear


def require_components(load: InitialStress, body: Body) -> None:
    """Reject a body of nonlinear materials, and numbers for components that it does not have."""
    stiff = [type(each).__name__ for each in body.materials if is_nonlinear(each)]
    if stiff:
        raise InvalidInputError(
            f"InitialStress needs linear materials, body {load.body!r} has {stiff[0]}: take "
            "IsotropicElasticity or another one of small strains without a history"
        )
    if not callable(load.value):
        _check(np.array([load.value]), load.body, body)


def _check(stress: np.ndarray, name: str, body: Body) -> None:
    """Reject components that are not zero but have no place in a body; `stress`: (n, 6)."""
    places = {"zz": 2, "yz": 3, "xz": 4}
    across = all(isinstance(each, Transverse) for each in body.materials)
    without = [word for word in body.kinematics.zero_stress if not (across and word == "zz")]
    given = [word for word in without if stress[:, places[word]].any()]
    if given:
        raise InvalidInputError(
            f"the InitialStress of body {name!r} must be zero in {' and '.join(without)}, which it does not "
            f"have, got others in {' and '.join(given)}: leave them zero; the order is xx, yy, zz, yz, xz, xy"
        )


def initial_stress(loads: Iterable[InitialStress], body: Body) -> np.ndarray:
    """Return the sum of initial stresses on the cells of a body, (n_cells, 6), xx, yy, zz, yz, xz, xy."""
    total = np.zeros((body.mesh.n_cells, 6))
    for load in loads:
        found = load.on_cells(body.mesh)
        _check(found, load.body, body)
        total += found
    return total
