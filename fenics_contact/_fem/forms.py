"""UFL forms of a scene, each compiled once and bound to every subdomain mesh."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np
import ufl
from ufl.core.expr import Expr

from fenics_contact import _dolfinx
from fenics_contact._base.libraries import MPI
from fenics_contact._fem.composition import Composition, integrate_by_ply, material_sets
from fenics_contact._fem.heated import on_stretched, thermal_split
from fenics_contact._fem.load_forms import (
    FIRST_COUNT,
    Symbol,
    as_stress,
    from_ufl,
    has_work,
    load_fields,
    load_key,
    load_name,
    load_parameters,
    load_work,
)
from fenics_contact._fem.loads import as_tractions
from fenics_contact._fem.model_checks import check_model, unit_cell_stiffness
from fenics_contact._fem.templates import (
    Constants,
    Template,
    Templates,
    Written,
    scalar_constants,
    stiffness_form,
    stiffness_measure,
)
from fenics_contact._kinematics.element import Element
from fenics_contact._scene.fields import Ufl, evaluate
from fenics_contact._scene.loads import InitialStress, Load, Pressure, ThermalStrain
from fenics_contact._scene.scene import Scene
from fenics_contact.errors import together
from fenics_contact.materials.elastic import Material, Transverse, can_expand
from fenics_contact.materials.hyperelastic import Hyperelasticity, is_nonlinear
from fenics_contact.materials.plastic import has_history
from fenics_contact.mesh.quality import cell_volumes

if TYPE_CHECKING:
    from fenics_contact._fem.loads import FollowingPressure
    from fenics_contact._fem.mechanics import Mechanics


class FormLibrary:
    """The compiled forms of a scene, by content and cell type."""

    def __init__(self, comm: MPI.Comm) -> None:
        """Start empty; `prepare` fills it."""
        self._comm, self._templates = comm, Templates(comm)
        self._typical_modulus: dict[tuple[Material, Element], float] = {}
        self._deformable: set[tuple[Material, Element]] = set()

    @property
    def compiled(self) -> tuple[tuple[object, ...], ...]:
        """Names of the forms compiled so far."""
        return self._templates.names

    @property
    def templates(self) -> Templates:
        """The compiled forms, to which upper floors add their own on demand."""
        return self._templates

    def prepare(self, scene: Scene) -> None:
        """Compile the missing forms of a scene. Collective on the library's communicator."""
        for body in scene.bodies.values():
            element = body.element
            for materials in material_sets(body):
                self._prepare_stiffness(materials, element)
        with together(self._comm):
            for body in scene.bodies.values():
                for material in body.materials:
                    self._check(material, body.element)
        for load in as_tractions(scene):
            if load.at_points:
                continue
            body = scene.bodies[load.body]
            for materials in material_sets(body):
                if has_work(load, materials):
                    self._prepare_load(load, materials, body.element)

    def stiffness(
        self, parts: Composition, element: Element, space: _dolfinx.fem.FunctionSpace
    ) -> _dolfinx.fem.Form:
        """Return the bilinear form of the materials ``parts`` bound to ``space``."""
        template = self._templates["stiffness", parts.materials, element]
        return template.bind([space, space], parts.parameters, cells=parts.cells)

    def load(
        self,
        load: Load,
        parts: Composition,
        element: Element,
        space: _dolfinx.fem.FunctionSpace,
        points: np.ndarray,
        facets: tuple[np.ndarray, np.ndarray] | None = None,
        acted: np.ndarray | None = None,
        cells: Mapping[int, np.ndarray] | None = None,
        of_cells: np.ndarray | None = None,
    ) -> _dolfinx.fem.Form:
        """Return the linear form of ``load`` bound to ``space``.

        `acted`: marks of the nodes of its surface by input node; `of_cells`: an initial stress on the cells.
        """
        template = self._templates[load_key(load, parts.materials, element)]
        functions = load_fields(load, space, points, acted, of_cells)
        return template.bind([space], load_parameters(load, parts), functions, facets, cells=cells)

    def prepare_mechanics(self, scene: Scene) -> None:
        """Compile the missing forms of nonlinear materials and following pressures of a scene. Collective."""
        from fenics_contact._fem.loads import prepare_following  # linear scenes go without
        from fenics_contact._fem.mechanics import prepare_mechanics
        from fenics_contact._fem.model_checks import check_deformed

        prepare_mechanics(self._templates, scene)
        prepare_following(self._templates, scene)
        with together(self._comm):
            for body in scene.bodies.values():
                for material in body.materials:
                    element = body.element
                    if isinstance(material, Hyperelasticity) and (material, element) not in self._deformable:
                        check_deformed(material, element, self._templates)
                        self._deformable.add((material, element))

    def mechanics(
        self, parts: Composition, element: Element, space: _dolfinx.fem.FunctionSpace, points: np.ndarray
    ) -> Mechanics:
        """Return forces and tangent of the materials ``parts`` on one mesh of a scene with nonlinear ones."""
        from fenics_contact._fem.mechanics import (
            HistoryMechanics,
            HyperelasticMechanics,
            LinearMechanics,
            MixedMechanics,
        )

        if not any(self.varies(material, element) for material in parts.materials):
            points = points - points[0]  # as exact far from the origin as near it
        if not any(map(is_nonlinear, parts.materials)):
            return LinearMechanics(self.stiffness(parts, element, space), space.mesh, points)
        remembering = [has_history(material) for material in parts.materials]
        if all(remembering):
            return HistoryMechanics(parts, element, space, points)
        others = HyperelasticMechanics(self._templates, parts, element, space, points)
        return MixedMechanics(parts, element, space, points, others) if any(remembering) else others

    def following(
        self,
        load: Pressure,
        element: Element,
        space: _dolfinx.fem.FunctionSpace,
        points: np.ndarray,
        facets: tuple[np.ndarray, np.ndarray],
        acted: np.ndarray,
    ) -> FollowingPressure:
        """Return what a pressure that follows its surface adds on one mesh; arguments as for `load`."""
        from fenics_contact._fem.loads import FollowingPressure

        return FollowingPressure(self._templates, load, element, space, points, facets, acted)

    def varies(self, material: Material, element: Element) -> bool:
        """Return whether the stiffness of a material depends on position."""
        return self._templates["stiffness", (material,), element].mentions(ufl.geometry.SpatialCoordinate)

    def typical_modulus(self, material: Material, element: Element) -> float:
        """Return the mean diagonal entry of the stiffness of a cell of edge length one.

        [force / length²] times [length^(dim − 2)]; a measure of the relative stiffness of materials.
        """
        return self._typical_modulus[material, element]

    def _check(self, material: Material, element: Element) -> None:
        if (material, element) not in self._typical_modulus:
            template = self._templates["stiffness", (material,), element]
            model = _Model(material, element, template.signature, template)
            self._typical_modulus[material, element] = _checked_modulus(model)

    def _prepare_stiffness(self, materials: tuple[Material, ...], element: Element) -> None:
        def write() -> Written:
            V = element.displacements
            u, v = element.in_space(ufl.TrialFunction(V), ufl.TestFunction(V))
            form, constants = integrate_by_ply(
                materials, element, lambda m, c: m.stiffness(u, v, c), stiffness_measure(element)
            )
            return stiffness_form(form, element), constants, ()

        name = ("stiffness", *(type(material) for material in materials), element.name)
        self._templates.get(("stiffness", materials, element), name, write)

    def _prepare_load(self, load: Load, materials: tuple[Material, ...], element: Element) -> None:
        def write() -> Written:
            v = ufl.TestFunction(element.displacements)
            symbol = Symbol(load, element)
            form, constants = load_work(load, materials, element, symbol.expression, v)
            return form, (*symbol.constants, *constants), symbol.coefficients

        self._templates.get(load_key(load, materials, element), load_name(load, element), write)


