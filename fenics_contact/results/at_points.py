"""Stresses and strains at the points of the quadrature of cells, and at nodes extrapolated from there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from math import comb
from typing import TYPE_CHECKING

import numpy as np
import ufl

from fenics_contact import _dolfinx
from fenics_contact._base.display import displayed
from fenics_contact._base.libraries import MPI
from fenics_contact._fem.forms import temperature_of
from fenics_contact._fem.templates import quadrature_degree, volume_measure
from fenics_contact._kinematics.base import Gradients
from fenics_contact._kinematics.element import Element
from fenics_contact._kinematics.integration import OF_PRISMS
from fenics_contact._scene.body import Body
from fenics_contact.feti.torn import TornSystem
from fenics_contact.materials.elastic import isotropic_constants
from fenics_contact.materials.hyperelastic import has_mean_dilatation, is_nonlinear
from fenics_contact.materials.plane_stress import is_sheet
from fenics_contact.materials.plastic import has_history
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.cell_types import CellType, quadrature, shape_gradients, shape_values
from fenics_contact.mesh.collapsed import SHAPES, as_hexahedra, by_shape, collapse, places_of
from fenics_contact.mesh.quality import determinants
from fenics_contact.results.fields import CellStress, cells_of_body, tensors

if TYPE_CHECKING:
    from fenics_contact._fem.mechanics import Response


@dataclass(frozen=True, eq=False)
class AtPoints:
    """Values at the points of the quadrature of the cells of one body.

    Attributes:
        positions: Of the points in the reference cell, [0, 1] in each direction, shape (n_points, dim). Cells
            of other shapes are hexahedra some of whose vertices coincide.
    """

    positions: np.ndarray
    _cell: CellType

    @property
    def collapses(self) -> bool:
        """Whether triangles, prisms and tetrahedra are cells whose vertices coincide."""
        return not self._cell.is_simplex

    def to(self, places: np.ndarray) -> np.ndarray:
        """Return the matrix, (m, n_points), that makes values at other positions of those at the points.

        It is that of the polynomials that the points determine: of degree 1 or 2 in each direction, in
        triangles and tetrahedra of degree 0 or 1.
        """
        count = len(self.positions)
        return _monomials(self._cell, count, places) @ np.linalg.pinv(
            _monomials(self._cell, count, self.positions)
        )

    def at_nodes(self, values: np.ndarray, mesh: BodyMesh) -> tuple[np.ndarray, np.ndarray]:
        """Return values at nodes: those of each cell extrapolated to its nodes, then the mean over cells.

        As CalculiX does: 8 Gauss points by the trilinear function that they determine, 27 by the triquadratic
        one, 4 points of tetrahedra by the linear one, 9 of prisms by the function nearest to them that is
        linear in the triangle and across; means over all materials.

        Args:
            values: At the points, shape (n_cells, n_points, ...).
            mesh: The body's mesh.

        Returns:
            Sums over cells, and numbers of cells, shapes (n_nodes, ...) and (n_nodes,).
        """
        matrix, flat = self.to(self._cell.nodes), values.reshape(*values.shape[:2], -1)
        total, count = np.zeros((mesh.n_nodes, flat.shape[2])), np.zeros(mesh.n_nodes)
        for name, (mine, nodes) in by_shape(mesh.cells, mesh.dim).items():
            own = self._at_own_nodes(name, mesh.order, matrix)
            found = np.einsum("kq,cqi->cki", own, flat[mine]).reshape(nodes.size, -1)
            parts = [np.bincount(nodes.ravel(), column, minlength=mesh.n_nodes) for column in found.T]
            total += np.stack(parts, axis=1)
            count += np.bincount(nodes.ravel(), minlength=mesh.n_nodes)
        return total.reshape(mesh.n_nodes, *values.shape[2:]), count

    def _at_own_nodes(self, name: str, order: int, matrix: np.ndarray) -> np.ndarray:
        """Return the matrix for the nodes of a shape by that for those of the hexahedron."""
        if (name, order) == ("prism", 2):
            points = np.array(OF_PRISMS.metadata(2 * order, order)["quadrature_points"])
            corners = _linear_in_prism(np.array(SHAPES[name].vertex_places)) @ np.linalg.pinv(
                _linear_in_prism(points)
            )
            sets = SHAPES[name].sets(len(_own_places(name, order)))
            return np.stack([corners[list(each)].mean(axis=0) for each in sets]) @ self.to(points)
        return _own_places(name, order) @ matrix if self.collapses else matrix


@displayed
@dataclass(frozen=True, eq=False)
class PointFields(AtPoints):
    """Stress and strain of one body at the points of the quadrature of its cells, replicated on all ranks.

    Attributes:
        positions: See `AtPoints`.
        stress: Shape (n_cells, n_points, 3, 3), [force / length²], Cauchy's where bodies deform much.
        strain: Shape (n_cells, n_points, 3, 3): ½ (∇u + ∇uᵀ), where bodies deform much ½ (FᵀF − 1). Normal to
            plane bodies it is zero, in plane stress with isotropic materials −ν/E (σ₁₁ + σ₂₂), without what
            heat adds, and with nonlinear ones not a number.
        plastic_strain: Shape (n_cells, n_points): the accumulated equivalent plastic strain, zero in
            materials without one.
    """

    stress: np.ndarray
    strain: np.ndarray
    plastic_strain: np.ndarray


def _linear_in_prism(places: np.ndarray) -> np.ndarray:
    """Return 1, x and y of a triangle times 1 and z at places in the cube that is the prism, (m, 6)."""
    x, y, z = places[:, 0] * (1.0 - places[:, 1]), places[:, 1], places[:, 2]
    return np.stack([power * up for up in (np.ones_like(z), z) for power in (np.ones_like(x), x, y)], axis=1)


def _own_places(name: str, order: int) -> np.ndarray:
    """Return the matrix of means over the places in the hexahedron where each node of a shape is."""
    there = np.isclose(collapse(name, order).values, 1.0).T
    return np.asarray(there / there.sum(axis=1, keepdims=True))


def _monomials(cell: CellType, count: int, places: np.ndarray) -> np.ndarray:
    """Return the monomials, (m, k), that as many points of a quadrature determine."""
    if cell.is_simplex:
        degree = max(d for d in range(6) if comb(d + cell.dim, cell.dim) <= count)
        powers = [each for each in product(range(degree + 1), repeat=cell.dim) if sum(each) <= degree]
    else:
        powers = list(product(range(round(count ** (1.0 / cell.dim))), repeat=cell.dim))
    return np.stack([np.prod(places**power, axis=1) for power in np.array(powers)], axis=1)


class PointStress(CellStress):
    """The stress at the points of the quadrature of the cells of one body.

    Functions that are one at a point and zero at all others have the weighted stress there as integral.
    """

    def _measure(self, element: Element) -> ufl.Measure:
        return volume_measure(element)

    def _tests(self, element: Element) -> ufl.FunctionSpace:
        return _dolfinx.point_space(element.cells, quadrature_degree(element))

    def _space_on(self, mesh: _dolfinx.mesh.Mesh, element: Element) -> _dolfinx.fem.FunctionSpace:
        return _dolfinx.point_space_on(mesh, quadrature_degree(element))


@dataclass(frozen=True, eq=False)
class QuadraturePoints:
    """The points of the quadrature of the cells of a body, and the displacements of its nodes."""

    body: Body
    displacement: np.ndarray

    @cached_property
    def positions(self) -> np.ndarray:
        """Positions of the points in the reference cell."""
        return quadrature(self.body.element.cell, quadrature_degree(self.body.element))[0]

    @cached_property
    def weights(self) -> np.ndarray:
        """Volumes that belong to the points, (n_cells, n_points)."""
        mesh, cell = self.body.mesh, self.body.element.cell
        at = places_of(mesh.points, mesh.cells)
        jacobian = np.einsum("cai,qaj->cqij", at, shape_gradients(cell, self.positions))
        around = self.body.kinematics.measure.around(at[..., 0] @ shape_values(cell, self.positions).T)
        rule = quadrature(cell, quadrature_degree(self.body.element))[1]
        return np.asarray(rule * determinants(jacobian) * around)

    @cached_property
    def gradients(self) -> Gradients:
        """The gradients of the shape functions."""
        mesh, cell, kinematics = self.body.mesh, self.body.element.cell, self.body.kinematics
        at, values = places_of(mesh.points, mesh.cells), shape_values(cell, self.positions)
        slopes = shape_gradients(cell, self.positions)
        jacobian = np.einsum("cai,qaj->cqij", at, slopes)
        return kinematics.gradients(slopes @ np.linalg.inv(jacobian), values, at[..., 0] @ values.T)

    def strain(self, stress: np.ndarray) -> np.ndarray:
        """Return the strain at the points, (n_cells, n_points, 3, 3); see `PointFields`."""
        body, cells = self.body, self.body.mesh.cells
        slope = self.gradients.of(as_hexahedra(self.displacement[cells], cells, body.mesh.dim))
        strain = 0.5 * (slope + slope.swapaxes(2, 3))
        if body.deforms_much:
            strain += 0.5 * slope.swapaxes(2, 3) @ slope
        for number, material in enumerate(body.materials):
            mine = body.material_of_cells == number
            young, poisson = isotropic_constants(material) or (np.inf, 0.0)
            if is_sheet(material):
                strain[mine, :, 2, 2] = np.nan
                continue
            if body.mesh.dim == 2 and not strain[mine][..., 2, 2].any() and not stress[mine][..., 2, 2].any():
                strain[mine, :, 2, 2] = -poisson / young * (stress[mine, :, 0, 0] + stress[mine, :, 1, 1])
        return strain


def point_fields(
    torn: TornSystem,
    name: str,
    u: _dolfinx.fem.Function,
    displacement: np.ndarray,
    responses: Sequence[Response],
) -> PointFields:
    """Return stress and strain of a body at the points of its quadrature, on every rank. Collective.

    `displacement`: of its nodes; `responses`: of materials of subdomains of this rank that remember.
    """
    body, comm = torn.scene.bodies[name], torn.decomposition.comm
    points = QuadraturePoints(body, displacement)
    points_stress = PointStress(u.function_space.mesh, body, comm, temperature_of(torn.scene.loads, name))
    stress = _gathered(points_stress, u, body, len(points.positions))
    _put_mean_pressure(body, stress)
    plastic, parts = np.zeros(stress.shape[:2]), zip(torn.decomposition.meshes, responses, strict=False)
    if any(map(has_history, body.materials)):
        mine = [(mesh.cells, response) for mesh, response in parts if mesh.body == name]
        _overwrite(comm, stress, [(at, end.stress) for at, end in mine if end.stress is not None])
        found = [(at, _plastic_strain(body, at, end.history)) for at, end in mine if end.history is not None]
        _overwrite(comm, plastic, found)
    return PointFields(points.positions, body.element.cell, stress, points.strain(stress), plastic)


def _gathered(at: PointStress, u: _dolfinx.fem.Function, body: Body, count: int) -> np.ndarray:
    """Return the stresses at the points of all cells in the body's order, on every rank. Collective."""
    mesh, own = u.function_space.mesh, at.components(u)
    number = cells_of_body(mesh, body.mesh.apart[0])
    known = np.zeros((body.mesh.n_cells, count, own.shape[1]))
    known[number] = own.reshape(len(number), count, own.shape[1])
    return tensors(np.asarray(mesh.comm.allreduce(known)))


