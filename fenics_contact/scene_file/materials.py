"""Materials of bodies: those of the package by their constants, and user-defined classes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import AfterValidator, Field, NonNegativeFloat, PositiveFloat

from fenics_contact import scene
from fenics_contact.errors import InvalidInputError, scene_file_code
from fenics_contact.scene import Material
from fenics_contact.scene_file.own_python import is_reference, load
from fenics_contact.scene_file.part import Part, keys_of
from fenics_contact.scene_file.values import Triple, one_of

ISOTROPIC: dict[str, Callable[..., Material]] = {
    "isotropic": scene.IsotropicElasticity,
    "plane_strain": scene.PlaneStrain,
    "plane_stress": scene.PlaneStress,
}


class _Material(Part):
    def build(self, folder: Path) -> Material:
        """Return the material."""
        return self.made()


@keys_of(scene.IsotropicElasticity)
class IsotropicMaterial(_Material):
    """Isotropic elasticity: of bodies in space, or of plane ones in plane strain or plane stress."""

    model: Literal["isotropic", "plane_strain", "plane_stress"] = Field(
        "isotropic", description="isotropic for bodies in space, the others for plane bodies"
    )
    young_modulus: PositiveFloat
    poisson_ratio: Annotated[float, Field(gt=-1, lt=0.5)]

    def build(self, folder: Path) -> Material:
        """Return the material."""
        return ISOTROPIC[self.model](**{name: getattr(self, name) for name in self.given})


@keys_of(scene.OrthotropicElasticity, without=["orientation"])
class OrthotropicMaterial(_Material):
    """Orthotropic elasticity in space by nine engineering constants in material axes 1, 2, 3."""

    model: Literal["orthotropic"]
    axis_1: Triple = Field((1.0, 0.0, 0.0), description="direction of material axis 1, any length")
    axis_2: Triple = Field(
        (0.0, 1.0, 0.0), description="a direction in the plane of the axes 1 and 2, any length"
    )

    def build(self, folder: Path) -> Material:
        """Return the material."""
        return self.made(orientation=scene.material_axes(self.axis_1, self.axis_2))


@keys_of(scene.OrthotropicPlaneStress)
class OrthotropicPlate(_Material):
    """A thin orthotropic plate without stress normal to it, for plane bodies."""

    model: Literal["orthotropic_plane_stress"]
    shear_modulus: PositiveFloat


class _Isotropic(_Material):
    young_modulus: PositiveFloat
    poisson_ratio: Annotated[float, Field(gt=-1, lt=0.5)]


class _VonMisesMetal(_Isotropic):
    yield_stress: PositiveFloat
    saturation_rate: NonNegativeFloat = 0.0


@keys_of(scene.J2Plasticity)
class J2Material(_VonMisesMetal):
    """Elastic-plastic metals in small strain: von Mises' yield function with hardening."""

    model: Literal["j2_plasticity"]
    kinematic_hardening: NonNegativeFloat = 0.0


@keys_of(scene.FinitePlasticity)
class FinitePlasticityMaterial(_VonMisesMetal):
    """Elastic-plastic metals in large deformations: von Mises' yield function with hardening."""

    model: Literal["finite_plasticity"]


@keys_of(scene.NeoHooke)
class NeoHookeMaterial(_Isotropic):
    """Neo-Hookean elasticity for large deformations, in the plane in plane strain."""

    model: Literal["neo_hooke"]


@keys_of(scene.StVenantKirchhoff)
class StVenantKirchhoffMaterial(_Isotropic):
    """Small strains under large rotations, in the plane in plane strain."""

    model: Literal["st_venant_kirchhoff"]


@keys_of(scene.MooneyRivlin)
class MooneyRivlinMaterial(_Material):
    """Rubber under moderate strains, in the plane in plane strain."""

    model: Literal["mooney_rivlin"]
    bulk_modulus: PositiveFloat


@keys_of(scene.Ogden)
class OgdenMaterial(_Material):
    """Rubber under large strains, in the plane in plane strain."""

    model: Literal["ogden"]
    bulk_modulus: PositiveFloat


def _frozen(value: Any) -> Any:
    """Convert lists to tuples: materials are hashable."""
    return tuple(map(_frozen, value)) if isinstance(value, list) else value


class OwnMaterial(Part):
    """A physics model of your own, a class in a Python file."""

    model: str = Field(
        description='"file.py:Class", relative to the folder of the scene file; the file is run',
        pattern=r"^.+\.py:[A-Za-z_]\w*$",
    )
    parameters: dict[str, Annotated[Any, AfterValidator(_frozen)]] = Field(
        default_factory=dict, description="what the class takes, by name"
    )

    def build(self, folder: Path) -> Material:
        """Return the material; runs the file.

        Raises:
            InvalidInputError: If the class does not exist or does not take these parameters.
        """
        kind = load(self.model, folder)
        with scene_file_code(f"{self.model!r} with the parameters {sorted(self.parameters)}"):
            try:
                return kind(**self.parameters)
            except TypeError as error:
                raise InvalidInputError(
                    f"parameters must be what {self.model!r} takes, got {sorted(self.parameters)}: {error}"
                ) from error


AnyMaterial: TypeAlias = Annotated[
    Any,
    one_of(
        "model",
        IsotropicMaterial,
        OrthotropicMaterial,
        OrthotropicPlate,
        J2Material,
        FinitePlasticityMaterial,
        NeoHookeMaterial,
        StVenantKirchhoffMaterial,
        MooneyRivlinMaterial,
        OgdenMaterial,
        default="isotropic",
        other=OwnMaterial,
        when=lambda table: is_reference(table.get("model")),
        called="file.py:Class",
    ),
]
