"""Bodies of a scene file: meshes, their placement, surfaces, materials."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

import numpy as np
from pydantic import AfterValidator, Field, NonNegativeFloat, PositiveFloat
from scipy.spatial.transform import Rotation

from fenics_contact._base.checks import STEEPEST
from fenics_contact._scene_file.part import Part, built, keys_of, table_of
from fenics_contact._scene_file.source import parts_of
from fenics_contact._scene_file.values import (
    NumberOrPairs,
    Numbers,
    Pair,
    PlaceOfFile,
    Read,
    Triple,
    Vector,
    either,
    is_reference,
    load,
    one_of,
    with_message,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.errors.kinds import scene_file_code
from fenics_contact.gallery import blocks, bolted, hertz
from fenics_contact.gallery import links as links_module
from fenics_contact.gallery import round as whole
from fenics_contact.gallery.links import DesignSurface, Link
from fenics_contact.gallery.ring import LinkShape
from fenics_contact.materials import anisotropic as anisotropic_module
from fenics_contact.materials import (
    elastic,
    foam,
    hyperelastic,
    neo_hookean_metal,
    ramberg_osgood,
    temperature_dependent,
)
from fenics_contact.materials import orthotropic as orthotropic_module
from fenics_contact.materials import plastic as plastic_module
from fenics_contact.materials.elastic import Material
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.quadratic import quadratic
from fenics_contact.readers import cad, dolfinx
from fenics_contact.readers import gmsh as gmsh_module
from fenics_contact.readers import meshio as meshio_module
from fenics_contact.readers.deck_bodies import read_deck_mesh

if TYPE_CHECKING:
    from mpi4py import MPI


FACE_CHOICES = (
    table_of(cad.InBox, faces="in_box"),
    table_of(cad.OnPlane, faces="on_plane"),
    table_of(cad.OnCylinder, faces="on_cylinder"),
)


_LABEL = Annotated[
    str | int,
    with_message("the name or number of a group or face, a list of them, or a table that chooses faces"),
]
_ONE: Any = either(dict, Annotated[Any, one_of("faces", *FACE_CHOICES)], _LABEL)
_SEVERAL = Annotated[list[Annotated[Any, Read(_ONE)]], Field(min_length=1, strict=False)]
_LIST = Annotated[
    list[str | int],
    Field(min_length=1, strict=False),
    with_message("a list of groups, or a table: surface = group, or surface = [groups]"),
]
_OF_SURFACES = dict[str, Annotated[Any, Read(either(list, _SEVERAL, _ONE))]]
#: A list of groups, or surface to group, groups, or tables that choose faces.
SurfaceGroups: TypeAlias = Annotated[Any, Read(either(dict, _OF_SURFACES, _LIST))]


ISOTROPIC: dict[str, Callable[..., Material]] = {
    "isotropic": elastic.IsotropicElasticity,
    "plane_strain": elastic.PlaneStrain,
    "plane_stress": elastic.PlaneStress,
}


class _Material(Part):
    def build(self, folder: Path) -> Material:
        """Return the material."""
        return self.made()


@keys_of(elastic.PlaneStress)
class IsotropicMaterial(_Material):
    """Isotropic elasticity: of bodies in space, or of plane ones in plane strain or plane stress."""

    model: Literal["isotropic", "plane_strain", "plane_stress"] = Field(
        "isotropic", description="isotropic for bodies in space, the others for plane bodies"
    )

    def build(self, folder: Path) -> Material:
        """Return the material."""
        given = {name: getattr(self, name) for name in self.given}
        if self.model == "isotropic" and given.pop("thickness", None) is not None:
            raise InvalidInputError("a thickness is that of plane bodies, this one is in space: leave it out")
        return ISOTROPIC[self.model](**given)

    @classmethod
    def describes(cls, made: object) -> bool:
        """Return whether it is one of the three."""
        return type(made) in ISOTROPIC.values()

    @classmethod
    def written(cls, made: Any) -> dict[str, Any]:
        """Return the table of one of the three."""
        model = next(name for name, kind in ISOTROPIC.items() if kind is type(made))
        return cls.keys({**vars(made), "model": model})


class _WithAxes(_Material):
    axis_1: Triple = Field((1.0, 0.0, 0.0), description="direction of material axis 1, any length")
    axis_2: Triple = Field(
        (0.0, 1.0, 0.0), description="a direction in the plane of the axes 1 and 2, any length"
    )

    def build(self, folder: Path) -> Material:
        """Return the material."""
        return self.made(orientation=orthotropic_module.material_axes(self.axis_1, self.axis_2))

    @classmethod
    def written(cls, made: Any) -> dict[str, Any]:
        """Return the table of the material, with two of its axes."""
        first, second, _ = made.orientation
        return cls.keys({**vars(made), "axis_1": first, "axis_2": second})


@keys_of(orthotropic_module.OrthotropicElasticity, without=["orientation"])
class OrthotropicMaterial(_WithAxes):
    """Orthotropic elasticity in space by nine engineering constants in material axes 1, 2, 3."""

    model: Literal["orthotropic"]


@keys_of(anisotropic_module.AnisotropicElasticity, without=["orientation"])
class AnisotropicMaterial(_WithAxes):
    """Elasticity in space without symmetry, by a stiffness matrix in material axes 1, 2, 3."""

    model: Literal["anisotropic"]


#: Keys of models that are sums of any number of terms.
TERMS: dict[str, Any] = dict.fromkeys(("shear_moduli", "exponents"), Numbers)
MATERIALS = (
    IsotropicMaterial,
    OrthotropicMaterial,
    AnisotropicMaterial,
    table_of(
        orthotropic_module.OrthotropicPlaneStress,
        _Material,
        model="orthotropic_plane_stress",
        poisson_ratio=float,
    ),
    table_of(
        temperature_dependent.TemperatureDependentElasticity,
        _Material,
        model="temperature_dependent",
        young_modulus=NumberOrPairs,
        poisson_ratio=NumberOrPairs,
    ),
    table_of(plastic_module.J2Plasticity, _Material, model="j2_plasticity"),
    table_of(plastic_module.FinitePlasticity, _Material, model="finite_plasticity"),
    table_of(neo_hookean_metal.NeoHookeanPlasticity, _Material, model="neo_hookean_plasticity"),
    table_of(hyperelastic.NeoHooke, _Material, model="neo_hooke"),
    table_of(hyperelastic.StVenantKirchhoff, _Material, model="st_venant_kirchhoff"),
    table_of(hyperelastic.MooneyRivlin, _Material, model="mooney_rivlin"),
    table_of(hyperelastic.Ogden, _Material, model="ogden", **TERMS),
    table_of(foam.Hyperfoam, _Material, model="hyperfoam", poisson_ratios=Numbers, **TERMS),
    table_of(ramberg_osgood.RambergOsgood, _Material, model="ramberg_osgood"),
)


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
        """Return the material; runs the file."""
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
        *MATERIALS,
        default="isotropic",
        other=OwnMaterial,
        when=lambda table: is_reference(table.get("model")),
        called="file.py:Class",
    ),
]


@dataclass(frozen=True, eq=False)
class Shaped:
    """A mesh with its shape.

    `crown`: the smooth surface that a design may move, of chain links.
    """

    mesh: BodyMesh
    crown: DesignSurface | None = None

    def placed(self, rotation: np.ndarray, translation: np.ndarray, scale: float) -> Shaped:
        """Return the shape scaled and rotated about the origin, then moved."""
        mesh = self.mesh.placed(rotation, translation, scale)
        crown = self.crown
        if crown is not None:
            crown = replace(crown, directions=crown.directions @ rotation.T)
        return Shaped(mesh, crown)


class Placed(Part):
    """Keys that every mesh may have."""

    quadratic: bool = Field(False, description="cells of second order")
    scale: PositiveFloat = Field(
        1.0, description="factor on all coordinates, about the origin, applied first"
    )
    axis: Triple = Field(
        (0.0, 0.0, 1.0), description="axis through the origin about which the mesh is turned"
    )
    degrees: float = Field(0.0, description="angle by which the mesh is turned about `axis`, in degrees")
    translate: Vector | None = Field(None, description="displacement of the mesh, applied last, [length]")

    def build(self, folder: Path, comm: MPI.Comm) -> Mapping[str, Shaped]:
        """Return the bodies by the names that `part` takes, "" for the only one. Collective."""
        return {name: self.arranged(shape) for name, shape in self.shapes(folder, comm).items()}

    def shapes(self, folder: Path, comm: MPI.Comm) -> Mapping[str, Shaped]:
        """Return the bodies before placement. Collective."""
        return {"": Shaped(self.made())}

    def arranged(self, shape: Shaped) -> Shaped:
        """Return a shape placed by the keys."""
        if self.quadratic:
            shape = replace(shape, mesh=quadratic(shape.mesh))
        dim = shape.mesh.dim
        move = np.zeros(dim) if self.translate is None else np.array(self.translate)
        if len(move) != dim:
            raise InvalidInputError(f"translate must have {dim} entries like the mesh, got {list(move)}")
        if self.degrees == 0.0 and self.scale == 1.0 and not move.any():
            return shape
        return shape.placed(_rotation(self.axis, self.degrees)[:dim, :dim], move, self.scale)


def _rotation(axis: tuple[float, ...], degrees: float) -> np.ndarray:
    """Return the rotation matrix, (3, 3)."""
    length = float(np.linalg.norm(axis))
    if length == 0.0:
        raise InvalidInputError(f"axis must not be zero, got {list(axis)}: (0, 0, 1) turns about z")
    turn = Rotation.from_rotvec(degrees / length * np.array(axis), degrees=True)
    return np.asarray(np.round(turn.as_matrix(), 15))  # makes quarter turns exact


#: CAD files that only contain data; a .geo file is a program, to be run from Python.
CAD = (".step", ".stp", ".iges", ".igs", ".brep")

_Label = str | int
_Labels = Annotated[list[_Label], Field(min_length=1, strict=False)]
_OfBodies = Annotated[dict[str, _Label | _Labels | dict[str, _Label]], Field(min_length=1)]
BodyGroups: TypeAlias = Annotated[
    Any,
    Read(
        Annotated[
            _Labels | _OfBodies,
            with_message(
                "a list of groups, or a table: body = group, body = [groups], or body = {region = group}, "
                "where a group is a name or a number"
            ),
        ]
    ),
]


class MeshFile(Placed):
    """Bodies and surfaces by name from a file: CAD, .msh, .xdmf, or another format that meshio reads."""

    file: PlaceOfFile = Field(description="the file, relative to the folder of the scene file")
    bodies: BodyGroups | None = Field(
        None, description="groups of cells that are bodies; or body to group, groups or regions (all)"
    )
    surfaces: SurfaceGroups | None = Field(
        None,
        description="groups of facets that are surfaces; or surface to group or groups, of CAD files also to "
        "tables that choose faces (all)",
    )
    size: PositiveFloat | None = Field(
        None, description="largest edge of a cell, for CAD files, which gmsh meshes, [length]"
    )
    sizes: dict[str, PositiveFloat] = Field(
        {}, description="body or surface of a CAD file -> size of the cells there, [length]"
    )
    order: Literal[1, 2] = Field(1, description="order of the cells that CAD files are meshed with")
    labels: str | None = Field(
        None,
        description="not for CAD, .msh and .xdmf: sets, blocks, pieces, or cell data that say which cells "
        "belong together",
    )
    corners_only: bool = Field(
        False, description="drop all nodes but the corners of quadratic cells (not for CAD, .msh and .xdmf)"
    )

    deck: bool = Field(
        False,
        description="read a deck (.inp) as CalculiX and Abaqus do: bodies are elements that share nodes, "
        "sections their regions, with surfaces and node sets",
    )

    def shapes(self, folder: Path, comm: MPI.Comm) -> Mapping[str, Shaped]:
        """Read the file on rank 0. Collective."""
        return {name: Shaped(mesh) for name, mesh in self._read(folder / self.file, comm).items()}

    def _gives(self, *keys: str) -> bool:
        """Return whether any of the keys differs from its default."""
        return any(getattr(self, key) != type(self).model_fields[key].default for key in keys)

    def _read(self, path: Path, comm: MPI.Comm) -> Mapping[str, BodyMesh]:
        kind, groups = path.suffix.lower(), (self.bodies, built(self.surfaces))
        if self.deck:
            if self._gives("bodies", "surfaces", "labels", "size", "sizes", "order", "corners_only"):
                raise InvalidInputError(
                    f"a mesh with deck = true has bodies and surfaces of {self.file!r} alone: omit other keys"
                )
            return read_deck_mesh(path, comm)
        if kind in (*CAD, ".msh", ".xdmf") and self._gives("labels", "corners_only"):
            raise InvalidInputError(
                f"labels and corners_only are for other formats than CAD, .msh and .xdmf, got {self.file!r}"
            )
        if kind in CAD:
            return cad.read_cad(path, self.size, *groups, sizes=self.sizes, order=self.order, comm=comm)
        if any(parts_of(self.surfaces, Part)):
            raise InvalidInputError(
                f"faces are chosen by place in CAD files ({', '.join(CAD)}), got {self.file!r}: choose groups"
            )
        if self._gives("size", "sizes", "order"):
            raise InvalidInputError(
                f"size, sizes and order are for CAD files ({', '.join(CAD)}), got {self.file!r}: leave it out"
            )
        if kind == ".msh":
            return gmsh_module.read_msh(path, *groups, comm=comm)
        if kind == ".xdmf":
            return dolfinx.read_xdmf(path, *groups, comm=comm)
        return meshio_module.read_mesh(
            path, *groups, labels=self.labels, corners_only=self.corners_only, comm=comm
        )


SolidCell: TypeAlias = Literal["hexahedron", "tetrahedron"]
_Grading: TypeAlias = Annotated[float, Field(ge=0, le=STEEPEST)]
_FromTwo: TypeAlias = Annotated[int, Field(ge=2)]


def _plate(
    hole: float,
    half_width: float,
    ends: tuple[float, float],
    heights: tuple[float, float],
    n_layers: int,
    n: int,
    n_radial: int | None = None,
) -> BodyMesh:
    """Mesh half a drilled strip; surfaces bottom, top, hole, x0, x1, y0, y1.

    Args:
        hole: Radius of the hole, [length].
        half_width: The strip reaches from y = 0 to this, [length].
        ends: x of both ends, at or beyond the square around the hole, [length].
        heights: z of bottom and top, [length].
        n_layers: Cells through the thickness, of equal height.
        n: Cells along an eighth of the hole.
        n_radial: Cells from the hole to the square around it; n unless given.
    """
    levels = np.linspace(*heights, n_layers + 1)
    return bolted.drilled_plate(hole, half_width, ends, levels, n, n_radial=n_radial)


class _Links(Placed):
    n_b: _FromTwo
    grading: _Grading
    cell: SolidCell

    def shapes(self, folder: Path, comm: MPI.Comm) -> Mapping[str, Shaped]:
        """Return the links by the names that `part` takes."""
        return {name: Shaped(link.mesh, link.crown) for name, link in self.links_of().items()}

    def links_of(self) -> Mapping[str, Link]:
        """Return the links, a single one unless it is overridden."""
        return {"": links_module.chain_link(self.made())}


@keys_of(LinkShape)
class LinkMesh(_Links):
    """One chain link; surfaces contact (inner side of the contact crown) and grip (of the far crown)."""

    shape: Literal["chain_link"]


@keys_of(LinkShape)
class TwoLinksMesh(_Links):
    """Two interlocked links that touch, parts "first" and "second"; surfaces contact and grip."""

    shape: Literal["two_links"]
    gap: NonNegativeFloat = Field(0.0, description="clearance along the pull axis, [length]")

    def links_of(self) -> Mapping[str, Link]:
        """Return both links."""
        links = links_module.two_links(self.made(), gap=self.gap)
        return {"first": links.first, "second": links.second}


@keys_of(LinkShape)
class ChainMesh(_Links):
    """A straight chain of links, parts "1", "2", ...; contact of each touches grip of the next."""

    shape: Literal["chain"]
    links: Annotated[int, Field(ge=2, le=10_000, description="number of links")]
    gap: NonNegativeFloat = Field(0.0, description="clearance between neighbours, [length]")

    def links_of(self) -> Mapping[str, Link]:
        """Return all links."""
        chain = links_module.chain([self.made()] * self.links, gap=self.gap)
        return {str(number): link for number, link in enumerate(chain.links, 1)}


MESHES = (
    table_of(blocks.block, Placed, shape="block", lower=Triple, upper=Triple, grading=Triple, cell=SolidCell),
    table_of(
        blocks.rectangle,
        Placed,
        shape="rectangle",
        lower=Pair,
        upper=Pair,
        grading=Pair,
        cell=Literal["quadrilateral", "triangle"],
    ),
    table_of(
        hertz.hemisphere,
        Placed,
        shape="hemisphere",
        n=_FromTwo,
        grading=_Grading,
        symmetry=Literal["xy", "x", ""],
    ),
    table_of(
        hertz.half_cylinder,
        Placed,
        shape="half_cylinder",
        n=_FromTwo,
        grading=_Grading,
        symmetry=Literal["x", ""],
    ),
    table_of(
        hertz.half_disc, Placed, shape="half_disc", n=_FromTwo, grading=_Grading, symmetry=Literal["x", ""]
    ),
    table_of(whole.disc, Placed, shape="disc", n=_FromTwo, grading=_Grading),
    table_of(whole.ball, Placed, shape="ball", n=_FromTwo, grading=_Grading),
    table_of(whole.cylinder, Placed, shape="cylinder", n=_FromTwo, grading=_Grading),
    table_of(_plate, Placed, shape="drilled_plate"),
    table_of(bolted.bolt, Placed, shape="bolt"),
    LinkMesh,
    TwoLinksMesh,
    ChainMesh,
)

Mesh: TypeAlias = Annotated[
    Any,
    one_of(
        "shape",
        *MESHES,
        other=MeshFile,
        when=lambda table: "file" in table and "shape" not in table,
    ),
]
