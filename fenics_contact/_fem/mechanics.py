"""Internal forces and tangents of linear, hyperelastic and history-dependent materials."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Protocol

import numpy as np
import scipy.sparse as sp

from fenics_contact import _dolfinx
from fenics_contact._base.display import displayed
from fenics_contact._base.libraries import MPI
from fenics_contact._fem.composition import Composition, material_sets
from fenics_contact._fem.deformed_forms import FORMS, have_mean_energy, prepare_forms
from fenics_contact._fem.heated import heat_expands
from fenics_contact._fem.kinematics import (
    Dilatation,
    GaussPoints,
    MeanDilatation,
    PointDilatation,
    assembled,
    mean_fields,
)
from fenics_contact._fem.templates import Templates, quadrature_degree
from fenics_contact._kinematics.element import Element
from fenics_contact._scene.body import Body
from fenics_contact._scene.scene import Scene
from fenics_contact.errors import InvalidInputError
from fenics_contact.materials.hyperelastic import is_nonlinear
from fenics_contact.materials.plastic import HistoryMaterial, has_history
from fenics_contact.mesh.cell_types import CELL_TYPES, quadrature
from fenics_contact.mesh.quality import determinants
from fenics_contact.mesh.transfer import MeshTransfer


@displayed
@dataclass(frozen=True, eq=False)
class History:
    """Internal variables of the bodies whose materials have some, replicated on all ranks.

    They are kept by the cells of the bodies' meshes, so that they do not depend on subdomains and ranks. A
    body that moves keeps them. `values`: name of a body to its internal variables; where several materials
    have different numbers of them, the first ones count.
    """

    values: Mapping[str, np.ndarray]

    @classmethod
    def unloaded(cls, scene: Scene) -> History:
        """Return the history of a scene to which nothing has happened: zeros."""
        return cls({n: np.zeros(_shape(body)) for n, body in scene.bodies.items() if history_size(body)})

    def advanced(self, comm: MPI.Comm, parts: Iterable[tuple[str, np.ndarray, np.ndarray | None]]) -> History:
        """Return the history after a step. Collective on ``comm``.

        `parts`: for each of this rank's subdomains its body, its cells of the body's mesh and what they
        remember, (n_cells, n_gauss, k), None where nothing does.
        """
        values = {name: array.copy() for name, array in self.values.items()}
        mine = [part for part in parts if part[0] in values]
        for every in comm.allgather(mine) if comm.size > 1 else [mine]:
            for body, cells, new in every:
                values[body][cells] = new
        return History(values)

    def carried(self, old: Scene, new: Scene, transfers: Mapping[str, MeshTransfer]) -> History:
        """Return the history on other meshes of the bodies, see `MeshTransfer.at_gauss_points`."""
        values = dict(self.values)
        for name, transfer in transfers.items():
            if name not in values:
                continue
            body, mesh = new.bodies[name], old.bodies[name].mesh
            degree = quadrature_degree(body.element)
            found = transfer.at_gauss_points(mesh, body.mesh, degree, values[name])
            for number, material in enumerate(body.materials):
                if has_history(material):
                    size, mine = material.history_size, body.material_of_cells == number
                    kept = material.admissible(found[mine, :, :size].reshape(-1, size))
                    found[mine, :, :size] = kept.reshape(-1, found.shape[1], size)
            values[name] = found
        return History(values)


def history_size(body: Body) -> int:
    """Return the largest number of internal variables of a body's materials, 0 without any."""
    return max((each.history_size for each in body.materials if has_history(each)), default=0)


def _shape(body: Body) -> tuple[int, int, int]:
    cell = CELL_TYPES[body.mesh.cell_type]
    points = len(quadrature(cell, quadrature_degree(body.element))[1])
    return body.mesh.n_cells, points, history_size(body)


@dataclass(frozen=True, eq=False)
class Response:
    """What a mesh with nonlinear materials answers to a displacement.

    Where cells are turned inside out, `least_jacobian` says so and the other numbers mean nothing; with most
    models they are NaN. `energy`: stored energy, [force · length]; None where materials dissipate; `history`:
    internal variables at the end of the step; None without any; `stress`: cauchy stress at the Gauss points
    of materials with a history, NaN in cells of other materials; None without any; `by_stress`: assembles the
    part of `stiffness` that is due to stresses as they turn with the cells; None where tangents at rest are a
    measure of what materials resist.
    """

    force: np.ndarray
    tangent: Callable[[], sp.csr_matrix]
    energy: float | None
    least_jacobian: float
    history: np.ndarray | None = None
    stress: np.ndarray | None = None
    by_stress: Callable[[], sp.csr_matrix] | None = None

    @cached_property
    def stiffness(self) -> sp.csr_matrix:
        """Tangent ∂f/∂u, shape (dim n, dim n), [force / length]; assembled on first use."""
        return self.tangent()

    def with_matrices(self, mapped: Callable[[sp.csr_matrix], sp.csr_matrix]) -> Response:
        """Return it with other matrices by those of now."""
        turning = self.by_stress
        return replace(
            self,
            tangent=lambda: mapped(self.stiffness),
            by_stress=None if turning is None else lambda: mapped(turning()),
        )