def _put_mean_pressure(body: Body, stress: np.ndarray) -> None:
    """Let linear cells of materials that depend on the mean change of volume have the mean of pressures."""
    for number, material in enumerate(body.materials):
        if body.mesh.order == 1 and has_mean_dilatation(material):
            mine = body.material_of_cells == number
            pressure = np.trace(stress[mine], axis1=2, axis2=3) / 3.0
            stress[mine] += (pressure.mean(axis=1, keepdims=True) - pressure)[..., None, None] * np.eye(3)


def _plastic_strain(body: Body, cells: np.ndarray, history: np.ndarray) -> np.ndarray:
    """Return the equivalent plastic strain at the points of some cells, from what materials remember."""
    found, tags = np.zeros(history.shape[:2]), body.material_of_cells[cells]
    for number, material in enumerate(body.materials):
        if has_history(material):
            own = history[tags == number][..., : material.history_size]
            strain = material.equivalent_plastic_strain(own.reshape(-1, material.history_size))
            found[tags == number] = strain.reshape(own.shape[:2])
    return found


def _overwrite(comm: MPI.Comm, values: np.ndarray, parts: list[tuple[np.ndarray, np.ndarray]]) -> None:
    """Overwrite values in cells that this or another rank knows; NaN is unknown. Collective."""
    known = np.full_like(values, np.nan)
    for cells, own in parts:
        known[cells] = own
    here = ~np.isnan(known)
    total = comm.allreduce(np.where(here, known, 0.0))
    count = comm.allreduce(here.astype(float))
    values[count > 0.0] = total[count > 0.0]


