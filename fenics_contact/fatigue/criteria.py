"""Parameters of critical planes: what a cycle of stresses and strains does on planes, and derivatives."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from fenics_contact._base.checks import checked
from fenics_contact._scene.checks import check_not_negative, check_positive
from fenics_contact.fatigue.circles import smallest_circles
from fenics_contact.results.fields import COMPONENTS

#: P and its derivatives by the amplitude and by the largest normal stress.
Combined = tuple[np.ndarray, np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Criterion(ABC):
    """P = φ(a, s) on a plane: a, the amplitude of a path, s = max σ_n, the largest normal stress of a cycle.

    An amplitude is the radius of the smallest circle around the path, half the range of what moves on a line
    (A. Bernasconi, I. V. Papadopoulos, Comput. Mater. Sci. 34 (2005) 355-368). Half the longest chord, which
    is used as well, is up to 13.4 % smaller where a cycle is not proportional.
    """

    #: Whether the path is that of strains, which components normal and tangential to planes it has, a factor.
    of_strain: ClassVar[bool] = True
    components: ClassVar[slice] = slice(1, 3)
    factor: ClassVar[float] = 1.0

    def path(self, rows: np.ndarray) -> np.ndarray:
        """Return the rows, (..., d, 6), that make the path of tensors, of those of `plane_rows`."""
        return self.factor * rows[..., self.components, :]

    @abstractmethod
    def combined(self, amplitude: np.ndarray, normal: np.ndarray) -> Combined:
        """Return P, which does not fall with the amplitude, and its derivatives."""


@dataclass(frozen=True)
@checked()
class Findley(Criterion):
    """P = τ_a + k max σ_n of the shear stress, [force / length²], for many cycles (Findley 1959).

    Attributes:
        k: Weight of the normal stress, at least 0, by tests of two kinds.
    """

    of_strain = False

    k: float

    def __post_init__(self) -> None:
        """Check k."""
        check_not_negative("Findley.k", self.k, "give the weight of the normal stress, such as 0.3")

    def combined(self, amplitude: np.ndarray, normal: np.ndarray) -> Combined:
        """Return τ_a + k max σ_n."""
        ones = np.ones_like(amplitude)
        return amplitude + self.k * normal, ones, self.k * ones


@dataclass(frozen=True)
class SmithWatsonTopper(Criterion):
    """P = max σ_n Δε_n / 2, [force / length²], where tension opens cracks (Smith, Watson, Topper 1970).

    The plane is that of the largest product. P is zero in compression.
    """

    components = slice(0, 1)

    def combined(self, amplitude: np.ndarray, normal: np.ndarray) -> Combined:
        """Return max(σ, 0) Δε / 2."""
        tension = np.maximum(normal, 0.0)
        return tension * amplitude, tension, np.where(normal > 0.0, amplitude, 0.0)


@dataclass(frozen=True)
@checked()
class FatemiSocie(Criterion):
    """P = Δγ/2 (1 + k max σ_n / σ_y), no unit, where shear makes cracks (Fatemi, Socie 1988).

    γ = 2 ε_nt. The plane is that of the largest P, not of the largest Δγ. P is not negative.

    Attributes:
        k: Weight of the normal stress, at least 0.
        yield_stress: σ_y > 0, [force / length²].
    """

    factor = 2.0

    k: float
    yield_stress: float

    def __post_init__(self) -> None:
        """Check the constants."""
        check_not_negative("FatemiSocie.k", self.k, "give the weight of the normal stress, such as 0.5")
        check_positive("FatemiSocie.yield_stress", self.yield_stress, "give σ_y in force per area")

    def combined(self, amplitude: np.ndarray, normal: np.ndarray) -> Combined:
        """Return Δγ/2 (1 + k σ / σ_y)."""
        slope = self.k / self.yield_stress
        share = np.maximum(1.0 + slope * normal, 0.0)
        return amplitude * share, share, np.where(share > 0.0, slope * amplitude, 0.0)


def tangents(normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return two unit vectors normal to each of these, shape (..., 3), and to each other."""
    first = np.cross(normals, np.eye(3)[np.abs(normals).argmin(axis=-1)])
    first /= np.linalg.norm(first, axis=-1, keepdims=True)
    return first, np.cross(normals, first)


def plane_rows(normals: np.ndarray) -> np.ndarray:
    """Return the rows that make a normal and two tangential components of the `COMPONENTS` of tensors.

    `normals`: unit vectors, shape (..., 3). The result has shape (..., 3, 6).
    """
    full = np.stack([normals, *tangents(normals)], axis=-2)[..., :, None] * normals[..., None, None, :]
    full = full + full.swapaxes(-1, -2)
    return np.stack([full[..., i, j] * (0.5 if i == j else 1.0) for i, j in COMPONENTS], axis=-1)


@dataclass(frozen=True, eq=False)
class OnPlanes:
    """What a cycle of stresses and strains does on planes at points: arrays of shape (n_points, n_planes).

    `cycle`: shape (2, n_states, n_points, 6); `rows`: of `plane_rows`, shape (n_points or 1, n_planes, 3, 6).
    """

    criterion: Criterion
    cycle: np.ndarray
    rows: np.ndarray

    @cached_property
    def normals(self) -> np.ndarray:
        """Normal stresses of all states."""
        return _components(self.cycle[0], self.rows[..., :1, :])[..., 0]

    @cached_property
    def circles(self) -> tuple[np.ndarray, np.ndarray]:
        """Amplitudes, and their derivatives by the points of the paths, (n_states, n_points, n_planes, d)."""
        paths = _components(self.cycle[int(self.criterion.of_strain)], self.criterion.path(self.rows))
        radius, slope = smallest_circles(paths.reshape(len(paths), -1, paths.shape[-1]))
        return radius.reshape(paths.shape[1:3]), slope.reshape(paths.shape)

    @property
    def combined(self) -> Combined:
        """P and its derivatives by amplitudes and largest normal stresses."""
        return self.criterion.combined(self.circles[0], self.normals.max(axis=0))

    def pulled_back(self, weights: np.ndarray) -> np.ndarray:
        """Return the derivatives of Σ weights P by the cycle, of its shape.

        Where several states have the largest normal stress that by the first of them.
        """
        (_, by_amplitude, by_normal), path = self.combined, self.criterion.path(self.rows)
        largest = np.arange(len(self.normals))[:, None, None] == self.normals.argmax(axis=0)
        chosen, by_path = (
            largest * (weights * by_normal),
            (weights * by_amplitude)[..., None] * self.circles[1],
        )
        found, strain = np.zeros_like(self.cycle), int(self.criterion.of_strain)
        shape = by_path.shape[1:]
        found[0] = np.einsum("nkm,kmc->nkc", chosen, np.broadcast_to(self.rows[..., 0, :], (*shape[:2], 6)))
        found[strain] += np.einsum("nkmd,kmdc->nkc", by_path, np.broadcast_to(path, (*shape, 6)))
        return found


def _components(tensor: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Return components, (n_states, n_points, n_planes, d), of tensors on planes."""
    found = np.matmul(rows.reshape(len(rows), -1, 6), tensor[..., None])[..., 0]
    return found.reshape(*tensor.shape[:2], *rows.shape[1:3])
