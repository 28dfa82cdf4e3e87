"""Designs in which an objective or a callback fails on the last rank alone, or something differs there."""

from __future__ import annotations

from typing import Any

import numpy as np
import ufl
from mpi4py import MPI

from fenics_contact import (
    ContactPair,
    ContactProblem,
    Scene,
    ShapeProblem,
    State,
    Support,
    Surface,
    SurfaceDesign,
    minimize,
)
from fenics_contact.design import BundleTrust, ContactForces, Partials, TotalPotential, VolumeIntegral
from fenics_contact.design.forms import ShapeForms
from fenics_contact.results import ContactResult
from tests.design.blocks import side
from tests.ranks.given import CUT, MESH, case, fails_on_last, is_last, scene
from tests.ranks.scene_cases import OwnFloor, flat, upward


def design(comm: MPI.Comm, objective: Any = TotalPotential(), given: Scene | None = None) -> ShapeProblem:
    """A block on a floor whose lower side moves."""
    moves = SurfaceDesign("block", side(MESH, "z0"), (2, 2))
    return ShapeProblem(ContactProblem(given or held(), comm, partitions=CUT), moves, objective)


def held(**parts: Any) -> Scene:
    """The block held at its top."""
    return scene(supports=[Support("block", "z1", (0.0, 0.0, -0.01))], loads=[], **parts)


def value_of(comm: MPI.Comm, objective: Any) -> None:
    design(comm, objective)(np.zeros(4))


def first_force(contact: ContactResult) -> tuple[float, np.ndarray, np.ndarray]:
    by_normal = np.zeros(len(contact.normal_force))
    by_normal[0] = 1.0
    return contact.normal_force[0], by_normal, np.zeros((len(by_normal), 2))


@case
def contact_objective_raises(comm: MPI.Comm) -> None:
    value_of(comm, ContactForces(fails_on_last(comm, first_force)))


@case
def contact_objective_is_nan(comm: MPI.Comm) -> None:
    def function(contact: ContactResult) -> tuple[float, np.ndarray, np.ndarray]:
        value, normal, tangential = first_force(contact)
        return value, (np.nan if is_last(comm) else 1.0) * normal, tangential

    value_of(comm, ContactForces(function))


@case
def integrand_raises(comm: MPI.Comm) -> None:
    def squares(u: Any, x: Any, stress: Any) -> Any:
        return ufl.inner(u, u)

    value_of(comm, VolumeIntegral("squares", fails_on_last(comm, squares), "block"))


class OwnObjective:
    """An objective of the user's own that fails in its middle."""

    def __init__(self, comm: MPI.Comm) -> None:
        self._comm, self._inner = comm, TotalPotential()

    def value(self, state: State, forms: ShapeForms) -> float:
        return self._inner.value(state, forms)

    def partials(self, state: State, forms: ShapeForms) -> Partials:
        if is_last(self._comm):
            raise RuntimeError("a bug on one rank")
        state.gather_displacement("block")
        return self._inner.partials(state, forms)


@case
def own_objective_raises(comm: MPI.Comm) -> None:
    value_of(comm, OwnObjective(comm))


@case
def curvatures_raise(comm: MPI.Comm) -> None:
    floor = OwnFloor(upward, fails_on_last(comm, flat))
    given = held(contacts=[ContactPair(Surface("block", "z0"), floor)])
    design(comm, given=given)(np.zeros(4))


@case
def variables_differ(comm: MPI.Comm) -> None:
    design(comm)(np.full(4, 1e-3 * is_last(comm)))


@case
def variables_are_nan(comm: MPI.Comm) -> None:
    design(comm)(np.full(4, np.nan if is_last(comm) else 0.0))


def minimized(comm: MPI.Comm, callback: Any) -> None:
    method = BundleTrust(max_evaluations=3, raise_on_failure=False)
    minimize(design(comm), np.zeros(4), method, bounds=(-0.05, 0.05), callback=callback)


@case
def callback_raises(comm: MPI.Comm) -> None:
    minimized(comm, fails_on_last(comm, lambda record, best: None))


@case
def callback_exits(comm: MPI.Comm) -> None:
    minimized(comm, fails_on_last(comm, lambda record, best: None, SystemExit))


@case
def starts_differ(comm: MPI.Comm) -> None:
    start = np.full(4, 1e-3 * is_last(comm))
    minimize(design(comm), start, bounds=(-0.05, 0.05))
