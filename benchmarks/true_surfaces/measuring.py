"""Solve the cases with surfaces taken in each way."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from mpi4py import MPI

from benchmarks.true_surfaces.cases import CASES, Model
from fenics_contact import contact_area, solve_scene
from fenics_contact._scene.pairs import Discretisation
from fenics_contact._surfaces.true_surface import Geometry
from fenics_contact.qp import FaceNewton

WAYS: tuple[Geometry, ...] = ("faceted", "reconstructed", "best")
#: Facets around a quarter of the circle.
FACETS = (8, 16, 32)
#: What is also measured by mortar.
BY_MORTAR = ("shaft in a bush",)


def solved(model: Model, geometry: Geometry, discretisation: Discretisation = "node") -> dict[str, float]:
    """Return peak pressure, area of contact, and about how many slave nodes lie on its radius."""
    pairs = [replace(pair, geometry=geometry, discretisation=discretisation) for pair in model.scene.contacts]
    scene = replace(model.scene, contacts=pairs)
    state = solve_scene(scene, MPI.COMM_SELF, solver=FaceNewton(tolerance=1e-8))
    closed = float((state.contact.status > 0).sum())
    return {
        "peak": float(state.contact.pressure.max()),
        "area": contact_area(state),
        "cells": closed if scene.dim == 2 else float(np.sqrt(4 * closed / np.pi)),
    }


def known(name: str) -> dict[str, Any]:
    """Return what a case is compared with: theory, or true surfaces on a mesh of half the size."""
    model = CASES[name](FACETS[-1])
    if model.peak is not None and model.area is not None:
        return {"from": "theory", "peak": model.peak, "area": model.area}
    found = solved(CASES[name](FACETS[-1], 2), "best")
    return {"from": "finer mesh", "peak": found["peak"], "area": found["area"]}


def errors(
    name: str, facets: int, discretisation: Discretisation, exact: dict[str, Any], fineness: int = 1
) -> dict[str, Any]:
    """Return the relative errors of a case on one mesh, by what the surface is taken for."""
    model = CASES[name](facets, fineness)
    found = {way: solved(model, way, discretisation) for way in WAYS}
    radius = exact["area"] if model.scene.dim == 2 else np.sqrt(4 * exact["area"] / np.pi)
    return {
        "facets": facets,
        "on_contact": round(facets * radius / (np.pi / 2), 2),
        "cells": round(found["best"]["cells"]),
        **{
            quantity: {way: round(each[quantity] / exact[quantity] - 1, 5) for way, each in found.items()}
            for quantity in ("peak", "area")
        },
    }


def study(_: MPI.Comm, name: str, discretisation: Discretisation) -> dict[str, Any]:
    """Return all measurements of a case, by one process."""
    exact = known(name)
    runs = [errors(name, facets, discretisation, exact) for facets in FACETS]
    return {"case": name, "discretisation": discretisation, "exact": exact, "runs": runs}


def refined(_: MPI.Comm) -> dict[str, Any]:
    """Return the errors of a plane case for finer and finer slaves, by one process."""
    name = "disc on a block"
    return {"runs": [errors(name, 16, "node", known(name), fineness) for fineness in (1, 2, 4)]}
