"""What bodies are made of."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Field, PlainValidator, Tag, WithJsonSchema

from fenics_contact import scene
from fenics_contact.errors import InvalidInputError, running
from fenics_contact.scene import Material
from fenics_contact.scene_file.own_python import is_reference, load
from fenics_contact.scene_file.values import Pair, Part, Triple, chooser, needs

_EXPANSION = "thermal expansion α, strain a degree"


class IsotropicMaterial(Part):
    """Isotropic elasticity: of bodies in space, or of plane ones in plane strain or plane stress."""

    model: Literal["isotropic", "plane_strain", "plane_stress"] = Field(
        "isotropic", description="isotropic for bodies in space, the others for plane bodies"
    )
    young_modulus: float = Field(gt=0, description="Young's modulus E, [force / length²]")
    poisson_ratio: float = Field(
        gt=-1, lt=0.5, description="Poisson's ratio ν, between -1 and 0.5, dimensionless"
    )
    thermal_expansion: float | None = Field(None, description=_EXPANSION)

    def build(self, folder: Path) -> Material:
        """Return the material."""
        classes: dict[str, Callable[..., Material]] = {
            "isotropic": scene.IsotropicElasticity,
            "plane_strain": scene.PlaneStrain,
            "plane_stress": scene.PlaneStress,
        }
        return classes[self.model](self.young_modulus, self.poisson_ratio, self.thermal_expansion)


class OrthotropicMaterial(Part):
    """Orthotropic elasticity in space by nine engineering constants in material axes 1, 2, 3."""

    model: Literal["orthotropic"]
    young_moduli: Triple = Field(description="E_1, E_2, E_3, [force / length²]")
    poisson_ratios: Triple = Field(description="ν_12, ν_13, ν_23, dimensionless")
    shear_moduli: Triple = Field(description="G_12, G_13, G_23, [force / length²]")
    axis_1: Triple = Field((1.0, 0.0, 0.0), description="direction of material axis 1, any length")
    axis_2: Triple = Field(
        (0.0, 1.0, 0.0), description="a direction in the plane of the axes 1 and 2, any length"
    )
    thermal_expansion: Triple | None = Field(None, description=f"{_EXPANSION}, along the material axes")

    def build(self, folder: Path) -> Material:
        """Return the material."""
        orientation = scene.material_axes(self.axis_1, self.axis_2)
        return scene.OrthotropicElasticity(
            self.young_moduli, self.poisson_ratios, self.shear_moduli, orientation, self.thermal_expansion
        )


class OrthotropicPlate(Part):
    """A thin orthotropic plate without stress normal to it, for plane bodies."""

    model: Literal["orthotropic_plane_stress"]
    young_moduli: Pair = Field(description="E_1, E_2, [force / length²]")
    poisson_ratio: float = Field(description="ν_12, dimensionless")
    shear_modulus: float = Field(gt=0, description="G_12, [force / length²]")
    angle: float = Field(0.0, description="from the x-axis to material axis 1, counterclockwise, in radians")
    thermal_expansion: Pair | None = Field(None, description=f"{_EXPANSION}, along the material axes")

    def build(self, folder: Path) -> Material:
        """Return the material."""
        return scene.OrthotropicPlaneStress(
            self.young_moduli, self.poisson_ratio, self.shear_modulus, self.angle, self.thermal_expansion
        )


def _parameters(value: Any) -> dict[str, Any]:
    """Check arguments of a class, lists become tuples: materials are hashable."""
    if not isinstance(value, Mapping):
        raise needs("a table of what the class takes")
    return {name: _frozen(entry) for name, entry in value.items()}


def _frozen(value: Any) -> Any:
    return tuple(map(_frozen, value)) if isinstance(value, list) else value


_TABLE = WithJsonSchema({"type": "object"})


class OwnMaterial(Part):
    """A physics model of your own, a class in a Python file."""

    model: str = Field(
        description='"file.py:Class", relative to the folder of the scene file; the file is run',
        pattern=r"^.+\.py:[A-Za-z_]\w*$",
    )
    parameters: Annotated[dict[str, Any], PlainValidator(_parameters), _TABLE] = Field(
        default_factory=dict, description="what the class takes, by name"
    )

    def build(self, folder: Path) -> Material:
        """Return the material; runs the file.

        Raises:
            InvalidInputError: If the class is not there or does not take these parameters.
        """
        kind = load(self.model, folder)
        with running(f"{self.model!r} with the parameters {sorted(self.parameters)}"):
            try:
                material: Material = kind(**self.parameters)
            except TypeError as error:
                raise InvalidInputError(
                    f"parameters must be what {self.model!r} takes, got {sorted(self.parameters)}: {error}"
                ) from error
        return material


MODELS = ("isotropic", "plane_strain", "plane_stress", "orthotropic", "orthotropic_plane_stress")


def _tag(value: Any) -> str | None:
    model = value.get("model", "isotropic") if isinstance(value, Mapping) else getattr(value, "model", None)
    if is_reference(model):
        return "<python>"
    return {name: "<isotropic>" for name in MODELS[:3]}.get(
        str(model), f"<{model}>" if model in MODELS else None
    )  # type: ignore[call-overload,no-any-return]


AnyMaterial: TypeAlias = Annotated[
    Annotated[IsotropicMaterial, Tag("<isotropic>")]
    | Annotated[OrthotropicMaterial, Tag("<orthotropic>")]
    | Annotated[OrthotropicPlate, Tag("<orthotropic_plane_stress>")]
    | Annotated[OwnMaterial, Tag("<python>")],
    chooser(_tag, "model", (*MODELS, "file.py:Class")),
]