def forces_at_rest(torn: TornSystem, name: str, mesh: _dolfinx.mesh.Mesh) -> np.ndarray:
    """Return ∫ σ : ∇v of the stress of a body at rest, by node, (n_nodes, dim), [force]. Collective.

    Initial stress less what heat would take to be held back; without any, and of nonlinear materials, zero.
    `mesh`: that of the body.
    """
    body, comm = torn.scene.bodies[name], torn.decomposition.comm
    temperature = temperature_of(torn.scene.loads, name)
    if not (temperature.loads or temperature.initial) or any(map(is_nonlinear, body.materials)):
        return np.zeros_like(body.mesh.points)
    points = QuadraturePoints(body, np.zeros_like(body.mesh.points))
    at, rest = PointStress(mesh, body, comm, temperature), _dolfinx.coefficient(mesh, "u")
    return added_up(
        body.mesh, points.gradients.force(points.weights, _gathered(at, rest, body, len(points.positions)))
    )


def added_up(mesh: BodyMesh, nodal: np.ndarray) -> np.ndarray:
    """Return sums at nodes, (n_nodes, k), of values at those of cells, (n_cells, n, k), as hexahedra."""
    cells, apart = mesh.apart
    columns, count = np.moveaxis(nodal, 2, 0), int(cells.max()) + 1
    force = np.stack([np.bincount(cells.ravel(), each.ravel(), count) for each in columns], axis=1)
    force = force if apart is None else np.asarray(apart.T @ force)
    force = np.pad(force, ((0, mesh.n_nodes - len(force)), (0, 0)))
    followers = mesh.followers
    return np.asarray(followers.followed(len(force)).T @ force) if followers else force