@dataclass(frozen=True, eq=False)
class MaterialStep:
    """What materials remember of a load step's start, and what led to a displacement.

    `history`: internal variables at the start, for materials that have some by the mesh's cells; None for an
    unloaded body; `duration`: time since the start, for materials that creep; `origin`: displacement at the
    start of the Newton step, None where there was none: tangents of mean dilatations have the pressures that
    this step foresaw; `temperature`: change of temperature by input node, None without any.
    """

    history: np.ndarray | None = None
    duration: float = np.nan
    origin: np.ndarray | None = None
    temperature: np.ndarray | None = None


FROM_REST = MaterialStep()


class Mechanics(Protocol):
    """Internal forces and tangent of one mesh with nonlinear materials."""

    def at(self, displacement: np.ndarray, step: MaterialStep = FROM_REST) -> Response:
        """Return the response to a displacement, by dof block after block, shape (dim n,), [length]."""

    def jacobians(self, displacement: np.ndarray) -> np.ndarray:
        """Return det F at the Gauss points, shape (n,), a cubic function; it takes no assembly."""


class HistoryMechanics:
    """`Mechanics` of materials with a history."""

    def __init__(
        self, parts: Composition, element: Element, space: _dolfinx.fem.FunctionSpace, points: np.ndarray
    ) -> None:
        """Evaluate shape functions."""
        nodes, dofs = self._blocks = _dolfinx.node_dofs(space)
        by_block = np.empty_like(points)
        by_block[dofs] = points[nodes]
        self._gauss = GaussPoints(space, element, by_block)
        self._dilatation = Dilatation(space, element, by_block)
        self._parts = [
            (material, parts.cells_of(tag, self._gauss.shape[0]))
            for tag, material in enumerate(parts.materials, start=1)
            if has_history(material)
        ]
        self._size = max(material.history_size for material, _ in self._parts)

    @property
    def history_shape(self) -> tuple[int, int, int]:
        """Shape of a history: cells, Gauss points of a cell, internal variables."""
        return *self._gauss.shape, self._size

    def at(self, displacement: np.ndarray, step: MaterialStep = FROM_REST) -> Response:
        """Evaluate the materials and assemble; see `Mechanics.at`."""
        return self._answered(displacement, step)[0]

    def _answered(self, displacement: np.ndarray, step: MaterialStep) -> tuple[Response, np.ndarray]:
        """Return the response, and the entries of its tangent."""
        before, gradient = self._before(step.history), self._gauss.gradient(displacement)
        after, stress = before.copy(), np.full(gradient.shape, np.nan)
        force, entries = np.zeros(displacement.size), np.zeros(self._gauss.entries)
        heat = self._heat(step.temperature)
        for material, cells in self._parts:
            if not len(cells):
                continue
            shape, size = (len(cells), gradient.shape[1]), material.history_size
            strain = self._gauss.strain_of(material, cells)
            given, stretch = _without_expansion(
                material, gradient[cells], None if heat is None else heat[cells]
            )
            end = material.answer(
                strain.averaged(given).reshape(-1, 3, 3),
                before[cells, :, :size].reshape(shape[0] * shape[1], size),
                step.duration,
                None if heat is None else heat[cells].ravel(),
            )
            after[cells, :, :size] = end.history.reshape(*shape, size)
            nominal = stretch**2 * end.stress.reshape(*shape, 3, 3)
            stress[cells] = cauchy(nominal, gradient[cells]) if material.finite else nominal
            force += self._gauss.force(strain.averaged(nominal), cells)
            tangent = stretch[..., None, None] * end.tangent.reshape(*shape, 3, 3, 3, 3)
            if not material.symmetric:
                tangent = 0.5 * (tangent + tangent.transpose(0, 1, 4, 5, 2, 3))
            entries += self._gauss.stiffness(tangent, cells, strain)
        response = Response(
            force=force,
            tangent=lambda: self._gauss.assembled(entries),
            energy=None,
            least_jacobian=float(self.jacobians(displacement).min()),
            history=after,
            stress=stress,
            by_stress=partial(self._by_stress, gradient, stress),
        )
        return response, entries

    def _by_stress(self, gradient: np.ndarray, stress: np.ndarray) -> sp.csr_matrix:
        """Return ∫ ∇v S : ∇u, S = det F F⁻¹σF⁻ᵀ; see `Response.by_stress`."""
        entries = np.zeros(self._gauss.entries)
        for material, cells in self._parts:
            if material.finite and len(cells):
                second = second_piola_kirchhoff(stress[cells], gradient[cells])
                tangent = np.einsum("ik,...jl->...ijkl", np.eye(3), second)
                entries += self._gauss.stiffness(tangent, cells)
        return self._gauss.assembled(entries)

    def jacobians(self, displacement: np.ndarray) -> np.ndarray:
        """Return det F; see `Mechanics.jacobians`."""
        return self._dilatation.at(displacement).ravel()

    def _heat(self, temperature: np.ndarray | None) -> np.ndarray | None:
        """Return the change of temperature at the points, shape (n_cells, n_gauss)."""
        if temperature is None:
            return None
        nodes, dofs = self._blocks
        by_block = np.empty(len(nodes))
        by_block[dofs] = temperature[nodes]
        return self._gauss.interpolated(by_block)

    def _before(self, history: np.ndarray | None) -> np.ndarray:
        if history is None:
            return np.zeros(self.history_shape)
        if history.shape != self.history_shape:
            raise InvalidInputError(
                f"the history must have shape {self.history_shape}, got {history.shape}: start with None"
            )
        return history


