"""Feet of perpendiculars on a parametrised surface, and the derivatives of the distance there.

With the foot X(u) of a point x, tangents J = ∂X/∂u, normal n, first and second fundamental forms G = JᵀJ and
B = −n·∂²X/∂u², the distance is d = n·(x − X), its gradient n and its Hessian J G⁻¹ B (G + d B)⁻¹ Jᵀ.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fenics_contact.errors import InvalidInputError

#: Tangents are degenerate if their area, relative to the product of their lengths, is below this.
FLAT = 1e-10
#: Fraction of det G below which the determinant of G + d B indicates a centre of curvature.
FOCAL = 1e-12


@dataclass(frozen=True, eq=False)
class Feet:
    """Feet of perpendiculars on a surface, and its derivatives there.

    Attributes:
        points: The projected points, (n, dim).
        position: Feet, (n, dim).
        tangents: First derivatives of the parametrisation there, (n, dim, dim − 1).
        bends: Second derivatives, (n, dim, dim − 1, dim − 1).
        free: Which parameters are not held at the border, (n, dim − 1); the continuation beyond is straight.
        sign: 1, or −1 where the normal that the parametrisation gives points into the body; or one per point.
    """

    points: np.ndarray
    position: np.ndarray
    tangents: np.ndarray
    bends: np.ndarray
    free: np.ndarray
    sign: float | np.ndarray = 1.0

    @cached_property
    def normals(self) -> np.ndarray:
        """Unit normals out of the body, (n, dim)."""
        first = self.tangents[:, :, 0]
        if self.tangents.shape[2] == 1:
            across = np.stack([first[:, 1], -first[:, 0]], axis=1)
        else:
            across = np.cross(first, self.tangents[:, :, 1])
        length = np.linalg.norm(across, axis=1)
        sizes = np.linalg.norm(self.tangents, axis=1)
        if not (
            length > FLAT * sizes.max(axis=1, initial=0.0) ** sizes.shape[1]
        ).all():  # also catches NaN
            worst = self.position[int(np.argmin(length))]
            raise InvalidInputError(
                "a parametrised surface needs derivatives that are not zero and not parallel, got such at "
                f"{np.round(worst, 6).tolist()}: leave out poles and corners, or describe them otherwise"
            )
        return np.asarray((self.sign / length)[:, None] * across)

    @property
    def distance(self) -> np.ndarray:
        """Signed distance from the surface, beyond its border from its tangents, (n,)."""
        return np.einsum("nd,nd->n", self.normals, self.points - self.position)

    @property
    def curvatures(self) -> np.ndarray:
        """Second derivatives of the distance, (n, dim, dim)."""
        form = -np.einsum("nd,ndab->nab", self.normals, self.bends)
        gram = self.gram
        moved = masked(gram + self.distance[:, None, None] * form, self.free)
        focal = np.abs(np.linalg.det(moved)) <= FOCAL * np.abs(np.linalg.det(gram))
        moved[focal] = np.sqrt(FOCAL) * gram[focal]
        turned = np.swapaxes(np.linalg.solve(gram, form), 1, 2) @ np.swapaxes(self.tangents, 1, 2)
        steps = np.linalg.solve(moved, np.swapaxes(self.tangents * self.free[:, None, :], 1, 2))
        hessian = np.swapaxes(turned, 1, 2) @ steps
        return np.asarray(0.5 * (hessian + np.swapaxes(hessian, 1, 2)))

    @property
    def gram(self) -> np.ndarray:
        """First fundamental form G, (n, dim − 1, dim − 1)."""
        return np.asarray(np.swapaxes(self.tangents, 1, 2) @ self.tangents)

    def steps(self) -> np.ndarray:
        """Return Newton steps of the parameters to the closest points, Gauss-Newton's where these fail."""
        off = self.points - self.position
        slope = np.einsum("nda,nd->na", self.tangents, off) * self.free
        gram = self.gram
        full = gram - np.einsum("nd,ndab->nab", off, self.bends)
        full, gram = masked(full, self.free), masked(gram, self.free)
        downhill = np.linalg.eigvalsh(full)[:, 0] > 0.1 * np.linalg.eigvalsh(gram)[:, 0]
        chosen = np.where(downhill[:, None, None], full, gram)
        return np.asarray(np.linalg.solve(chosen, slope[:, :, None])[:, :, 0])


def masked(matrices: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Return matrices whose rows and columns of held parameters are the identity's."""
    both = free[:, :, None] & free[:, None, :]
    return np.where(both, matrices, np.eye(free.shape[1]))
