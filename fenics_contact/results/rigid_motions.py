"""Rigid motions in words: those that nothing resists, and those of rigid surfaces."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.display import displayed
from fenics_contact._scene.pairs import Surface
from fenics_contact._scene.plan import MOTION_ROUNDING
from fenics_contact._scene.scene import Scene
from fenics_contact._scene.supports import RigidSurface
from fenics_contact.feti.dual import DualSystem
from fenics_contact.feti.torn import TornSystem
from fenics_contact.qp.resting import LooseMotions
from fenics_contact.qp.solution import DualSolution


@displayed
@dataclass(frozen=True, eq=False)
class UnheldMotion:
    """A rigid motion, such as one that no support, tie or contact resists and no load drives.

    Attributes:
        bodies: Body name -> coefficients of its `Body.rigid_modes`, translations first, shape (3,) in the
            plane, (6,) in space, (1,) for bodies of revolution, (2,) with torsion; the largest of all is one.
            Bodies that stay are left out.
    """

    bodies: Mapping[str, np.ndarray]

    def _facts(self) -> dict[str, str]:
        return {name: motion_in_words(motion) for name, motion in self.bodies.items()}

    def __str__(self) -> str:
        """Return it in words."""
        return "; ".join(f"{name!r}: {motion_in_words(motion)}" for name, motion in self.bodies.items())


def unheld_motions(system: DualSystem) -> tuple[UnheldMotion, ...]:
    """Return the motions that a dual system leaves out. Collective."""
    return rigid_motions(system.torn, system.unheld) if system.unheld.shape[1] else ()


def idle_motions(system: DualSystem, solution: DualSolution) -> tuple[UnheldMotion, ...]:
    """Return the motions by which contact opens that touches without a force. Collective."""
    ways = LooseMotions.of(solution.problem, solution.multiplier, solution.residual).opening()
    if ways.shape[1] == 0:
        return ()
    return rigid_motions(system.torn, system.kernel.combined(sp.csr_matrix(ways)).tocsr())


def rigid_motions(torn: TornSystem, fields: sp.spmatrix) -> tuple[UnheldMotion, ...]:
    """Return rigid displacements of bodies, one a column of torn `fields`, as motions. Collective."""
    count, coefficients, fields = fields.shape[1], [], sp.csr_matrix(fields)
    starts = np.cumsum([0] + [part.mesh.size for part in torn.subdomains])
    for name, body in torn.scene.bodies.items():
        modes = body.rigid_modes()
        size = modes.shape[2]
        sums = np.zeros((size, size + count))
        for part, start in zip(torn.subdomains, starts, strict=False):
            if part.mesh.body == name:
                own = modes[part.mesh.nodes].reshape(part.mesh.size, size)
                moved = fields[start : start + part.mesh.size].toarray()
                sums += own.T @ np.hstack([own, moved])
        sums = torn.numbering.comm.allreduce(sums)
        coefficients.append(np.linalg.solve(sums[:, :size], sums[:, size:]))
    motions = np.stack(coefficients)  # (n_bodies, n_modes, count)
    motions /= np.abs(motions).max(axis=(0, 1))
    motions[np.abs(motions) <= MOTION_ROUNDING] = 0.0
    return tuple(
        UnheldMotion({name: own for name, own in zip(torn.scene.bodies, motion, strict=True) if own.any()})
        for motion in np.moveaxis(motions, 2, 0)
    )


def motion_in_words(motion: np.ndarray) -> str:
    """Return coefficients of rigid modes, shape (3,), (6,), (1,) or (2,), as translation and rotation."""
    if len(motion) < 3:
        parts = ("translation", "along"), ("rotation", "about")
        moved = zip(motion, parts, strict=False)
        return " with ".join(f"{kind} {size:.2g} {way} the axis" for size, (kind, way) in moved if size)
    dim = 2 if len(motion) == 3 else 3
    return " with ".join(
        f"{kind} ({', '.join(f'{component:.2g}' for component in part)})"
        for kind, part in (("translation", motion[:dim]), ("rotation", motion[dim:]))
        if np.any(part)
    )


@displayed
@dataclass(frozen=True, eq=False)
class RigidMotion:
    """The motion of a rigid surface: u = U + θ × (x − p), of bodies that deform much U + (R(θ) − I)(x − p).

    Attributes:
        surface: The surface.
        about: The point p of its `RigidSurface`, shape (dim,), [length].
        displacement: U, shape (dim,), [length].
        rotation: θ, shape (3,) in space; one number in the plane, positive from x to y; in radians.
    """

    surface: Surface
    about: np.ndarray
    displacement: np.ndarray
    rotation: np.ndarray | float

    def __str__(self) -> str:
        """Return it in words; rounding of other components is zero."""
        moved, turned, about = map(in_words, (self.displacement, self.rotation, self.about))
        return (
            f"{self.surface.body} {self.surface.name}: displacement {moved} [length] of {about}, "
            f"rotation {turned} rad"
        )


def in_words(values: np.ndarray | float) -> str:
    """Return components in brackets, zero where they are the rounding of others."""
    given = np.atleast_1d(values)
    known = np.where(np.abs(given) > MOTION_ROUNDING * np.abs(given).max(initial=0.0), given, 0.0)
    return f"({', '.join(f'{number:.5g}' for number in known)})"


def rigid_motion(
    scene: Scene, support: RigidSurface, displacement: np.ndarray, known: np.ndarray | None = None
) -> RigidMotion:
    """Return the motion of a rigid surface.

    `known`: U, then θ, where they are known.
    """
    body, where = scene.bodies[support.body], Surface(support.body, support.surface)
    motion = known
    if motion is None:
        mesh = body.mesh
        nodes = mesh.nodes_of(support.surface)
        modes, factors = support.unit_modes(mesh.points[nodes])
        modes = modes.reshape(-1, len(factors))
        motion = factors * np.linalg.lstsq(modes, displacement[nodes].ravel(), rcond=MOTION_ROUNDING)[0]
        motion = np.where(support.free, motion, support.prescribed)
    moved, turned = np.split(motion, [scene.dim])
    return RigidMotion(where, np.array(support.at), moved, float(turned[0]) if scene.dim == 2 else turned)
