"""Parameters of critical planes: what a cycle of stresses and strains does on planes, and derivatives."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fenics_contact._base.checks import checked
from fenics_contact.errors import InvalidInputError
from fenics_contact.fatigue.circles import Circles, smallest_circles
from fenics_contact.materials.elastic import require_positive
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


def _require_weight(name: str, value: float) -> None:
    if not (np.isfinite(value) and value >= 0.0):
        raise InvalidInputError(
            f"{name} must be at least 0, got {value!r}: give the weight of the normal stress, such as 0.3"
        )


@dataclass(frozen=True)
@checked()
class Findley(Criterion):
    """P = τ_a + k max σ_n of the shear stress, [force / length²], for many cycles (Findley 1959).

    Attributes:
        k: Weight of the normal stress, at least 0, from two tests, such as tension and torsion.

    Example:
        >>> Findley(k=0.3)
        Findley(k=0.3)
    """

    of_strain = False

    k: float

    def __post_init__(self) -> None:
        """Check k."""
        _require_weight("Findley.k", self.k)

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
        _require_weight("FatemiSocie.k", self.k)
        require_positive("FatemiSocie.yield_stress", self.yield_stress, "give σ_y in force per area")

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
    """What a cycle does on planes at points: arrays of shape (n_points, n_planes)."""

    criterion: Criterion
    rows: np.ndarray
    paths: np.ndarray
    circles: Circles
    normal: np.ndarray
    state: np.ndarray

    @classmethod
    def of(cls, criterion: Criterion, cycle: np.ndarray, rows: np.ndarray) -> OnPlanes:
        """Evaluate a cycle of stresses and strains, shape (2, n_states, n_points, 6).

        `rows`: see `plane_rows`, shape (n_points or 1, n_planes, 3, 6).
        """
        normals = _components(cycle[0], rows[..., :1, :])[..., 0]
        paths = _components(cycle[int(criterion.of_strain)], criterion.path(rows))
        paths = paths.reshape(len(paths), normals[0].size, -1)
        circles, state = smallest_circles(paths), normals.argmax(axis=0)
        return cls(criterion, rows, paths, circles, normals.max(axis=0), state)

    @property
    def amplitude(self) -> np.ndarray:
        """Amplitudes a."""
        return np.sqrt(self.circles.square).reshape(self.normal.shape)

    @property
    def parameter(self) -> np.ndarray:
        """P."""
        return self.criterion.combined(self.amplitude, self.normal)[0]

    def pulled_back(self, weights: np.ndarray) -> np.ndarray:
        """Return the derivatives of Σ weights P by the cycle, shape (2, n_states, n_points, 6).

        Where several states have the largest normal stress that by the first of them.
        """
        shape, path = self.normal.shape, self.criterion.path(self.rows)
        _, by_amplitude, by_normal = self.criterion.combined(self.amplitude, self.normal)
        by_path = self.circles.by_points(self.paths).reshape(len(self.paths), *shape, -1)
        by_path *= (weights * by_amplitude)[..., None]
        chosen = np.where(np.arange(len(by_path))[:, None, None] == self.state, weights * by_normal, 0.0)
        found = np.zeros((2, len(by_path), shape[0], 6))
        found[0] = np.einsum("nkm,kmc->nkc", chosen, np.broadcast_to(self.rows[..., 0, :], (*shape, 6)))
        path = np.broadcast_to(path, (*shape, *path.shape[2:]))
        found[int(self.criterion.of_strain)] += np.einsum("nkmd,kmdc->nkc", by_path, path)
        return found


def _components(tensor: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Return components, (n_states, n_points, n_planes, d), of tensors on planes."""
    found = np.matmul(rows.reshape(len(rows), -1, 6), tensor[..., None])[..., 0]
    return found.reshape(*tensor.shape[:2], *rows.shape[1:3])
