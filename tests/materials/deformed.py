"""Skew patches of every cell type and the mechanics of nonlinear materials on them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse.linalg as spl
from mpi4py import MPI

from fenics_contact import Body, BodyMesh, Scene
from fenics_contact._fem.composition import composition
from fenics_contact._fem.forms import FormLibrary
from fenics_contact._fem.mechanics import Mechanics, Response
from fenics_contact.feti.subdomain import SubdomainMesh, assemble, cut_out
from fenics_contact.mesh import quadratic
from tests.materials.bodies import bent, box


@dataclass(frozen=True)
class Patch:
    """A body as one mesh, its numbering, and its mechanics."""

    body: Body
    mesh: SubdomainMesh
    points: np.ndarray
    forms: FormLibrary
    mechanics: Mechanics

    def at(self, displacement: np.ndarray) -> Response:
        return self.mechanics.at(np.asarray(displacement).ravel())

    def linear_stiffness(self) -> np.ndarray:
        """The stiffness of small strains, dense."""
        return np.asarray(assemble(self.mesh, self.body, (), self.forms).stiffness.toarray())

    def deformed(self, F: np.ndarray) -> np.ndarray:
        """Displacement of a homogeneous deformation, by block, (n, dim)."""
        return np.asarray(self.points @ (F - np.eye(len(F))).T)


def patch_of(body: Body, forms: FormLibrary | None = None) -> Patch:
    """The mechanics of a whole body."""
    forms = FormLibrary(MPI.COMM_SELF) if forms is None else forms
    scene = Scene({"body": body})
    forms.prepare(scene)
    forms.prepare_mechanics(scene)
    mesh = cut_out(0, "body", body, np.arange(body.mesh.n_cells), {})
    points = body.mesh.points[mesh.nodes]
    parts = composition(body, mesh.cells)
    by_input_node = points[np.argsort(mesh.nodes)]
    mechanics = forms.mechanics(parts, body.element, mesh.space, by_input_node)
    return Patch(body, mesh, points, forms, mechanics)


def skew_patch(cell: str) -> BodyMesh:
    """A few distorted cells; quadratic ones have straight edges."""
    linear = cell.rstrip("0123456789")
    dim = 2 if linear in ("triangle", "quadrilateral") else 3
    mesh = bent(box(linear, (2, 1, 1)), 0.2 if dim == 3 else 0.15)
    return mesh if linear == cell else quadratic(mesh)


def smooth_field(points: np.ndarray, size: float = 0.1) -> np.ndarray:
    """A displacement with strains and rotations of about ``size``, by block."""
    dim = points.shape[1]
    waves = np.sin(
        points @ np.array([[1.3, -0.4, 0.8], [0.5, 1.1, -0.7], [-0.9, 0.6, 1.2]])[:dim, :dim] + 0.3
    )
    return np.asarray(size * waves)


def rotation(dim: int, angle: float = np.pi / 2) -> np.ndarray:
    """A rotation in the xy plane, in space followed by one about x."""
    c, s = np.cos(angle), np.sin(angle)
    Q = np.eye(3)
    Q[:2, :2] = [[c, -s], [s, c]]
    about_x = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    return Q[:2, :2] if dim == 2 else about_x @ Q


def derivative_errors(patch: Patch, u: np.ndarray, step: float = 1e-5) -> tuple[float, float]:
    """Errors of f against ∂W/∂u and of K against ∂f/∂u along one direction, by central differences."""
    direction = np.cos(np.arange(u.size) ** 1.5)
    here = patch.at(u)
    ahead, behind = (patch.at(u.ravel() + sign * step * direction) for sign in (1, -1))
    force = (ahead.energy - behind.energy) / (2 * step)
    stiffness = (ahead.force - behind.force) / (2 * step)
    exact = here.stiffness @ direction
    return (
        abs(force - here.force @ direction) / (np.abs(here.force) @ np.abs(direction)),
        float(np.abs(stiffness - exact).max() / np.abs(exact).max()),
    )


def equilibrium(patch: Patch, u: np.ndarray, free: np.ndarray, load: np.ndarray) -> np.ndarray:
    """Displacement by Newton's method from ``u``, kept where it is not free; no step collapses a cell."""
    u, scale = u.copy(), 1e-7 * (np.abs(load).max() + np.abs(patch.at(u).force).max())
    for _ in range(25):
        found = patch.at(u)
        residual = (load - found.force)[free]
        if np.abs(residual).max() < scale:
            return u
        du = np.zeros(u.size)
        du[free] = spl.spsolve(found.stiffness[free][:, free].tocsc(), residual)
        while patch.mechanics.jacobians(u + du).min() < 0.4 * found.least_jacobian:
            du /= 2
        u += du
    raise AssertionError("Newton's method did not converge")
