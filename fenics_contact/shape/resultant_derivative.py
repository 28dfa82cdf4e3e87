"""Derivative of the work of a force and a moment that are spread over a surface whose nodes move."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.fem import LinearTraction, spread_traction
from fenics_contact.feti import TornSystem, nodal_mean_at
from fenics_contact.scene import TotalForce
from fenics_contact.shape.surface_derivative import integral_pulled_back
from fenics_contact.surfaces import GaussPoint, gauss_points, surface_moments


@dataclass(frozen=True, eq=False)
class _Spread:
    """A traction a + b × (x − c) and how its work along w depends on the moments of the surface.

    The work is L = a·W₀ + b·W₁, W₀ = ∫ w, W₁ = ∫ r × w, r = x − c. At fixed w it changes with the surface,
    and through a = F / A, the centroid c and J b = M + (p − c) × F, J = tr(S) I − S, S = ∫ r rᵀ. With
    y = J⁻¹ W₁

        δL = ∫δ (t·w + α + β·r + rᵀ Γ r),   α = −a·W₀ / A,   β = −(W₀ × b + F × y) / A,
        Γ = (y bᵀ + b yᵀ) / 2 − (y·b) I,

    with F × y only where the force acts at a given point. All vectors have three components; those of plane
    bodies lie in the plane, and turning vectors normal to it.

    Attributes:
        even: a, shape (3,).
        turning: b, shape (3,).
        centre: c, shape (3,).
        constant: α.
        linear: β, shape (3,).
        square: Γ, shape (3, 3).
    """

    even: np.ndarray
    turning: np.ndarray
    centre: np.ndarray
    constant: float
    linear: np.ndarray
    square: np.ndarray

    def density(self, places: np.ndarray, field: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the integrand at places with the field there, and its derivative by the places."""
        dim = places.shape[1]
        arm, w = _in_space(places) - self.centre, _in_space(field)
        bent = arm @ self.square
        work = np.einsum("nd,nd->n", self.even + np.cross(self.turning, arm), w)
        values = work + self.constant + arm @ self.linear + np.einsum("nd,nd->n", bent, arm)
        return values, (np.cross(w, self.turning) + self.linear + 2.0 * bent)[:, :dim]


def resultant_by_shape(torn: TornSystem, load: TotalForce, w: np.ndarray) -> np.ndarray:
    """Return ∂/∂X of the work of a resultant along w, on the first rank, zero elsewhere. Collective."""
    mesh, tearing = torn.scene.bodies[load.body].mesh, torn.decomposition.tearing
    result = np.zeros((tearing.n_nodes, torn.dim))
    nodes, facets = np.unique(mesh.surfaces[load.surface], return_inverse=True)
    facets = facets.reshape(mesh.surfaces[load.surface].shape)
    numbers = tearing.global_nodes(load.body, nodes)
    field, points = nodal_mean_at(torn.decomposition, w, numbers), mesh.points[nodes]
    if torn.decomposition.comm.rank == 0:
        spread = _spread(torn, load, points, facets, field)

        def density(at: GaussPoint) -> tuple[np.ndarray, np.ndarray]:
            return spread.density(at.of(points, facets), at.of(field, facets))

        result[numbers] = integral_pulled_back(points, facets, density)
    return result


def _spread(
    torn: TornSystem, load: TotalForce, points: np.ndarray, facets: np.ndarray, field: np.ndarray
) -> _Spread:
    """Return the traction of a load and the coefficients of the moments, see the class."""
    moments = surface_moments(points, facets)
    centre, force = (_in_space(vector[None])[0] for vector in (moments.centroid, np.array(load.value)))
    total, turned = np.zeros(3), np.zeros(3)  # W₀ and W₁
    for at in gauss_points(points, facets):
        arm, w = _in_space(at.of(points, facets)) - centre, _in_space(at.of(field, facets))
        total += at.areas @ w
        turned += at.areas @ np.cross(arm, w)
    even, turning, lever = force / moments.area, np.zeros(3), np.zeros(3)
    traction = spread_traction(torn.scene, load).value
    if isinstance(traction, LinearTraction):
        turning[-len(traction.turning) :] = traction.turning
        lever = _turn(moments.second_moment, turned)
    moved = np.cross(total, turning) + (0.0 if load.at is None else np.cross(force, lever))
    both = np.outer(lever, turning)
    square = (both + both.T) / 2.0 - (lever @ turning) * np.eye(3)
    return _Spread(even, turning, centre, -float(even @ total) / moments.area, -moved / moments.area, square)


def _turn(second: np.ndarray, moment: np.ndarray) -> np.ndarray:
    """Return J⁻¹ M for the second moment S of a surface, of a curve in the plane about its normal."""
    if len(second) == 2:
        return moment / np.trace(second)
    return np.asarray(np.linalg.solve(np.trace(second) * np.eye(3) - second, moment))


def _in_space(vectors: np.ndarray) -> np.ndarray:
    """Return vectors with three components, shape (n, 3), the third of plane ones zero."""
    return np.pad(vectors, ((0, 0), (0, 3 - vectors.shape[1])))