@dataclass(frozen=True)
class _Model:
    """A material on cells of one type, by what its form is made of."""

    material: Material
    element: Element
    signature: str
    template: Template = field(compare=False)


@lru_cache(maxsize=128)  # scenes of one process mostly have the same materials
def _checked_modulus(model: _Model) -> float:
    """Check a model, and return the mean diagonal entry of the stiffness of a cell of edge length one."""

    def bind(space: _dolfinx.fem.FunctionSpace) -> _dolfinx.fem.Form:
        return model.template.bind([space, space], model.material.parameters)

    check_model(model.material, model.element, bind)
    return float(np.diag(unit_cell_stiffness(model.element, bind)).mean())


def cell_stiffness(scene: Scene, forms: FormLibrary) -> dict[str, np.ndarray]:
    """Return a typical nodal stiffness of every cell of every body, [force / length].

    It is a material's stiffness on a unit cell, times the mean cell size of the body, of one with hanging
    nodes times the size of the cell: within a body of one material and cells of one size it is the same
    everywhere, of one of revolution in proportion to the radius.
    """
    stiffness = {}
    for name, body in scene.bodies.items():
        mesh = body.mesh
        volume = cell_volumes(mesh.points, mesh.cells) if mesh.hanging else mesh.volume / mesh.n_cells
        size = volume ** (1.0 / scene.dim)
        element = body.element
        moduli = np.array([forms.typical_modulus(material, element) for material in body.materials])
        stiffness[name] = moduli[body.material_of_cells] * size ** (scene.dim - 2)
        stiffness[name] *= body.kinematics.typical_size(mesh.points[mesh.cells])
    return stiffness


