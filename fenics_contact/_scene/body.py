"""A body: a mesh and what it is made of."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from inspect import signature
from typing import Any, Literal, TypeAlias, cast

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.checks import GivenVector, brief, checked
from fenics_contact._base.display import counted, displayed
from fenics_contact._kinematics.base import Kinematics
from fenics_contact._kinematics.element import Element
from fenics_contact._kinematics.integration import (
    ALONG_ROWS,
    AT_SECTIONS,
    FULL,
    OF_PRISMS,
    REDUCED,
    STABILISED,
    Integration,
)
from fenics_contact._kinematics.revolution import Revolution
from fenics_contact._kinematics.torsion import Torsion
from fenics_contact._scene.effects import EffectName
from fenics_contact.errors import InvalidInputError
from fenics_contact.errors.kinds import user_code
from fenics_contact.materials.elastic import Material, thickness_of
from fenics_contact.materials.hyperelastic import has_mean_dilatation, is_finite_strain, is_nonlinear
from fenics_contact.materials.plastic import has_history
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.cell_types import CELL_TYPES
from fenics_contact.mesh.collapsed import has_collapsed, shapes_in
from fenics_contact.mesh.faces import computed_rounding
from fenics_contact.mesh.one_layer import touches_in_one_layer, two_wide

#: Returns motions of points, (n, dim) -> (n, dim, n_modes).
Modes: TypeAlias = Callable[[np.ndarray], np.ndarray]


@displayed
@dataclass(frozen=True)
@checked("material")
class Body:
    """A mesh and what it is made of.

    Attributes:
        mesh: The mesh.
        material: The material, or one for each of the mesh's regions by name.
        axisymmetric: Whether the plane mesh is half the section of a body of revolution, with the radius
            r ≥ 0 as first coordinate and the height z along the axis as second. Its materials are those of
            space, with the axes r, z and around the circumference as x, y and z. Loads, forces, areas and
            energies are those of a full revolution; on the axis the radial displacement is zero.
        torsion: Whether a body of revolution may also twist: its displacement has a third component u_θ
            around the axis, alike all around, and its strain ε_rθ = ½ (∂u_θ/∂r − u_θ/r) and ε_zθ = ½ ∂u_θ/∂z.
            On the axis u_θ is zero. Right-handed turns about the axis are positive.
        integration: "full", or "reduced": the volume integrals of hexahedra of 20 and quadrilaterals of 8
            nodes by 2 points in each direction instead of 3, those of other programs' C3D20R, CPE8R, CPS8R
            and CAX8R. They lock less in bending and near incompressibility, and deform in ways that cost no
            energy where a cell shares no face with another one: two cells in each direction are safe.
            "stabilised": the same with one thousandth of "full", for rows of single cells; "reduced" is that,
            too, where contact or a tie acts on one layer of cells. "rows": by 2 points along the first
            direction of the cells alone, from their first to their second node, for beams of single cells. Of
            prisms alone "reduced" is 9 points, of linear ones 2, as C3D15 and C3D6 have, unless materials
            have a history or depend on the mean dilatation. Bodies of prisms and others, of pyramids or
            triangles are integrated in full.

    Example:
        >>> from fenics_contact.gallery import rectangle
        >>> from fenics_contact.materials import IsotropicElasticity
        >>> half_section = rectangle((20.0, 0.0), (40.0, 10.0), (8, 4))  # mm
        >>> ring = Body(half_section, IsotropicElasticity(2.1e5, 0.3), axisymmetric=True)
    """

    effect = EffectName.ELASTICITY
    #: Whether it moves as one piece.
    is_rigid = False
    mesh: BodyMesh
    material: Material | Mapping[str, Material]
    axisymmetric: bool = False
    torsion: bool = False
    integration: Literal["full", "reduced", "stabilised", "rows"] = "full"

    def __post_init__(self) -> None:
        """Refuse materials of another dimension and regions without exactly one material."""
        _check_integration(self.mesh, self.integration)
        if self.torsion and not self.axisymmetric:
            raise InvalidInputError(
                "torsion=True needs a body of revolution: give axisymmetric=True, too, or leave torsion out"
            )
        if self.axisymmetric:
            _check_half_section(self.mesh)
        if self._by_region:
            _check_regions(self.mesh, self._by_region)
        for material in self.materials:
            _check_material(material, self.kinematics)
        known = [thickness_of(each) for each in self.materials]
        if self.has_thickness and None in known:
            raise InvalidInputError(
                f"all materials of a body must have a thickness or none, got {known}: give it to the others"
            )
        for material in self.materials:
            if self.axisymmetric and not self.torsion:
                _check_symmetric_axes(material)
            _check_mean_dilatation(material, self.mesh)

    @property
    def materials(self) -> tuple[Material, ...]:
        """The different materials, in the order of the regions."""
        if not self._by_region:
            return (cast("Material", self.material),)
        different: list[Material] = []
        for region in self.mesh.regions:
            if self._by_region[region] not in different:
                different.append(self._by_region[region])
        return tuple(different)

    @property
    def _by_region(self) -> Mapping[str, Material]:
        """The material of each region, empty if there is one for all."""
        return self.material if isinstance(self.material, Mapping) else {}

    @property
    def kinematics(self) -> Kinematics:
        """What its displacement consists of, and how areas and volumes are measured."""
        if self.torsion:
            return Torsion()
        return Revolution() if self.axisymmetric else Kinematics(self.mesh.dim)

    @property
    def element(self) -> Element:
        """The finite element for which its forms are written."""
        return Element(self.mesh.cell_type, self.kinematics, self._integration)

    def without_single_rows(self, partition: np.ndarray) -> np.ndarray:
        """Return a partition whose subdomains are two cells wide, where reduced integration needs that."""
        rows = self.integration == "reduced" and not self._is_of_prisms
        return two_wide(self.mesh, partition) if rows else partition

    @property
    def _is_of_prisms(self) -> bool:
        """Whether it consists of prisms, of a body with reduced integration."""
        return has_collapsed(self.mesh.cells[:1], self.mesh.dim)

    @property
    def _integration(self) -> Integration:
        if self.integration == "full":
            return FULL
        if self.integration == "rows":
            return ALONG_ROWS
        if self._is_of_prisms:
            whole = any(has_history(each) or has_mean_dilatation(each) for each in self.materials)
            return FULL if whole else OF_PRISMS
        if self.integration == "stabilised" or touches_in_one_layer(self.mesh):
            return STABILISED
        return AT_SECTIONS if self.mesh.cuts else REDUCED

    @property
    def components(self) -> int:
        """Number of components of its displacement."""
        return self.kinematics.components

    @property
    def motions(self) -> int:
        """Number of its rigid motions."""
        return self.kinematics.motions

    @property
    def on_axis(self) -> np.ndarray:
        """Which nodes of a body of revolution lie on its axis, shape (n_nodes,); none of others."""
        return self.kinematics.on_axis(self.mesh.points)

    def rigid_modes(self, at: np.ndarray | None = None) -> np.ndarray:
        """Return its rigid motions at its nodes or elsewhere, see `rigid_body_modes`."""
        return self.kinematics.rigid_modes(self.mesh.points, at)

    @property
    def springs(self) -> GivenVector:
        """Stiffness of springs that hold it as one piece, along and around the axes; none of elastic ones."""
        return ()

    def sprung(self, matrix: sp.csr_matrix, points: np.ndarray) -> sp.csr_matrix:
        """Return a stiffness matrix of its nodes at points with that of its springs."""
        return matrix

    def sprung_modes(self, points: np.ndarray) -> np.ndarray:
        """Return its motions that its springs alone resist, (n, dim, n_modes): it has none."""
        return np.zeros((len(points), self.components, 0))

    def kernel(self, points: np.ndarray, elastic: Modes) -> np.ndarray:
        """Return its motions without energy at points, (n, dim, n_modes): those of its materials."""
        return elastic(points)

    @property
    def volume(self) -> float:
        """Its volume, of a plane body the area, [length³] or [length²]."""
        return self.volume_of()

    def volume_of(self, region: str = "") -> float:
        """Return the volume of a region of its mesh, by default of all of it, see `volume`."""
        cells = self.mesh.cells[self.mesh.regions[region]] if region else self.mesh.cells
        return self.kinematics.volume(self.mesh, cells)

    @property
    def has_thickness(self) -> bool:
        """Whether its materials have a thickness, of a plane body: forces are then those of all of it."""
        return any(thickness_of(material) is not None for material in self.materials)

    @property
    def thickness_of_cells(self) -> np.ndarray:
        """Thickness of each cell of a plane body with one, [length], else ones; shape (n_cells,)."""
        by_material = np.array([thickness_of(material) or 1.0 for material in self.materials])
        return np.asarray(by_material[self.material_of_cells])

    @property
    def deforms_much(self) -> bool:
        """Whether one of the materials is made for large deformations, rotations included."""
        return any(map(is_finite_strain, self.materials))

    @property
    def effects(self) -> tuple[EffectName, ...]:
        """The physical effects that it calls for."""
        more = {
            EffectName.AXISYMMETRY: self.axisymmetric,
            EffectName.TORSION: self.torsion,
            EffectName.NONLINEAR_MATERIAL: any(map(is_nonlinear, self.materials)),
        }
        return self.effect, *(name for name, given in more.items() if given)

    @property
    def in_words(self) -> str:
        """Its cells and materials in a few words."""
        materials = ", ".join(type(each).__name__ for each in self.materials)
        return f"{self.mesh.cells_in_words} of {materials}{self.kinematics.in_words}"

    @cached_property
    def material_of_cells(self) -> np.ndarray:
        """Number of each cell's material in `materials`, shape (n_cells,)."""
        number = np.zeros(self.mesh.n_cells, dtype=np.int64)
        materials = self.materials
        for region, material in self._by_region.items():
            number[self.mesh.regions[region]] = materials.index(material)
        number.setflags(write=False)
        return number


