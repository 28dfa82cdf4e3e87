"""What the displacement of a body consists of, and how its lengths, areas and volumes are measured."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from fenics_contact._kinematics.gradients import Gradients
from fenics_contact._kinematics.measure import PLAIN, Measure
from fenics_contact.materials.kernels import rigid_body_modes
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.quality import cell_volumes, jacobians

if TYPE_CHECKING:
    from fenics_contact._kinematics.element import Element


@dataclass(frozen=True)
class Kinematics:
    """The kinematics of solid bodies, and of plane bodies per unit of thickness.

    Others are subclasses, and all that depends on the kinematics of a body is a method or an attribute here.

    Attributes:
        dim: Number of coordinates, 2 or 3.
    """

    dim: int

    #: How lengths, areas and volumes in coordinates are those of the body.
    measure: ClassVar[Measure] = PLAIN
    #: What the names of forms have in addition to the type of cells.
    name = ""
    #: Least degree of the quadrature of stiffness on linear cells.
    least_degree = 1
    #: Whether all places are equal: stiffness does not depend on where a body lies.
    is_homogeneous = True
    #: Whether bodies can rotate without strain.
    can_rotate = True

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

    def of_gradient(self, energy: Callable[[Any], Any], gradient: Any, element: Element) -> Any:
        """Return an energy density, a function of displacements (UFL), of a gradient that is given.

        A material is defined for displacements only. Its energy is written for c·x − d with constants c and
        d, whose gradient is c; then c is replaced by the gradient g, and d by g·x, so that the displacement
        is zero: materials may resist displacements, too.
        """
        import ufl
        from ufl.algorithms import expand_derivatives

        c, d = (element.constant(shape) for shape in ((self.dim, self.dim), (self.dim,)))
        density = expand_derivatives(energy(ufl.dot(c, element.x) - d))
        return ufl.replace(density, {c: gradient, d: ufl.dot(gradient, element.x)})

    def in_section(self, vector: Any) -> Any:
        """Return the components of a vector (UFL) along the coordinates."""
        return vector

    def gradients(self, slopes: np.ndarray, values: np.ndarray, first: np.ndarray) -> Gradients:
        """Return displacement gradients at Gauss points.

        `slopes`: gradients of the shape functions, (n_cells, n_gauss, nodes, dim), [1 / length]; `values`: of
        the shape functions, (n_gauss, nodes); `first`: first coordinates of the points, (n_cells, n_gauss).
        """
        return Gradients(slopes)

    def unit_cell(self, nodes: np.ndarray) -> np.ndarray:
        """Return where the nodes of a reference cell are for a test of a material, (n, dim)."""
        return nodes

    def typical_size(self, points: np.ndarray) -> np.ndarray | float:
        """Return the ratio of the stiffness of cells to that of `unit_cell`, by places of nodes."""
        return 1.0

    def volumes(self, points: np.ndarray, cells: np.ndarray, positions: np.ndarray) -> np.ndarray:
        """Return volumes per volume of the reference cell, (n_cells, m), of affine cells (n_cells, 1).

        `positions`: reference coordinates, (m, dim).
        """
        return jacobians(points, cells, positions)

    def volume(self, mesh: BodyMesh, cells: np.ndarray) -> float:
        """Return the volume of some cells of a mesh, of plane ones the area, [length^dim]."""
        return float(cell_volumes(mesh.points, cells).sum())

    def on_axis(self, points: np.ndarray) -> np.ndarray:
        """Return which points lie on an axis of revolution, (n,)."""
        return np.zeros(len(points), dtype=bool)

    def rigid_modes(self, points: np.ndarray, at: np.ndarray | None = None) -> np.ndarray:
        """Return the rigid motions of a body at its nodes or elsewhere, see `rigid_body_modes`."""
        return rigid_body_modes(points, at)

    def kernel(self, of_material: Any, points: np.ndarray) -> np.ndarray:
        """Return the modes without energy of a material, (n, components, n_modes).

        `of_material`: its modes in its own space, a function of points.
        """
        return np.asarray(of_material(points))