@dataclass(frozen=True)
class Temperature:
    """The sum of the temperature changes of one body, and of its initial stresses."""

    loads: tuple[ThermalStrain, ...] = ()
    initial: tuple[InitialStress, ...] = ()

    @property
    def key(self) -> tuple[bool, bool, tuple[Ufl, ...], bool]:
        """The key of everything on which a form depends."""
        ufl_values = tuple(load.value for load in self._ufl)
        return bool(self._numbers), bool(self.of_position), ufl_values, bool(self.initial)

    @property
    def numbers(self) -> tuple[float, ...]:
        """Values of the constants: the sum of the uniform changes."""
        return (sum(self._numbers),) if self._numbers else ()

    def write(self, element: Element) -> tuple[AtRest, Constants, tuple[ufl.Coefficient, ...]]:
        """Return ΔT and initial stress (UFL), their constants and their coefficients."""
        constants = scalar_constants(element, 1) if self._numbers else ()
        coefficients: tuple[ufl.Coefficient, ...] = ()
        if self.of_position:
            coefficients = (ufl.Coefficient(element.nodal, count=FIRST_COUNT),)
        terms = [*constants, *coefficients, *(from_ufl(load, load.value, element) for load in self._ufl)]
        change = sum(terms[1:], terms[0]) if terms else None
        if not self.initial:
            return AtRest(change, None, element), constants, coefficients
        stress = ufl.Coefficient(element.cellwise((6,)), count=FIRST_COUNT + 1)
        return AtRest(change, as_stress(stress), element), constants, (*coefficients, stress)

    def fields(
        self, mesh: _dolfinx.mesh.Mesh, points: np.ndarray, stress: np.ndarray | None = None
    ) -> tuple[_dolfinx.fem.Function, ...]:
        """Return the Functions for the coefficients."""
        if self.initial:
            assert stress is not None
            field = _dolfinx.cell_field(mesh, "initial_stress", stress)
            return (*replace(self, initial=()).fields(mesh, points), field)
        if not self.of_position:
            return ()
        space = _dolfinx.scalar_space(mesh, 1)
        nodes, dofs = _dolfinx.node_dofs(space)
        field = _dolfinx.fem.Function(space, name="temperature")
        for load in self.of_position:
            field.x.array[dofs] += evaluate("temperature_change", load.value, points[nodes], ())
        return (field,)

    @property
    def _numbers(self) -> list[float]:
        return [number for load in self.loads for number in load.numbers]

    @property
    def _ufl(self) -> list[Any]:
        return [load for load in self.loads if load.is_ufl]

    @property
    def of_position(self) -> list[Any]:
        """The changes given as functions of position."""
        return [load for load in self.loads if load.is_function]


def temperature_of(loads: Iterable[Load], body: str) -> Temperature:
    """Return the temperature change of a body, and its initial stress."""
    mine = [load for load in loads if load.body == body]
    return Temperature(
        tuple(chain.from_iterable(load.temperatures for load in mine)),
        tuple(chain.from_iterable(load.stresses for load in mine)),
    )


@dataclass(frozen=True)
class AtRest:
    """What stresses a body that does not move."""

    temperature: Expr | None
    stress: Expr | None
    element: Element


def stress_left(material: Any, u: Expr, constants: Constants, at: AtRest) -> Expr:
    """Return the stress (dim x dim, UFL) of a displacement of a body that had some at rest."""
    stress = material.stress(u, constants)
    axes = range(stress.ufl_shape[0])
    if at.temperature is not None and can_expand(material):
        free = material.thermal_stress(constants)
        if free.ufl_shape != stress.ufl_shape:  # of a model for bodies in the plane and in space
            free = ufl.as_tensor([[free[i, j] for j in axes] for i in axes])
        stress = stress - at.temperature * free
    if at.stress is not None:
        stress = stress + ufl.as_matrix([[at.stress[i, j] for j in axes] for i in axes])
    return stress


def stress_in_space(material: Material, u: Expr, constants: Constants, at: AtRest) -> Expr:
    """Return the stress (3 x 3, UFL), in the plane including the component normal to it.

    Where the material is nonlinear it is Cauchy's.
    """
    if isinstance(material, Hyperelasticity):
        if at.temperature is None or not material.expands:
            return material.cauchy(u, constants)
        (moved,) = thermal_split(1 + constants[-1] * at.temperature, u)
        return on_stretched(material.cauchy(moved, constants), at.element)
    stress = stress_left(material, u, constants, at)
    if stress.ufl_shape == (3, 3):
        return stress
    normal: Expr | int = 0
    if isinstance(material, Transverse):
        normal = material.transverse_stress(u, constants)
        if at.temperature is not None and can_expand(material):
            normal = normal - at.temperature * material.transverse_thermal_stress(constants)
    if at.stress is not None:
        normal = normal + at.stress[2, 2]
    rows = [[stress[i, j] for j in range(2)] + [0] for i in range(2)]
    return ufl.as_tensor([*rows, [0, 0, normal]])
