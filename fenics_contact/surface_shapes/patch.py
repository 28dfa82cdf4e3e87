"""Surfaces that are images of a rectangle of parameters, in the plane of an interval."""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from fenics_contact.surface_shapes.closest import ROUNDING
from fenics_contact.surface_shapes.foot import Feet

#: Largest number of steps to a closest point, and size of the last one relative to the range of the
#: parameters.
STEPS, LAST = 60, 1e-10
#: A closest point is held at the border if its parameter would leave the range by more than this fraction.
HELD = 1e-8


class Patch(ABC):
    """Distances, normals and curvatures of a parametrised surface, by Newton's method from close samples."""

    flipped: bool

    @abstractmethod
    def _position(self, u: np.ndarray) -> np.ndarray:
        """Return X, (n, k) -> (n, k + 1)."""

    @abstractmethod
    def _tangents(self, u: np.ndarray) -> np.ndarray:
        """Return ∂X/∂u, (n, k) -> (n, k + 1, k)."""

    @abstractmethod
    def _bends(self, u: np.ndarray) -> np.ndarray:
        """Return ∂²X/∂u², (n, k) -> (n, k + 1, k, k)."""

    @property
    @abstractmethod
    def _range(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Least and largest parameters and which of them are periodic, (k,) each."""

    @property
    def _borders(self) -> tuple[np.ndarray, np.ndarray]:
        """Parameters beyond which there is no surface, (k,) each."""
        return self._range[:2]

    @abstractmethod
    def _starts(self) -> np.ndarray:
        """Return the parameters of samples that are dense enough to locate closest points, (m, k)."""

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Return the distance to the closest point, beyond the border to the tangents there."""
        return self._feet(points).distance

    def normals(self, points: np.ndarray) -> np.ndarray:
        """Return the normals at the closest points."""
        return self._feet(points).normals

    def curvatures(self, points: np.ndarray) -> np.ndarray:
        """Return the second derivatives of the distance."""
        return self._feet(points).curvatures

    def at(self, u: np.ndarray) -> np.ndarray:
        """Return the surface's points at parameters, (n, dim − 1) -> (n, dim), [length]."""
        return self._position(np.asarray(u, dtype=np.float64))

    @cached_property
    def _samples(self) -> tuple[np.ndarray, cKDTree]:
        starts = self._starts()
        return starts, cKDTree(self._position(starts))

    def _feet(self, points: np.ndarray) -> Feet:
        """Return the closest points and the surface's derivatives there."""
        points = np.asarray(points, dtype=np.float64)
        starts, tree = self._samples
        low, high, periodic = self._range
        u: np.ndarray = starts[tree.query(points)[1]]
        part: np.ndarray = np.ones((len(points), 1))
        rounding = ROUNDING * np.linalg.norm(points, axis=1, keepdims=True)
        for _ in range(STEPS if len(points) else 0):
            feet = self._at(points, u)
            trial = u + part * feet.steps()
            trial = np.where(periodic, trial, np.clip(trial, low, high))
            away = np.linalg.norm(points - feet.position, axis=1, keepdims=True)
            tried = np.linalg.norm(points - self._position(trial), axis=1, keepdims=True)
            closer = tried <= (1 + ROUNDING) * away + rounding
            moved = np.abs(trial - u)
            u, part = np.where(closer, trial, u), np.where(closer, np.minimum(1.0, 2 * part), 0.5 * part)
            if not (moved > LAST * (high - low)).any():
                break
        return self._at(points, u)

    def _at(self, points: np.ndarray, u: np.ndarray) -> Feet:
        position, tangents = self._position(u), self._tangents(u)
        (low, high), (_, _, periodic) = self._borders, self._range
        pull = np.einsum("nda,nd->na", tangents, points - position)
        # Points exactly above the border are held only by rounding.
        strong = np.abs(pull) > HELD * np.einsum("nda,nda->na", tangents, tangents) * (high - low)
        held = strong & ~periodic & np.where(pull > 0, u >= high, u <= low)
        return Feet(points, position, tangents, self._bends(u), ~held, -1.0 if self.flipped else 1.0)
