"""What the displacement of a body consists of, and how its lengths, areas and volumes are measured."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fenics_contact._kinematics.measure import PLAIN, Measure
from fenics_contact.materials.kernels import rigid_body_modes
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.quality import cell_volumes, jacobians


class Gradients:
    """Displacement gradients at the Gauss points of cells, and what is dual to them."""

    def __init__(self, slopes: np.ndarray) -> None:
        """Keep the gradients of the shape functions."""
        self.slopes = slopes

    def part(self, cells: np.ndarray) -> Gradients:
        """Return those of some cells."""
        return Gradients(self.slopes[cells])

    @property
    def divergence(self) -> np.ndarray:
        """Trace of the gradient for each unit nodal displacement, shape (n_cells, n_gauss, nodes, dim)."""
        return self.slopes

    def of(self, nodal: np.ndarray) -> np.ndarray:
        """Return ∂u_i/∂X_j of nodal u, zero out of the plane, shape (n_cells, n_gauss, 3, 3)."""
        dim = self.slopes.shape[-1]
        gradient = np.zeros((*self.slopes.shape[:2], 3, 3))
        gradient[..., :dim, :dim] = nodal.swapaxes(1, 2)[:, None] @ self.slopes
        return gradient

    def contracted(self, tensors: np.ndarray) -> np.ndarray:
        """Return T : ∇v for each unit nodal v, shape (n_cells, n_gauss, nodes, dim)."""
        dim = self.slopes.shape[-1]
        return np.asarray(self.slopes @ tensors[..., :dim, :dim].swapaxes(2, 3))

    def force(self, weights: np.ndarray, stress: np.ndarray) -> np.ndarray:
        """Return ∫ P : ∇v, shape (n_cells, nodes, dim), [force]; `weights`: of the Gauss points."""
        dim = self.slopes.shape[-1]
        weighted = weights[..., None, None] * stress[..., :dim, :dim]
        return np.asarray((self.slopes @ weighted.swapaxes(2, 3)).sum(axis=1))

    def blocks(self, weights: np.ndarray, tangent: np.ndarray) -> np.ndarray:
        """Return ∫ ∇v : A : ∇u, shape (n_cells, nodes, dim, nodes, dim); `weights`: of the Gauss points."""
        G = self.slopes
        n, m, _, dim = G.shape
        A = weights[..., None, None, None, None] * tangent[..., :dim, :dim, :dim, :dim]
        half = A.reshape(n, m, dim**3, dim) @ G.swapaxes(2, 3)
        half = half.reshape(n, m, dim, dim, -1).swapaxes(2, 3).reshape(n, m * dim, -1)
        left = G.swapaxes(1, 2).reshape(n, -1, m * dim)
        return (left @ half).reshape(n, left.shape[1], dim, dim, left.shape[1]).swapaxes(3, 4)


#: Returns a component of displacements over the radius, by its derivative by the radius and its number.
ByRadius = Callable[[np.ndarray, int], np.ndarray]
#: Weights and places of Gauss points.
GaussPoints = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Kinematics:
    """The kinematics of solid bodies, and of plane bodies.

    Others are subclasses, and all that depends on the kinematics of a body is a method or an attribute here.
    """

    dim: int

    #: How lengths, areas and volumes in coordinates are those of the body.
    measure: ClassVar[Measure] = PLAIN
    #: What the names of forms have in addition to the type of cells.
    name = ""
    #: What a body is, behind its cells and materials.
    in_words = ""
    #: What files say of it.
    record: ClassVar[dict[str, bool]] = {}
    #: Components of the displacement that vanish on an axis, with their names.
    held_on_axis: ClassVar[dict[int, str]] = {}
    #: Least degree of the quadrature of stiffness on linear cells.
    least_degree = 1
    #: Whether all places are equal: stiffness does not depend on where a body lies.
    is_homogeneous = True
    #: Whether bodies can rotate without strain.
    can_rotate = True

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the coordinates."""
        return ("x", "y", "z")[: self.dim]

    @property
    def material_dim(self) -> int:
        """Dimension of the space of its materials."""
        return self.dim

    @property
    def needed_material(self) -> str:
        """What to say of a material of another space, by its ``name`` and ``dims``."""
        return (
            "the material must be made for the dimension of the mesh, {name} is for {dims} and the "
            f"mesh has {self.dim}: use PlaneStrain or PlaneStress in the plane, IsotropicElasticity or "
            "OrthotropicElasticity in space"
        )

    @property
    def zero_stress(self) -> tuple[str, ...]:
        """Components of an initial stress that a body does not have."""
        return ("yz", "xz", "zz") if self.dim == 2 else ()

    @property
    def vector_in_words(self) -> str:
        """What the value of a load must hold."""
        plane = "two entries, for x and y, as the body is plane"
        return plane if self.dim == 2 else "three, for x, y and z"

    @property
    def resultant_components(self) -> int:
        """Number of components of a resultant force."""
        return self.components

    @property
    def resultant_in_words(self) -> str:
        """What the value of a resultant force must hold."""
        return self.vector_in_words

    @property
    def axis_in_words(self) -> str:
        """What the axis of a centrifugal force needs."""
        return f"{self.dim} coordinates"

    def has_axis(self, point: Sequence[float], axis: Sequence[float] | None) -> bool:
        """Return whether a body can spin about an axis."""
        return len(point) == self.dim

    def has_moment(self, moment: Any, at: Any) -> bool:
        """Return whether the forces of a body can have a moment, or act at a point."""
        return True

    def is_mirrored(self, normal: np.ndarray, tilt: float) -> bool:
        """Return whether a flat side with a unit normal can be a plane of symmetry."""
        return True

    @property
    def balanced(self) -> np.ndarray:
        """Ones, zero for components of forces that balance each other, (components,)."""
        return np.ones(self.components)

    @property
    def components(self) -> int:
        """Number of components of displacements."""
        return self.dim

    @property
    def motions(self) -> int:
        """Number of rigid motions."""
        return 3 * (self.dim - 1)

    def integrand(self, density: Any, x: Any) -> Any:
        """Return what is integrated over cells or facets for a density (UFL) at x."""
        return density

    def in_space(self, x: Any, fields: tuple[Any, ...]) -> tuple[Any, ...]:
        """Return displacements (UFL) as materials get them."""
        return fields

    def on_cells(self, density: Any, x: Any) -> Any:
        """Return what a material made of `in_space` (UFL), written in displacements on the cells."""
        return density

    def of_gradient(self, energy: Callable[[Any], Any], gradient: Any, x: Any, constant: Any) -> Any:
        """Return an energy density, a function of displacements (UFL), of a gradient that is given at x.

        A material is defined for displacements only. Its energy is written for c·x − d with constants c and
        d, whose gradient is c; then c is replaced by the gradient g, and d by g·x, so that the displacement
        is zero: materials may resist displacements, too. `constant`: returns a constant (UFL) of a shape.
        """
        import ufl
        from ufl.algorithms import expand_derivatives

        c, d = (constant(shape) for shape in ((self.dim, self.dim), (self.dim,)))
        density = expand_derivatives(energy(ufl.dot(c, x) - d))
        return ufl.replace(density, {c: gradient, d: ufl.dot(gradient, x)})

    def in_section(self, vector: Any) -> Any:
        """Return the components of a vector (UFL) along the coordinates."""
        return vector

    def gradients(self, slopes: np.ndarray, values: np.ndarray, first: np.ndarray) -> Gradients:
        """Return displacement gradients at Gauss points.

        `slopes` and `values`: gradients and values of the shape functions; `first`: first coordinates of the
        points.
        """
        return Gradients(slopes)

    def unit_cell(self, nodes: np.ndarray) -> np.ndarray:
        """Return where the nodes of a reference cell are for a test of a material, (n, dim)."""
        return nodes

    def typical_size(self, points: np.ndarray) -> np.ndarray | float:
        """Return the ratio of the stiffness of cells to that of `unit_cell`, by places of nodes."""
        return 1.0

    def volumes(self, points: np.ndarray, cells: np.ndarray, positions: np.ndarray) -> np.ndarray:
        """Return volumes per volume of the reference cell, (n_cells, m), of affine cells (n_cells, 1)."""
        return jacobians(points, cells, positions)

    def volume(self, mesh: BodyMesh, cells: np.ndarray) -> float:
        """Return the volume of some cells of a mesh, of plane ones the area, [length^dim]."""
        return float(cell_volumes(mesh.points, cells).sum())

    def on_axis(self, points: np.ndarray) -> np.ndarray:
        """Return which points lie on an axis of revolution, (n,)."""
        return np.zeros(len(points), dtype=bool)

    def nearly_rigid(self, points: np.ndarray) -> np.ndarray:
        """Return motions that a small part of a body hardly resists, (n, components, n_modes): none."""
        return np.zeros((len(points), self.components, 0))

    def rigid_modes(self, points: np.ndarray, at: np.ndarray | None = None) -> np.ndarray:
        """Return the rigid motions of a body at its nodes or elsewhere, see `rigid_body_modes`."""
        return rigid_body_modes(points, at)

    def resultant(
        self, forces: np.ndarray, places: np.ndarray, about: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray | float]:
        """Return force and moment about a point of forces at places, (n, components) and (n, dim)."""
        moment = moment_of(forces, places - about)
        return forces.sum(axis=0), float(moment.sum()) if self.dim == 2 else moment.sum(axis=0)

    def moment_at(
        self, force: np.ndarray, moment: np.ndarray, point: np.ndarray, about: np.ndarray
    ) -> np.ndarray | float:
        """Return the moment about a point of a force and a moment, (3,) or (1,), that act at another."""
        own = float(moment[0]) if self.dim == 2 else moment
        return own + moment_of(force, point - about)

    def arms(self, places: np.ndarray, about: np.ndarray) -> np.ndarray:
        """Return lever arms by which the moments of forces are measured, (n, k)."""
        return places - about

    def whole_force(self, force: float, point: np.ndarray, planes: int) -> tuple[float, float | None]:
        """Return the force of a contact beyond planes of symmetry, and its radius around an axis.

        `planes`: number of planes of symmetry through it.
        """
        return force * 2.0**planes, None  # each plane halves the force

    def from_origin(self, points: np.ndarray) -> np.ndarray:
        """Return places relative to a point about which linear displacements are taken, (n, dim)."""
        return np.asarray(points - points.mean(axis=0))

    def further_fields(self, places: np.ndarray) -> list[np.ndarray]:
        """Return displacements at nodes with strains beyond those of a gradient, (n, components) each.

        They make up any strain at a point, with the sizes `further_strains`.
        """
        return []

    def further_strains(self, gradients: np.ndarray, by_radius: ByRadius) -> list[np.ndarray]:
        """Return the sizes of these strains at points with displacement gradients, (n, ., dim), (n,) each."""
        return []

    def of_unit_strains(
        self, rest: np.ndarray, further: list[np.ndarray], gauss_points: Callable[[], GaussPoints]
    ) -> list[np.ndarray]:
        """Return stresses of these strains of size one, means over cells, (n_cells, 6) each.

        `rest`: without displacement; `further`: of `further_fields`; `gauss_points`: weights in coordinates,
        and places.
        """
        return further

    def kernel(self, of_material: Any, points: np.ndarray) -> np.ndarray:
        """Return the modes without energy of a material, (n, components, n_modes).

        `of_material`: its modes in its own space, a function of points.
        """
        return np.asarray(of_material(points))


def moment_of(force: np.ndarray, arm: np.ndarray) -> np.ndarray:
    """Return arm × force, shape (..., 3), in the plane the number x·Fy − y·Fx, shape (...,)."""
    if force.shape[-1] == 2:
        return np.asarray(arm[..., 0] * force[..., 1] - arm[..., 1] * force[..., 0])
    return np.cross(arm, force)