class MixedMechanics(HistoryMechanics):
    """`Mechanics` of materials with a history and of others on the same mesh."""

    def __init__(
        self,
        parts: Composition,
        element: Element,
        space: _dolfinx.fem.FunctionSpace,
        points: np.ndarray,
        others: Mechanics,
    ) -> None:
        """Evaluate shape functions."""
        super().__init__(parts, element, space, points)
        self._others = others

    def at(self, displacement: np.ndarray, step: MaterialStep = FROM_REST) -> Response:
        """Add what the others answer; see `Mechanics.at`."""
        own, entries = self._answered(displacement, step)
        rest = self._others.at(displacement, step)

        def tangent() -> sp.csr_matrix:
            return self._gauss.assembled(self._gauss.with_others(entries, rest.stiffness))

        return replace(own, force=own.force + rest.force, tangent=tangent, by_stress=None)


def _without_expansion(
    material: HistoryMaterial, gradient: np.ndarray, heat: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray]:
    """Return the displacement gradients that a material feels, and its thermal stretches θ.

    Of large deformations P = θ² P(F / θ), as of the energy θ³ W(F / θ); else strains are subtracted, θ = 1.

    The stretches have the shape (n_cells, n_gauss, 1, 1), or (1, 1) where all are one.
    """
    if heat is None or material.thermal_expansion is None:
        return gradient, np.ones((1, 1))
    strain, one = (material.thermal_expansion * heat)[..., None, None], np.eye(3)
    if not material.finite:
        return gradient - strain * one, np.ones((1, 1))
    return (gradient - strain * one) / (1 + strain), 1 + strain


def cauchy(nominal: np.ndarray, gradient: np.ndarray) -> np.ndarray:
    """Return P Fᵀ / det F by the first Piola-Kirchhoff stress and the displacement gradient, (..., 3, 3)."""
    F = np.eye(3) + gradient
    return np.asarray(nominal @ F.swapaxes(-1, -2) / determinants(F)[..., None, None])


def second_piola_kirchhoff(stress: np.ndarray, gradient: np.ndarray) -> np.ndarray:
    """Return det F F⁻¹σF⁻ᵀ by the Cauchy stress and the displacement gradient, (..., 3, 3)."""
    F = np.eye(3) + gradient
    inverse = np.linalg.inv(F)
    return np.asarray(determinants(F)[..., None, None] * (inverse @ stress @ inverse.swapaxes(-1, -2)))


