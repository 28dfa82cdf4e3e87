"""Bodies of revolution: half a section (r, z), all around the axis."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fenics_contact._kinematics.base import ByRadius, GaussPoints, Gradients, Kinematics
from fenics_contact._kinematics.measure import Measure
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.cell_types import CELL_TYPES, cell_type_of, quadrature, shape_values
from fenics_contact.mesh.collapsed import places_of
from fenics_contact.mesh.faces import computed_rounding
from fenics_contact.mesh.quality import jacobians


@dataclass(frozen=True)
class RevolvedMeasure(Measure):
    """Each is that of a full revolution; the first coordinate is the radius."""

    varies = True

    def around(self, first: Any) -> Any:
        """Return the circumference."""
        return 2 * np.pi * first

    def around_closed(self, first: np.ndarray, closed: np.ndarray, share: np.ndarray) -> np.ndarray | float:
        """Return the circumference."""
        near, far = np.where(closed[:, :1], first, first[:, ::-1]).T
        return np.asarray(2 * np.pi * (near + share / 2 * (far - near)))

    def weights(self, weight: np.ndarray, functions: np.ndarray, first: np.ndarray) -> np.ndarray:
        """Return weights with the circumference in them."""
        return np.asarray(2 * np.pi * weight * np.einsum("nqk,nk->nq", functions, first))

    def density(
        self, value: np.ndarray, by_place: np.ndarray, first: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return a density times the circumference, and its derivative by the place."""
        outwards = np.stack([value, np.zeros_like(value)], axis=1)
        return self.around(first) * value, 2 * np.pi * (first[:, None] * by_place + outwards)

    def bearing(self, points: np.ndarray, facets: np.ndarray, areas: np.ndarray) -> np.ndarray:
        """Return the areas with those of ends of quadratic edges on the axis moved to their midpoints."""
        if facets.shape[1] != 3:
            return areas
        ends = np.where(_on_axis(points, facets), areas[:, :2], 0.0)
        areas[:, :2] -= ends
        areas[:, 2] += ends.sum(axis=1)
        return areas

    def bearing_pulled_back(self, points: np.ndarray, facets: np.ndarray, by_areas: np.ndarray) -> np.ndarray:
        """Vector-Jacobian product of `bearing`."""
        if facets.shape[1] == 3:
            by_areas[:, :2] = np.where(_on_axis(points, facets), by_areas[:, 2:], by_areas[:, :2])
        return by_areas

    def ends(self, points: np.ndarray, facets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the ends of quadratic edges on the axis, and their midpoints.

        A uniform pressure makes no force at such an end, but a tip that presses there does.
        """
        if facets.shape[1] != 3:
            return super().ends(points, facets)
        facet, end = np.nonzero(_on_axis(points, facets))
        return facets[facet, end], facets[facet, 2]

    def filled(self, facets: np.ndarray, values: np.ndarray, on_axis: np.ndarray) -> np.ndarray:
        """Return values with those at ends of quadratic edges on the axis: those of an even parabola.

        Larger values stay: a tip that presses there has no neighbour that does.
        """
        result = values.copy()
        if facets.shape[1] == 3:
            for here, there in ((0, 1), (1, 0)):
                edges = facets[on_axis[facets[:, here]]]
                even = (4 * values[edges[:, 2]] - values[edges[:, there]]) / 3
                result[edges[:, here]] = np.maximum(values[edges[:, here]], even)
        return result


def _on_axis(points: np.ndarray, facets: np.ndarray) -> np.ndarray:
    """Return which ends of quadratic edges lie on the axis, (n_facets, 2)."""
    return np.asarray(points[facets[:, :2], 0] <= computed_rounding(points))


@dataclass(frozen=True)
class Revolution(Kinematics):
    """Bodies of revolution, with the radius as first coordinate and the height along the axis as second.

    Displacements are (u_r, u_z). Materials are those of space: the axes r, z and around the circumference
    are x, y and z, and the gradient in space is [[u_r,r, u_r,z, 0], [u_z,r, u_z,z, 0], [0, 0, u_r / r]].
    """

    dim: int = 2

    measure: ClassVar[Measure] = RevolvedMeasure()
    name = "axisymmetric"
    in_words = ", a body of revolution"
    record: ClassVar[dict[str, bool]] = {"axisymmetric": True}
    held_on_axis: ClassVar[dict[int, str]] = {0: "radial displacement"}
    least_degree = 2  # the hoop strain varies in linear triangles, too
    is_homogeneous = False
    can_rotate = False

    @property
    def axes(self) -> tuple[str, ...]:
        """The radius and the height."""
        return ("r", "z")

    @property
    def material_dim(self) -> int:
        """Materials are those of space."""
        return 3

    @property
    def needed_material(self) -> str:
        """What to say of a material of the plane."""
        return (
            "the material of a body of revolution must be one of space, {name} is for {dims}: use "
            "IsotropicElasticity, OrthotropicElasticity or others that plane bodies cannot have"
        )

    @property
    def zero_stress(self) -> tuple[str, ...]:
        """Shear around the circumference."""
        return ("yz", "xz")

    @property
    def axis_in_words(self) -> str:
        """The axis is that of the section."""
        return "point (0, 0) and axis (0, 1)"

    def has_axis(self, point: Sequence[float], axis: Sequence[float] | None) -> bool:
        """Return whether an axis is that of the section."""
        return super().has_axis(point, axis) and point[0] == 0.0 and axis in ((0.0, 1.0), (0.0, -1.0))

    def has_moment(self, moment: Any, at: Any) -> bool:
        """Return whether there is none."""
        return moment is None and at is None

    def is_mirrored(self, normal: np.ndarray, tilt: float) -> bool:
        """Return whether the normal is along the axis; others are those of cones."""
        return bool(abs(normal[1]) >= 1.0 - tilt)

    @property
    def balanced(self) -> np.ndarray:
        """Ones, zero for radial forces."""
        return np.array([0.0, 1.0, 1.0][: self.components])

    @property
    def motions(self) -> int:
        """The translation along the axis."""
        return 1

    def integrand(self, density: Any, x: Any) -> Any:
        """Return the density times the circumference."""
        return self.measure.around(x[0]) * density

    def in_space(self, x: Any, fields: tuple[Any, ...]) -> tuple[Any, ...]:
        """Return a displacement in space for each."""
        import ufl  # plane and solid bodies go without

        from fenics_contact.materials.stand_ins import stand_in

        return tuple(
            stand_in(
                number,
                ufl.as_vector([u[0], u[1], self._turn(u)]),
                self._gradient_in_space(ufl.grad(u), u[0] / x[0], self._turn(u) / x[0]),
            )
            for number, u in enumerate(fields)
        )

    def of_gradient(self, energy: Callable[[Any], Any], gradient: Any, x: Any, constant: Any) -> Any:
        """Return an energy density of a gradient; u_r / r and u_θ / r are as accurate, and left out."""
        import ufl

        from fenics_contact.materials.stand_ins import stand_in

        strained = stand_in(0, ufl.as_vector([0, 0, 0]), self._gradient_in_space(gradient, 0.0, 0))
        return self.on_cells(energy(strained), x)

    def _turn(self, u: Any) -> Any:
        """Return the displacement around the axis (UFL)."""
        return 0

    def _gradient_in_space(self, gradient: Any, hoop: Any, turn: Any) -> Any:
        """Return the gradient in space (UFL) by u_r / r and u_θ / r."""
        import ufl

        return ufl.as_tensor(
            [[gradient[0, 0], gradient[0, 1], 0], [gradient[1, 0], gradient[1, 1], 0], [0, 0, hoop]]
        )

    def on_cells(self, density: Any, x: Any) -> Any:
        """Return what a material made of displacements in space."""
        from fenics_contact.materials.stand_ins import replaced

        return replaced(density, x)

    def gradients(self, slopes: np.ndarray, values: np.ndarray, first: np.ndarray) -> Gradients:
        """Return gradients with a hoop strain."""
        return HoopGradients(slopes, values / first[..., None])

    def unit_cell(self, nodes: np.ndarray) -> np.ndarray:
        """Return the nodes at radii around one."""
        return nodes + np.array([0.5, 0.0])

    def typical_size(self, points: np.ndarray) -> np.ndarray | float:
        """Return the mean radius of cells, by the places of their nodes, (n_cells, nodes, 2)."""
        return np.asarray(points[..., 0].mean(axis=1))

    def volumes(self, points: np.ndarray, cells: np.ndarray, positions: np.ndarray) -> np.ndarray:
        """Return volumes of a full revolution per area of the reference cell, (n_cells, m)."""
        places = places_of(points, cells)
        radii = places[..., 0] @ shape_values(cell_type_of(cells, 2), positions).T
        return np.asarray(self.measure.around(radii) * jacobians(points, cells, positions))

    def volume(self, mesh: BodyMesh, cells: np.ndarray) -> float:
        """Return the volume of a full revolution."""
        cell = CELL_TYPES[mesh.cell_type]
        positions, weights = quadrature(cell, 2 * cell.order)
        return float((self.volumes(mesh.points, cells, positions) @ weights).sum())

    def on_axis(self, points: np.ndarray) -> np.ndarray:
        """Return which points of a body lie on its axis."""
        return np.asarray(points[:, 0] <= computed_rounding(points))

    def rigid_modes(self, points: np.ndarray, at: np.ndarray | None = None) -> np.ndarray:
        """Return the translation along the axis, shape (n, 2, 1)."""
        return self._modes(points if at is None else at, float(points[:, 0].max()))

    def nearly_rigid(self, points: np.ndarray) -> np.ndarray:
        """Return the radial motion and the turn of the section.

        Of a part of size d at the radius r, hoop strains alone resist them: with (d / r)² of its stiffness.
        """
        arms = points - points.mean(axis=0)
        modes = np.zeros((len(points), self.components, 2))
        modes[:, 0, 0] = 1.0
        modes[:, 0, 1], modes[:, 1, 1] = -arms[:, 1], arms[:, 0]
        modes[self.on_axis(points), 0] = 0.0
        return modes

    def _modes(self, points: np.ndarray, radius: float) -> np.ndarray:
        modes = np.zeros((len(points), self.components, self.motions))
        modes[:, 1, 0] = 1.0
        return modes

    def resultant(
        self, forces: np.ndarray, places: np.ndarray, about: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray | float]:
        """Return the sum of the radial forces and the axial force; there is no moment, (0,)."""
        return forces.sum(axis=0), np.zeros(0)

    def moment_at(
        self, force: np.ndarray, moment: np.ndarray, point: np.ndarray, about: np.ndarray
    ) -> np.ndarray | float:
        """Return no moment, (0,)."""
        return np.zeros(0)

    def whole_force(self, force: float, point: np.ndarray, planes: int) -> tuple[float, float | None]:
        """Return the force and its radius, zero where a plane of symmetry cuts it: the axis."""
        return force, 0.0 if planes else float(point[0])

    def from_origin(self, points: np.ndarray) -> np.ndarray:
        """Return the places themselves: u_z = r is shear alone, and u_r = z has a hoop strain."""
        return points

    def further_fields(self, places: np.ndarray) -> list[np.ndarray]:
        """Return (1, 0), which has the hoop strain 1 / r, and no other."""
        return [np.broadcast_to(np.eye(self.components)[0], (len(places), self.components))]

    def further_strains(self, gradients: np.ndarray, by_radius: ByRadius) -> list[np.ndarray]:
        """Return the hoop strain beyond that of u = (r, 0) with the same radial strain."""
        radial = gradients[:, 0, 0]
        return [by_radius(radial, 0) - radial]

    def of_unit_strains(
        self, rest: np.ndarray, further: list[np.ndarray], gauss_points: Callable[[], GaussPoints]
    ) -> list[np.ndarray]:
        """Return the stress of a unit hoop strain."""
        weights, places = gauss_points()
        mean = ((weights * places[..., 0]).sum(axis=1) / weights.sum(axis=1))[:, None]
        return [rest + mean * (further[0] - rest)]

    def kernel(self, of_material: Any, points: np.ndarray) -> np.ndarray:
        """Return the rigid motions that the material does not resist."""
        in_space = of_material(np.pad(points, ((0, 0), (0, 1)))).reshape(3 * len(points), -1)
        modes = self._modes(points, float(points[:, 0].max(initial=0.0)))
        moved = np.pad(modes, ((0, 0), (0, 3 - modes.shape[1]), (0, 0))).reshape(len(in_space), -1)
        rest = moved - in_space @ np.linalg.lstsq(in_space, moved, rcond=None)[0]
        return modes[..., np.abs(rest).max(axis=0) <= 1e-8]


class HoopGradients(Gradients):
    """Displacement gradients with the hoop strain u_r / r."""

    def __init__(self, slopes: np.ndarray, hoop: np.ndarray) -> None:
        """Keep the gradients of the shape functions, and these over the radius, (n_cells, n_gauss, nodes)."""
        super().__init__(slopes)
        self._hoop = hoop

    def part(self, cells: np.ndarray) -> HoopGradients:
        """Return those of some cells."""
        return HoopGradients(self.slopes[cells], self._hoop[cells])

    @property
    def divergence(self) -> np.ndarray:
        """Trace of the gradient for each unit nodal displacement."""
        divergence = self.slopes.copy()
        divergence[..., 0] += self._hoop
        return divergence

    def of(self, nodal: np.ndarray) -> np.ndarray:
        """Return the gradient in three dimensions."""
        gradient = super().of(nodal)
        gradient[..., 2, 2] = np.einsum("cqa,ca->cq", self._hoop, nodal[..., 0])
        return gradient

    def contracted(self, tensors: np.ndarray) -> np.ndarray:
        """Return T : ∇v for each unit nodal v."""
        result = super().contracted(tensors)
        result[..., 0] += tensors[..., 2, 2, None] * self._hoop
        return result

    def force(self, weights: np.ndarray, stress: np.ndarray) -> np.ndarray:
        """Return ∫ P : ∇v."""
        nodal = super().force(weights, stress)
        nodal[..., 0] += np.einsum("cqa,cq->ca", self._hoop, weights * stress[..., 2, 2])
        return nodal

    def blocks(self, weights: np.ndarray, tangent: np.ndarray) -> np.ndarray:
        """Return ∫ ∇v : A : ∇u."""
        G, N, each = self.slopes, self._hoop, weights[..., None, None]
        by_hoop = (each * tangent[..., :2, :2, 2, 2]).swapaxes(2, 3)  # [j, i]
        from_hoop = each * tangent[..., 2, 2, :2, :2]
        n, _, nodes, dim = G.shape
        blocks = np.zeros((n, nodes, dim, nodes, dim))
        blocks[..., 0] += np.einsum("cqai,cqb->caib", G @ by_hoop, N)
        blocks[:, :, 0] += np.einsum("cqa,cqbk->cabk", N, G @ from_hoop.swapaxes(2, 3))
        both = weights * tangent[..., 2, 2, 2, 2]
        blocks[:, :, 0, :, 0] += np.einsum("cqa,cq,cqb->cab", N, both, N)
        return np.asarray(super().blocks(weights, tangent) + blocks)
