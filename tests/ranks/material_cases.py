"""Materials that fail on the last rank alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import ufl
from mpi4py import MPI

from fenics_contact.materials import EnergyModel, IsotropicElasticity
from tests.ranks.given import (
    MESH,
    Function,
    case,
    differs_on_last,
    fails_on_last,
    is_last,
    scene,
    solve,
)


@dataclass(frozen=True)
class OwnMaterial(IsotropicElasticity):
    """Steel with functions in the place of its own."""

    of_kernel: Function | None = None
    of_stress: Function | None = None
    of_parameters: Function | None = None

    @property
    def parameters(self) -> tuple[float, ...]:
        own = super().parameters
        return own if self.of_parameters is None else tuple(self.of_parameters(own))

    def kernel(self, points: np.ndarray) -> np.ndarray:
        own = super().kernel(points)
        return own if self.of_kernel is None else np.asarray(self.of_kernel(own))

    def stress(self, u: Any, parameters: Any) -> Any:
        own = super().stress(u, parameters)
        return own if self.of_stress is None else self.of_stress(own)


def same(value: Any) -> Any:
    return value


def of_material(comm: MPI.Comm, **functions: Any) -> None:
    solve(comm, scene(material=OwnMaterial(210.0, 0.3, **functions)))


@case
def kernel_raises(comm: MPI.Comm) -> None:
    of_material(comm, of_kernel=fails_on_last(comm, same))


@case
def kernel_exits(comm: MPI.Comm) -> None:
    of_material(comm, of_kernel=fails_on_last(comm, same, SystemExit))


@case
def kernel_is_nan(comm: MPI.Comm) -> None:
    of_material(comm, of_kernel=differs_on_last(comm, same, lambda modes: np.nan * modes))


@case
def late_kernel_raises(comm: MPI.Comm) -> None:
    """The kernel of single cells is right, that of whole bodies is not found."""

    def kernel(modes: np.ndarray) -> np.ndarray:
        if len(modes) == MESH.n_nodes and is_last(comm):
            raise RuntimeError("a bug on one rank")
        return modes

    of_material(comm, of_kernel=kernel)


@case
def stress_raises(comm: MPI.Comm) -> None:
    of_material(comm, of_stress=fails_on_last(comm, same))


@case
def stress_is_nan(comm: MPI.Comm) -> None:
    of_material(comm, of_stress=differs_on_last(comm, same, lambda stress: np.nan * stress))


@case
def parameters_differ(comm: MPI.Comm) -> None:
    of_material(comm, of_parameters=differs_on_last(comm, same, lambda p: [2.0 * value for value in p]))


@dataclass(frozen=True)
class OwnEnergy(EnergyModel):
    """Hooke's law by its energy."""

    fails: Function

    @property
    def parameters(self) -> tuple[float, ...]:
        return 121.0, 81.0

    def energy(self, strain: Any, parameters: Any) -> Any:
        lame, shear = parameters
        return self.fails(lame / 2 * ufl.tr(strain) ** 2 + shear * ufl.inner(strain, strain))


@case
def energy_raises(comm: MPI.Comm) -> None:
    solve(comm, scene(material=OwnEnergy(fails_on_last(comm, same))))


@dataclass(frozen=True)
class LateStress(IsotropicElasticity):
    """Has a stiffness of its own and a stress that is asked for by fields alone."""

    fails: Function = same

    def stiffness(self, u: Any, v: Any, parameters: Any) -> Any:
        return ufl.inner(super().stress(u, parameters), ufl.sym(ufl.grad(v)))

    def stress(self, u: Any, parameters: Any) -> Any:
        return self.fails(super().stress(u, parameters))


@case
def stress_of_a_field_raises(comm: MPI.Comm) -> None:
    material = LateStress(210.0, 0.3, fails=fails_on_last(comm, same))
    assert solve(comm, scene(material=material)).von_mises