class HyperelasticMechanics:
    """`Mechanics` of materials with an energy; linear ones among them stay small-strain."""

    def __init__(
        self,
        templates: Templates,
        parts: Composition,
        element: Element,
        space: _dolfinx.fem.FunctionSpace,
        points: np.ndarray,
    ) -> None:
        """Bind the forms; arguments as in `FormLibrary.mechanics`."""
        nodes, dofs = _dolfinx.node_dofs(space)
        by_block = np.empty_like(points)
        by_block[dofs] = points[nodes]
        self._mesh, self._points = space.mesh, points
        self._dilatation = Dilatation(space, element, by_block)
        self._displacement = _dolfinx.fem.Function(space)
        fields = [self._displacement, *mean_fields(space.mesh, element)]
        self._heat: _dolfinx.fem.Function | None = None
        if any(map(heat_expands, parts.materials)):
            self._heat = _dolfinx.fem.Function(_dolfinx.scalar_space(space.mesh, 1))
            fields.append(self._heat)
        self._energy, self._force, self._tangent = (
            templates[kind, parts.materials, element].bind(
                [space] * number, parts.parameters, fields, mesh=space.mesh, cells=parts.cells
            )
            for number, kind in enumerate(FORMS)
        )
        self._mean = PointDilatation()
        if have_mean_energy(parts.materials):
            self._mean = MeanDilatation(templates, parts, element, fields, self._dilatation)

    def at(self, displacement: np.ndarray, step: MaterialStep = FROM_REST) -> Response:
        """Assemble; see `Mechanics.at`."""
        _dolfinx.update_coordinates(self._mesh, self._points)
        self._displacement.x.array[:] = displacement
        self._set_heat(step.temperature)
        self._mean.follow(displacement)
        force, energy = _dolfinx.assemble_vector(self._force), _dolfinx.assemble_scalar(self._energy)
        tangent = partial(self._stiffness, displacement.copy(), step)
        return Response(force, tangent, energy, float(self.jacobians(displacement).min()))

    def _set_heat(self, temperature: np.ndarray | None) -> None:
        """Set the change of temperature, by input node."""
        if self._heat is None:
            return
        nodes, dofs = _dolfinx.node_dofs(self._heat.function_space)
        self._heat.x.array[dofs] = 0.0 if temperature is None else temperature[nodes]

    def _stiffness(self, displacement: np.ndarray, step: MaterialStep) -> sp.csr_matrix:
        """Return the tangent.

        Pressures that grow with the bulk modulus overshoot within a Newton step, by the square of its
        displacements: the tangent has those that the step foresaw.
        """
        _dolfinx.update_coordinates(self._mesh, self._points)
        self._set_heat(step.temperature)
        if step.origin is None:
            self._mean.follow(displacement)
        else:
            self._displacement.x.array[:] = step.origin
            self._mean.foresee(step.origin, displacement)
        self._displacement.x.array[:] = displacement
        return self._mean.added(assembled(self._tangent, (displacement.size,) * 2))

    def jacobians(self, displacement: np.ndarray) -> np.ndarray:
        """Return det F, and the means of cells; see `Mechanics.jacobians`."""
        return np.concatenate([self._dilatation.at(displacement).ravel(), self._mean.at(displacement)])


def prepare_mechanics(templates: Templates, scene: Scene) -> None:
    """Compile the missing forms of a scene's nonlinear materials. Collective."""
    for body in scene.bodies.values():
        for materials in material_sets(body):
            others = [material for material in materials if not has_history(material)]
            if others and any(map(is_nonlinear, materials)):
                prepare_forms(templates, materials, body.element)


class LinearMechanics:
    """`Mechanics` of linear materials alone: small strains, whatever the displacement."""

    def __init__(self, stiffness: _dolfinx.fem.Form, mesh: _dolfinx.mesh.Mesh, points: np.ndarray) -> None:
        """Assemble."""
        _dolfinx.update_coordinates(mesh, points)
        indptr, indices, data = _dolfinx.assemble_csr(stiffness)
        self._stiffness = sp.csr_matrix((data, indices, indptr), shape=(points.size,) * 2)

    def at(self, displacement: np.ndarray, step: MaterialStep = FROM_REST) -> Response:
        """Return K u and K; see `Mechanics.at`."""
        force = self._stiffness @ displacement
        return Response(force, lambda: self._stiffness, float(force @ displacement) / 2, 1.0)

    def jacobians(self, displacement: np.ndarray) -> np.ndarray:
        """Return 1: in small strain no volume changes."""
        return np.ones(1)


@dataclass(frozen=True, eq=False)
class DependentDofs:
    """`Mechanics` of some dofs by those of others that depend on them.

    `rows`: values of the dofs of `mechanics` by those of the others, a sparse matrix.
    """

    mechanics: Mechanics
    rows: sp.csr_matrix

    def at(self, displacement: np.ndarray, step: MaterialStep = FROM_REST) -> Response:
        """Evaluate the materials and assemble; see `Mechanics.at`."""
        origin = None if step.origin is None else np.asarray(self.rows @ step.origin)
        response = self.mechanics.at(np.asarray(self.rows @ displacement), replace(step, origin=origin))
        forces = replace(response, force=np.asarray(self.rows.T @ response.force))
        return forces.with_matrices(lambda matrix: (self.rows.T @ matrix @ self.rows).tocsr())

    def jacobians(self, displacement: np.ndarray) -> np.ndarray:
        """Return det F at the Gauss points."""
        return self.mechanics.jacobians(np.asarray(self.rows @ displacement))
