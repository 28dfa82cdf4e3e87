"""UFL forms of a scene, each compiled once and bound to every subdomain mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import ufl

from fenics_contact import _dolfinx
from fenics_contact._libraries import MPI
from fenics_contact.errors import together
from fenics_contact.fem.composition import Composition, integrate, material_sets
from fenics_contact.fem.load_forms import Symbol, load_fields, load_key, load_name, load_parameters, load_work
from fenics_contact.fem.mechanics import Mechanics
from fenics_contact.fem.model_checks import check_model, unit_cell_stiffness
from fenics_contact.fem.spread_force import as_tractions
from fenics_contact.fem.templates import (
    LOADED,
    QUADRATURE_DEGREE,
    Template,
    Templates,
    Written,
    scalar_constants,
    surface_measure,
    volume_measure,
)
from fenics_contact.scene import (
    HistoryMaterial,
    Hyperelasticity,
    Load,
    Material,
    Pressure,
    Scene,
    ThermalStrain,
    is_nonlinear,
)

if TYPE_CHECKING:
    from fenics_contact.fem.following_pressure import FollowingPressure

__all__ = [
    "LOADED",
    "QUADRATURE_DEGREE",
    "FormLibrary",
    "Template",
    "Templates",
    "scalar_constants",
    "surface_measure",
    "volume_measure",
]


class FormLibrary:
    """The compiled forms of a scene, by content and cell type."""

    def __init__(self, comm: MPI.Comm) -> None:
        """Start empty; `prepare` fills it."""
        self._comm, self._templates = comm, Templates(comm)
        self._typical_modulus: dict[tuple[Material, str], float] = {}
        self._deformable: set[tuple[Material, str]] = set()

    @property
    def compiled(self) -> tuple[tuple[object, ...], ...]:
        """Names of the forms compiled so far."""
        return self._templates.names

    @property
    def templates(self) -> Templates:
        """The compiled forms, to which upper floors add their own on demand."""
        return self._templates

    def prepare(self, scene: Scene) -> None:
        """Compile the missing forms of a scene. Collective on the library's communicator.

        Raises:
            InvalidInputError: If a material contradicts itself (see `check_model`), or the value of a load
                has the wrong shape.
        """
        for body in scene.bodies.values():
            cell_type = body.mesh.cell_type
            for materials in material_sets(body):
                self._prepare_stiffness(materials, cell_type)
        with together(self._comm):
            for body in scene.bodies.values():
                for material in body.materials:
                    self._check(material, body.mesh.cell_type)
        for load in as_tractions(scene):
            body = scene.bodies[load.body]
            for materials in material_sets(body):
                self._prepare_load(load, materials, body.mesh.cell_type)

    def stiffness(
        self, parts: Composition, cell_type: str, space: _dolfinx.fem.FunctionSpace
    ) -> _dolfinx.fem.Form:
        """Return the bilinear form of the materials ``parts`` bound to ``space``."""
        template = self._templates["stiffness", parts.materials, cell_type]
        return template.bind([space, space], parts.parameters, cells=parts.cells)

    def load(
        self,
        load: Load,
        parts: Composition,
        cell_type: str,
        space: _dolfinx.fem.FunctionSpace,
        points: np.ndarray,
        facets: tuple[np.ndarray, np.ndarray] | None = None,
        acted: np.ndarray | None = None,
    ) -> _dolfinx.fem.Form:
        """Return the linear form of ``load`` bound to ``space``.

        Args:
            load: The load; a resultant must have been spread.
            parts: Materials of the mesh.
            cell_type: Of the mesh.
            space: Displacements on the mesh.
            points: Coordinates by input node of the mesh, shape (n, dim), [length].
            facets: (cells, local facets) on which a surface load acts.
            acted: Marks of the nodes of its surface by input node, shape (n,).
        """
        template = self._templates[load_key(load, parts.materials, cell_type)]
        cells = parts.cells if isinstance(load, ThermalStrain) else None
        functions = load_fields(load, space, points, acted)
        return template.bind([space], load_parameters(load, parts), functions, facets, cells=cells)

    def prepare_mechanics(self, scene: Scene) -> None:
        """Compile the missing forms of nonlinear materials and following pressures of a scene. Collective.

        Raises:
            InvalidInputError: If a hyperelastic model contradicts itself (see `check_hyperelastic`).
        """
        from fenics_contact.fem.following_pressure import prepare_following  # linear scenes go without
        from fenics_contact.fem.hyperelastic import prepare_mechanics
        from fenics_contact.fem.hyperelastic_checks import check_hyperelastic

        prepare_mechanics(self._templates, scene)
        prepare_following(self._templates, scene)
        with together(self._comm):
            for body in scene.bodies.values():
                for material in body.materials:
                    cell_type = body.mesh.cell_type
                    if (
                        isinstance(material, Hyperelasticity)
                        and (material, cell_type) not in self._deformable
                    ):
                        check_hyperelastic(material, cell_type, self._templates)
                        self._deformable.add((material, cell_type))

    def mechanics(
        self, parts: Composition, cell_type: str, space: _dolfinx.fem.FunctionSpace, points: np.ndarray
    ) -> Mechanics:
        """Return forces and tangent of the materials ``parts`` on one mesh of a scene with nonlinear ones.

        Args:
            parts: Materials of the mesh.
            cell_type: Of the mesh.
            space: Displacements on the mesh.
            points: Coordinates by input node, shape (n, dim), [length].
        """
        from fenics_contact.fem.hyperelastic import HyperelasticMechanics
        from fenics_contact.fem.linear_mechanics import LinearMechanics

        if not any(self.varies(material, cell_type) for material in parts.materials):
            points = points - points[0]  # as exact far from the origin as near it
        if not any(map(is_nonlinear, parts.materials)):
            return LinearMechanics(self.stiffness(parts, cell_type, space), space.mesh, points)
        remembering = [isinstance(material, HistoryMaterial) for material in parts.materials]
        others = None
        if not all(remembering):
            others = HyperelasticMechanics(self._templates, parts, cell_type, space, points)
        if others is not None and not any(remembering):
            return others
        from fenics_contact.fem.history_mechanics import HistoryMechanics

        return HistoryMechanics(parts, cell_type, space, points, others)

    def following(
        self,
        load: Pressure,
        cell_type: str,
        space: _dolfinx.fem.FunctionSpace,
        points: np.ndarray,
        facets: tuple[np.ndarray, np.ndarray],
        acted: np.ndarray,
    ) -> FollowingPressure:
        """Return what a pressure that follows its surface adds on one mesh; arguments as for `load`."""
        from fenics_contact.fem.following_pressure import FollowingPressure

        return FollowingPressure(self._templates, load, cell_type, space, points, facets, acted)

    def varies(self, material: Material, cell_type: str) -> bool:
        """Return whether the stiffness of a material depends on position."""
        return self._templates["stiffness", (material,), cell_type].mentions(ufl.geometry.SpatialCoordinate)

    def typical_modulus(self, material: Material, cell_type: str) -> float:
        """Return the mean diagonal entry of the stiffness of a cell of edge length one.

        [force / length²] times [length^(dim − 2)]; a measure of the relative stiffness of materials.
        """
        return self._typical_modulus[material, cell_type]

    def _check(self, material: Material, cell_type: str) -> None:
        if (material, cell_type) in self._typical_modulus:
            return
        parts = Composition((material,))

        def bind(space: _dolfinx.fem.FunctionSpace) -> _dolfinx.fem.Form:
            return self.stiffness(parts, cell_type, space)

        check_model(material, cell_type, bind)
        stiffness = unit_cell_stiffness(cell_type, bind)
        self._typical_modulus[material, cell_type] = float(np.diag(stiffness).mean())

    def _prepare_stiffness(self, materials: tuple[Material, ...], cell_type: str) -> None:
        def write() -> Written:
            V = _dolfinx.displacement_space(cell_type)
            u, v = ufl.TrialFunction(V), ufl.TestFunction(V)
            form, constants = integrate(
                materials, cell_type, lambda m, c: m.stiffness(u, v, c), volume_measure(cell_type)
            )
            return form, constants, ()

        name = ("stiffness", *(type(material) for material in materials), cell_type)
        self._templates.get(("stiffness", materials, cell_type), name, write)

    def _prepare_load(self, load: Load, materials: tuple[Material, ...], cell_type: str) -> None:
        def write() -> Written:
            v = ufl.TestFunction(_dolfinx.displacement_space(cell_type))
            symbol = Symbol(load, cell_type)
            form, constants = load_work(load, materials, cell_type, symbol.expression, v)
            return form, (*symbol.constants, *constants), symbol.coefficients

        self._templates.get(load_key(load, materials, cell_type), load_name(load, cell_type), write)