def _check_regions(mesh: BodyMesh, materials: Mapping[str, Material]) -> None:
    if set(materials) != set(mesh.regions):
        raise InvalidInputError(
            f"materials by region must name exactly the regions of the mesh, got {sorted(materials)}, the "
            f"mesh has {sorted(mesh.regions)}: give one material for each, or one for the whole body"
        )


def _check_integration(mesh: BodyMesh, integration: str) -> None:
    words = "reduced integration needs hexahedra of 20 or quadrilaterals of 8 nodes"
    if integration == "reduced" and set(shapes_in(mesh.cells, mesh.dim)) == {"prism"}:
        return
    if integration != "full" and not mesh.centres:
        raise InvalidInputError(
            f"{words}, got {mesh.cells_in_words}, which deform without energy by it: leave it out, or take "
            "serendipity(mesh)"
        )
    if integration != "full" and has_collapsed(mesh.cells, mesh.dim):
        raise InvalidInputError(
            f"{words} alone, as in other cells it depends on the order of nodes, got {mesh.cells_in_words}: "
            "leave it out, or make the others a body of their own and glue it on"
        )


def _check_half_section(mesh: BodyMesh) -> None:
    if mesh.dim != 2:
        raise InvalidInputError(
            "axisymmetric=True needs a plane mesh, half the section with the coordinates r and z, got one in "
            f"{mesh.dim} dimensions: give the section, or leave axisymmetric out"
        )
    left = mesh.points[:, 0] < -computed_rounding(mesh.points)
    if left.any():
        raise InvalidInputError(
            f"radii must not be negative, {counted(int(left.sum()), 'node lies', 'nodes lie')} left of the "
            f"axis, down to {mesh.points[:, 0].min():.3g}: give the half of the section right of it, r ≥ 0"
        )


