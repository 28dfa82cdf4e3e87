"""A body: a mesh and what it is made of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fenics_contact._base.checks import brief, checked
from fenics_contact._base.display import displayed
from fenics_contact.errors import InvalidInputError
from fenics_contact.errors.kinds import user_code
from fenics_contact.materials.elastic import Material
from fenics_contact.materials.hyperelastic import has_mean_dilatation, is_finite_strain
from fenics_contact.materials.plastic import HistoryMaterial
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.cell_types import CELL_TYPES


@displayed
@dataclass(frozen=True)
@checked("material")
class Body:
    """A mesh and what it is made of.

    Attributes:
        mesh: The mesh.
        material: The material, or one for each of the mesh's regions by name.
    """

    mesh: BodyMesh
    material: Material | Mapping[str, Material]

    def __post_init__(self) -> None:
        """Refuse materials of another dimension and regions without exactly one material."""
        if isinstance(self.material, Mapping):
            _check_regions(self.mesh, self.material)
        for material in self.materials:
            _check_material(material, self.mesh.dim)
            _check_mean_dilatation(material, self.mesh)

    @property
    def materials(self) -> tuple[Material, ...]:
        """The different materials, in the order of the regions."""
        if not isinstance(self.material, Mapping):
            return (self.material,)
        different: list[Material] = []
        for region in self.mesh.regions:
            if self.material[region] not in different:
                different.append(self.material[region])
        return tuple(different)

    @property
    def deforms_much(self) -> bool:
        """Whether one of the materials is made for large deformations, rotations included."""
        return any(map(is_finite_strain, self.materials))

    @property
    def in_words(self) -> str:
        """Its cells and materials in a few words."""
        return f"{self.mesh.cells_in_words} of {', '.join(type(each).__name__ for each in self.materials)}"

    @property
    def material_of_cells(self) -> np.ndarray:
        """Number of each cell's material in `materials`, shape (n_cells,)."""
        number = np.zeros(self.mesh.n_cells, dtype=np.int64)
        if isinstance(self.material, Mapping):
            materials = self.materials
            for region, cells in self.mesh.regions.items():
                number[cells] = materials.index(self.material[region])
        return number


def _check_regions(mesh: BodyMesh, materials: Mapping[str, Material]) -> None:
    if set(materials) != set(mesh.regions):
        raise InvalidInputError(
            f"materials by region must name exactly the regions of the mesh, got {sorted(materials)}, the "
            f"mesh has {sorted(mesh.regions)}: give one material for each, or one for the whole body"
        )


def _check_material(material: Material, dim: int) -> None:
    name = type(material).__name__
    needed = ("dims", "parameters", "stress", "stiffness", "kernel")
    with user_code(f"reading {', '.join(needed)} of material {name}"):
        missing = [part for part in needed if not hasattr(material, part)]
    if missing:
        raise InvalidInputError(
            f"a material must have dims, parameters, stress, stiffness and kernel, {name} lacks {missing}: "
            "derive it from Elasticity or EnergyModel"
        )
    if not isinstance(material.parameters, Sequence | np.ndarray):
        raise InvalidInputError(
            f"parameters of {name} must be a sequence of numbers, got {brief(material.parameters)}: "
            "return a tuple, with a comma behind a single one"
        )
    if dim not in material.dims:
        raise InvalidInputError(
            f"the material must be made for the dimension of the mesh, {name} is for {material.dims} and the "
            f"mesh has {dim}: use PlaneStrain or PlaneStress in the plane, IsotropicElasticity or "
            "OrthotropicElasticity in space"
        )
    try:
        hash(material)
    except TypeError as error:
        raise InvalidInputError(
            f"a material must be hashable, {name} is not ({error}): write it as a frozen dataclass of "
            "numbers and tuples"
        ) from error


def _check_mean_dilatation(material: Material, mesh: BodyMesh) -> None:
    if has_mean_dilatation(material) and isinstance(material, HistoryMaterial) and material.finite:
        raise InvalidInputError(
            f"mean_dilatation of a material with a history needs small strain, {type(material).__name__} is "
            "for large ones: leave it out, and use quadratic cells, fenics_contact.mesh.quadratic"
        )
    if has_mean_dilatation(material) and CELL_TYPES[mesh.cell_type].is_affine:
        cells = CELL_TYPES[mesh.cell_type].plural
        raise InvalidInputError(
            f"mean_dilatation of {type(material).__name__} needs cells in which the volume change varies, "
            f"got a mesh of {cells}, in which it is constant and locks all the same: use hexahedra "
            "(quadrilaterals in the plane) or quadratic cells, fenics_contact.mesh.quadratic"
        )