def _needed(material: type) -> list[str]:
    """Return the names of what the class of a material must be given."""
    return [each.name for each in signature(material).parameters.values() if each.default is each.empty]


def _check_material(material: Material, kinematics: Kinematics) -> None:
    if isinstance(material, type):
        raise InvalidInputError(
            f"a material must have its constants, got the class {material.__name__}: write "
            f"{material.__name__}({', '.join(_needed(material))})"
        )
    name = type(material).__name__
    needed = ("dims", "parameters", "stress", "stiffness", "kernel")
    with user_code(f"reading {', '.join(needed)} of material {name}"):
        missing = [part for part in needed if not hasattr(material, part)]
    if missing:
        raise InvalidInputError(
            f"a material must have {', '.join(needed)}, {name} lacks {missing}: "
            "derive it from Elasticity or EnergyModel"
        )
    if not isinstance(material.parameters, Sequence | np.ndarray):
        raise InvalidInputError(
            f"parameters of {name} must be a sequence of numbers, got {brief(material.parameters)}: return a "
            "tuple, with a comma behind a single one"
        )
    if kinematics.material_dim not in material.dims:
        raise InvalidInputError(kinematics.needed_material.format(name=name, dims=material.dims))
    try:
        hash(material)
    except TypeError as error:
        raise InvalidInputError(
            f"{name} must be hashable ({error}): write it as a frozen dataclass of numbers and tuples"
        ) from error


def _check_symmetric_axes(material: Material, rounding: float = 1e-9) -> None:
    """Refuse stiffness that would twist a body: shear around the circumference under other strains."""
    stiffness: Any = getattr(material, "stiffness_matrix", None)
    if np.shape(stiffness) == (6, 6):
        coupling = np.abs(stiffness[np.ix_([0, 1, 2, 5], [3, 4])]).max()
        if coupling > rounding * np.abs(stiffness).max():
            raise InvalidInputError(
                f"a body of revolution cannot twist, but axes of {type(material).__name__} are inclined to "
                "the circumference, its third axis: let one point along it, or give the body torsion=True"
            )


def _check_mean_dilatation(material: Material, mesh: BodyMesh) -> None:
    if has_mean_dilatation(material) and has_history(material) and material.finite:
        raise InvalidInputError(
            f"mean_dilatation of a material with a history needs small strain, {type(material).__name__} is "
            "for large ones: leave it out, and use quadratic cells, fenics_contact.mesh.quadratic"
        )
    if has_mean_dilatation(material) and CELL_TYPES[mesh.cell_type].is_affine:
        cells = CELL_TYPES[mesh.cell_type].plural
        raise InvalidInputError(
            f"mean_dilatation of {type(material).__name__} needs cells in which the volume change varies, "
            f"got {cells}, which lock: use hexahedra, quadrilaterals or fenics_contact.mesh.quadratic"
        )
