"""Bodies from CAD files: which faces are which surfaces, meshes by gmsh, true shapes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from fenics_contact._base.checks import (
    check_numbers,
    checked,
    floats,
    naming_arguments,
    require_file,
    unit_vector,
)
from fenics_contact._base.display import displayed
from fenics_contact._base.progress import Task
from fenics_contact.errors import InvalidInputError
from fenics_contact.errors.ranks import on_root_then_bcast
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.readers.bodies import Label, by_name, listed
from fenics_contact.readers.cad_shapes import shape_seen
from fenics_contact.readers.gmsh import Bodies, from_gmsh_model
from fenics_contact.readers.gmsh_session import import_gmsh, lasting_session, physical_groups, reading_process
from fenics_contact.shapes.simple import Circle, Cylinder, Plane, Sphere, SurfaceShape, Torus

if TYPE_CHECKING:
    from mpi4py import MPI


#: Names of kinds of faces (dimension 2) and of curves (1).
_KINDS: dict[type, dict[int, str]] = {
    Plane: {2: "plane", 1: "line"},
    Cylinder: {2: "cylinder"},
    Sphere: {2: "sphere"},
    Circle: {1: "circle"},
    Torus: {2: "torus"},
}


@displayed
@dataclass(frozen=True, eq=False)
class CadFace:
    """A face of a CAD model, of a plane part a curve.

    Attributes:
        number: Its number in gmsh.
        name: Its name in the file, without a name its number as text.
        kind: "plane", "cylinder", "sphere", "torus", of a plane part "line" or "circle", else gmsh's word for
            its surface.
        area: Area, of a curve the length; NaN if another kernel than Open CASCADE built it.
        centroid: Centre of mass, NaN likewise, (3,), [length].
        lower: Least coordinates, (3,), [length].
        upper: Largest coordinates, (3,), [length].
        shape: Its true shape if it is one of those kinds; the side of the body is not known.
        near: Distance up to which places on the model count as the same, [length].
    """

    number: int
    name: str
    kind: str
    area: float
    centroid: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    shape: SurfaceShape | None
    near: float

    @property
    def radius(self) -> float | None:
        """Radius of a cylinder, sphere or circle."""
        return self.shape.radius if isinstance(self.shape, Cylinder | Sphere) else None

    @property
    def in_words(self) -> str:
        """One line: ``7 'bore' (cylinder, radius 2, area 62.83, centroid (5, 10, 2.5))``."""
        facts = [self.kind]
        if self.radius is not None:
            facts.append(f"radius {self.radius:.6g}")
        if np.isfinite(self.area):
            place = ", ".join(f"{x:.4g}" for x in np.round(self.centroid, 9) + 0.0)
            facts.append(f"area {self.area:.4g}, centroid ({place})")
        name = "" if self.name == str(self.number) else f" {self.name!r}"
        return f"{self.number}{name} ({', '.join(facts)})"


def faces_of(gmsh: ModuleType, dim: int) -> list[CadFace]:
    """Return the faces (dimension 2), of a plane part the curves (1), of gmsh's current model."""
    box = np.array(gmsh.model.getBoundingBox(-1, -1))
    near = 1e-6 * float(np.linalg.norm(box[3:] - box[:3]))
    return [_face(gmsh, (dim, int(tag)), near) for _, tag in gmsh.model.getEntities(dim)]


def name_of(gmsh: ModuleType, dim: int, tag: int) -> str:
    """Return the name of an entity in its file, else its number as text."""
    name = str(gmsh.model.getEntityName(dim, tag)).rpartition("/")[2]
    # The library that writes STEP files calls everything "Open CASCADE ...".
    return str(tag) if not name or name.startswith("Open CASCADE") else name


def _face(gmsh: ModuleType, entity: tuple[int, int], near: float) -> CadFace:
    shape = shape_seen(gmsh, entity)
    try:
        area, centroid = gmsh.model.occ.getMass(*entity), gmsh.model.occ.getCenterOfMass(*entity)
    except Exception:  # gmsh raises no other class; entities of its own kernel have no mass
        area, centroid = np.nan, (np.nan,) * 3
    box = np.array(gmsh.model.getBoundingBox(*entity))
    kind = _KINDS.get(type(shape), {}).get(entity[0], gmsh.model.getType(*entity).lower())
    name = name_of(gmsh, *entity)
    return CadFace(entity[1], name, kind, float(area), np.array(centroid), box[:3], box[3:], shape, near)


Vector: TypeAlias = tuple[float, float, float]
#: Largest sine of the angle between directions that count as parallel.
_PARALLEL = 1e-6


@displayed
@dataclass(frozen=True)
@checked()
class InBox:
    """Chooses the faces that lie wholly in a box along the axes.

    Attributes:
        lower: Least coordinates, [length].
        upper: Largest coordinates, [length].
    """

    lower: Vector
    upper: Vector

    def __call__(self, face: CadFace) -> bool:
        """Return whether the face is chosen."""
        above = face.lower >= np.array(self.lower) - face.near
        below = face.upper <= np.array(self.upper) + face.near
        return bool((above & below).all())

    @property
    def in_words(self) -> str:
        """Where the faces are."""
        return f"wholly in the box from {self.lower} to {self.upper}"


@displayed
@dataclass(frozen=True)
@checked()
class OnPlane:
    """Chooses the plane faces that lie in a plane; of a plane part, the straight edges on a line.

    Attributes:
        point: A point of the plane, [length].
        normal: Its normal, to either side; scaled to unit length.
    """

    point: Vector
    normal: Vector

    def __post_init__(self) -> None:
        """Scale the normal; reject a zero one."""
        object.__setattr__(self, "normal", unit_vector("OnPlane.normal", self.normal, 3))

    def __call__(self, face: CadFace) -> bool:
        """Return whether the face is chosen."""
        shape = face.shape
        if not isinstance(shape, Plane):
            return False
        normal, point = np.array(self.normal)[: shape.dim], np.array([self.point])[:, : shape.dim]
        aside = np.linalg.norm(normal - (normal @ shape.normal) * np.array(shape.normal))
        return bool(aside < _PARALLEL and abs(shape.distance(point)[0]) < face.near)

    @property
    def in_words(self) -> str:
        """Where the faces are."""
        return f"on the plane through {self.point} with the normal {self.normal}"


@displayed
@dataclass(frozen=True)
@checked()
class OnCylinder:
    """Chooses the faces on a cylinder, of holes and of pins; of a plane part, the arcs of a circle.

    Attributes:
        radius: Its radius, [length].
        axis: Direction of its axis, to either side; any unless given.
        point: A point of its axis, [length]; anywhere unless given.
    """

    radius: float
    axis: Vector | None = None
    point: Vector | None = None

    def __post_init__(self) -> None:
        """Scale the axis; reject a zero one."""
        if self.axis is not None:
            object.__setattr__(self, "axis", unit_vector("OnCylinder.axis", self.axis, 3))

    def __call__(self, face: CadFace) -> bool:
        """Return whether the face is chosen."""
        shape = face.shape
        if isinstance(shape, Cylinder):
            axis, centre = np.array(shape.axis), np.array(shape.point)
        elif isinstance(shape, Sphere) and shape.dim == 2:
            axis, centre = np.array([0.0, 0.0, 1.0]), np.array([*shape.centre, 0.0])
        else:
            return False
        wanted = np.array(axis if self.axis is None else self.axis)
        away = np.array(centre if self.point is None else self.point) - centre
        return bool(
            abs(shape.radius - self.radius) < face.near
            and np.linalg.norm(np.cross(axis, wanted)) < _PARALLEL
            and np.linalg.norm(np.cross(away, axis)) < face.near
        )

    @property
    def in_words(self) -> str:
        """Where the faces are."""
        axis = [f" {word} {at}" for word, at in (("along", self.axis), ("through", self.point)) if at]
        return f"on a cylinder of radius {self.radius:g}{' about the axis' * bool(axis)}{''.join(axis)}"


Chosen: TypeAlias = Label | InBox | OnPlane | OnCylinder | Callable[[CadFace], bool]
"""Name or number of a face or of a group of the file, or what says of a face whether it is chosen."""
FaceChoice: TypeAlias = Sequence[Label] | Mapping[str, Chosen | Sequence[Chosen]]
"""Names or numbers, or surface to what is chosen of the faces for it."""


def chosen_faces(
    faces: Sequence[CadFace], groups: Mapping[Label, Sequence[int]], surfaces: Any, source: str
) -> dict[str, list[int]]:
    """Resolve the caller's choice of surfaces."""
    known = {str(face.number): [face.number] for face in faces} | {str(k): list(v) for k, v in groups.items()}
    found: dict[str, list[int]] = {}
    owner: dict[int, str] = {}
    for name, wanted in by_name(surfaces).items():
        several = [wanted] if callable(wanted) else listed(wanted)
        found[name] = sorted({n for each in several for n in _found(each, name, faces, known, source)})
        for number in found[name]:
            if (other := owner.setdefault(number, name)) != name:
                raise InvalidInputError(
                    f"face {number} of {source} cannot be of {other!r} and {name!r}: {_listed(faces)}"
                )
    return found


def _found(
    wanted: Chosen, name: str, faces: Sequence[CadFace], known: Mapping[str, list[int]], source: str
) -> list[int]:
    found = [f.number for f in faces if wanted(f)] if callable(wanted) else known.get(str(wanted), [])
    if not found:
        raise InvalidInputError(
            f"surface {name!r} must have a face, none of {source} is {_in_words(wanted)}: {_listed(faces)}"
        )
    return found


def _in_words(wanted: Chosen) -> str:
    if callable(wanted):
        return str(getattr(wanted, "in_words", "chosen by its function"))
    return f"called {wanted!r}"


def _listed(faces: Sequence[CadFace], most: int = 60) -> str:
    """Return all faces in words; of very many the first."""
    more = f"; and {len(faces) - most} more" if len(faces) > most else ""
    return "it has " + "; ".join(face.in_words for face in faces[:most]) + more


#: Formats that gmsh reads as geometry.
SUFFIXES = (".step", ".stp", ".iges", ".igs", ".brep", ".geo", ".geo_unrolled")


@naming_arguments
def read_cad(
    path: str | Path,
    size: float | None = None,
    bodies: Bodies | None = None,
    surfaces: FaceChoice | None = None,
    *,
    sizes: Mapping[str, float] | None = None,
    order: int = 1,
    comm: MPI.Comm | None = None,
) -> dict[str, BodyMesh]:
    """Read a CAD file, mesh it with gmsh, and return its bodies with the true shapes of their surfaces.

    Physical groups of a .geo file define bodies and surfaces, as in `from_gmsh_model`. Without groups, every
    volume (of a plane part: every surface) is a body and every surface (curve) a surface of it, named as in a
    STEP file, else by their numbers in gmsh, as text.

    Args:
        path: A file .step, .stp, .iges, .igs, .brep, .geo or .geo_unrolled; .geo is a script: gmsh runs it.
        size: Largest edge of a cell wherever ``sizes`` says nothing else, [length]; that of the file unless
            given.
        bodies: As in `read_msh`.
        surfaces: The wanted surfaces: names or numbers of faces, or name of the surface to what chooses its
            faces: a name, a number, `InBox`, `OnPlane`, `OnCylinder`, a function that says of a `CadFace`
            whether it is one, or several of these. Every face unless given.
        sizes: Name of a body or a surface to the size of the cells in it, [length]; of several names that
            share an edge the smallest counts there. Cells grow from the edges of what is finer into the rest.
        order: 1 for linear cells, 2 for quadratic ones, curved like the surfaces.
        comm: If given, rank 0 reads the file and all ranks receive the bodies.

    Returns:
        Name to body, with `BodyMesh.shapes`. Whatever unit a STEP or IGES file names, its coordinates come in
        millimetres; `BodyMesh.placed` scales them to another unit. Other files name no unit.

    Raises:
        InvalidInputError: As `read_msh`, or if gmsh cannot read or mesh the file, a size is not positive or
            of something that does not exist, nothing is chosen for a surface, or a face for two; the latter
            list all faces.
        MissingRequirementError: If gmsh is missing, too old or cannot be loaded.

    Note:
        Collective on ``comm`` if given.

    Example:
        ``read_cad("bracket.step", 2.0, surfaces={"foot": [4, 7], "hole": OnCylinder(5.0)})`` makes bodies of
        tetrahedra of at most 2 mm. Faces 4 and 7 are the surface "foot"; all on cylinders of radius 5 mm the
        surface "hole", whose shape is a `Cylinder`. With ``sizes={"hole": 0.5}`` cells along the hole have
        0.5 mm.
    """
    return on_root_then_bcast(comm, lambda: _read(Path(path), size, sizes or {}, order, bodies, surfaces))


def _read(
    path: Path,
    size: float | None,
    sizes: Mapping[str, float],
    order: int,
    bodies: Bodies | None,
    surfaces: FaceChoice | None,
) -> dict[str, BodyMesh]:
    require_file(path)
    if path.suffix.lower() not in SUFFIXES:
        raise InvalidInputError(
            f"file '{path}' must be a CAD file, {', '.join(SUFFIXES)}: read a mesh with `read_msh`"
        )
    for name, given in {"": size, **sizes}.items():
        of = f" of {name!r}" if name else ""
        check_numbers(**{f"size{of}": 1.0 if given is None and not name else given})
        if given is not None and given <= 0:
            raise InvalidInputError(f"size{of} must be above zero, got {given}: give the largest edge")
    if order not in (1, 2):
        raise InvalidInputError(f"order must be 1 or 2, got {order}: linear or quadratic cells")
    options: dict[str, float] = {
        "Mesh.ElementOrder": order,
        "Mesh.SecondOrderIncomplete": 0,
        "Mesh.SecondOrderLinear": 0,
    }
    options["Mesh.HighOrderOptimize"] = 1  # only where curved cells would be inverted
    if size is not None:
        options["Mesh.MeshSizeMax"] = max([size, *sizes.values()])
    source = f"file '{path}'"
    with Task("mesh"), reading_process(path) as process:
        dim = process.call(_opened, path, options, bodies)
        if surfaces is not None and dim > 1:  # functions that choose are the caller's
            chosen = chosen_faces(*process.call(_choices, dim - 1), surfaces, source)
            process.call(_choose, dim - 1, chosen)
        if sizes:
            process.call(_set_sizes, dim, size, sizes, bodies, source)
        return process.call(_meshed, dim, path, bodies)


def _opened(path: Path, options: Mapping[str, float], bodies: Bodies | None) -> int:
    """Read the geometry, name what has no name, and return its dimension."""
    gmsh = lasting_session(path.name, options)
    with _reasons(path):
        gmsh.merge(str(path))
    dim = max((dim for dim, _ in gmsh.model.getEntities()), default=0)
    _name(gmsh, dim, unique=True)
    _name(gmsh, dim - 1, unique=False, without=_inner_faces(gmsh, dim, bodies))
    return dim


def _choices(dim: int) -> tuple[list[CadFace], dict[Label, list[int]]]:
    """Return the faces of the geometry and their groups."""
    gmsh = import_gmsh()
    return faces_of(gmsh, dim), physical_groups(gmsh, dim)


def _choose(dim: int, chosen: Mapping[str, Sequence[int]]) -> None:
    """Replace the physical groups of faces by those that are chosen."""
    gmsh = import_gmsh()
    gmsh.model.removePhysicalGroups([(dim, tag) for _, tag in gmsh.model.getPhysicalGroups(dim)])
    _add_groups(gmsh, dim, chosen)


def _meshed(dim: int, path: Path, bodies: Bodies | None) -> dict[str, BodyMesh]:
    gmsh = import_gmsh()
    _require_joined(gmsh, dim, bodies, path)
    with _reasons(path):
        gmsh.model.mesh.generate(dim)
    return from_gmsh_model(bodies)


def _require_joined(gmsh: ModuleType, dim: int, bodies: Bodies | None, path: Path) -> None:
    """Reject a body of several solids that meet in a face that each of them has for itself."""
    for name, solids in _solids_of(gmsh, dim, bodies).items():
        found: dict[tuple[float, ...], tuple[int, str]] = {}
        for tag, label in solids.items():
            for _, face in gmsh.model.getBoundary([(dim, tag)], oriented=False):
                box = np.array(gmsh.model.getBoundingBox(dim - 1, face))
                other, first = found.setdefault(floats(np.round(box / np.ptp(box), 4) + 0.0), (face, label))
                if other != face and first != label:
                    raise InvalidInputError(
                        f"{first!r} and {label!r} of body {name!r} meet in a face that file '{path}' has "
                        'twice: write a file join.geo with SetFactory("OpenCASCADE"); v() = '
                        f'ShapeFromFile("{path.name}"); Coherence; and read that, or make bodies and a Tie'
                    )


def _inner_faces(gmsh: ModuleType, dim: int, bodies: Bodies | None) -> set[int]:
    """Return the faces between two solids of one body."""
    found: set[int] = set()
    for solids in _solids_of(gmsh, dim, bodies).values():
        faces = [abs(face) for tag in solids for _, face in gmsh.model.getBoundary([(dim, tag)])]
        found |= {face for face, times in Counter(faces).items() if times > 1}
    return found


def _solids_of(gmsh: ModuleType, dim: int, bodies: Bodies | None) -> dict[str, dict[int, str]]:
    """Return the numbers of the solids of each body that is chosen, and their labels."""
    groups = {str(label): tags for label, tags in physical_groups(gmsh, dim).items()}
    return {
        name: {int(tag): label for label in labels for tag in groups.get(label, ())}
        for name, labels in _labels_of(bodies).items()
    }


def _labels_of(bodies: Bodies | None) -> dict[str, list[str]]:
    """Return the labels of the parts of each body that is chosen."""
    found = {}
    for body, parts in (bodies if isinstance(bodies, Mapping) else {}).items():
        found[body] = [str(label) for label in by_name(parts).values()]
    return found


def _set_sizes(
    dim: int,
    size: float | None,
    sizes: Mapping[str, float],
    bodies: Bodies | None,
    source: str,
) -> None:
    """Give the points of bodies and surfaces their sizes, from the largest to the smallest."""
    gmsh, known = import_gmsh(), dict[str, list[tuple[int, int]]]()
    for of in (dim, dim - 1):
        for label, tags in physical_groups(gmsh, of).items() if of else ():
            known.setdefault(str(label), []).extend((of, tag) for tag in tags)
    for body, labels in _labels_of(bodies).items():
        known[body] = [entity for label in labels for entity in known.get(label, [])]
    if missing := [name for name in sizes if not known.get(name)]:
        raise InvalidInputError(
            f"sizes are of bodies and surfaces of {source}, {', '.join(map(repr, known))}, got {missing[0]!r}"
        )
    if size is not None and max(sizes.values()) > size:  # it is no limit for all any more
        gmsh.model.mesh.setSize(gmsh.model.getEntities(0), size)
    for name, own in sorted(sizes.items(), key=lambda entry: -entry[1]):
        points = gmsh.model.getBoundary(known[name], combined=False, oriented=False, recursive=True)
        gmsh.model.mesh.setSize(points, own)


@contextmanager
def _reasons(path: Path) -> Iterator[None]:
    """Say what gmsh says."""
    try:
        yield
    except Exception as reason:  # gmsh raises no other class
        raise InvalidInputError(
            f"file '{path}' must be one that gmsh can read and mesh, it says: {reason}: open it in gmsh"
        ) from reason


def _name(gmsh: ModuleType, dim: int, *, unique: bool, without: Collection[int] = ()) -> None:
    """Add physical groups of entities, but for some, if there are none of their dimension."""
    if dim < 1 or gmsh.model.getPhysicalGroups(dim):
        return
    names = {tag: name_of(gmsh, dim, tag) for _, tag in gmsh.model.getEntities(dim) if tag not in without}
    times = Counter(names.values())
    groups: dict[str, list[int]] = {}
    for tag, name in names.items():
        groups.setdefault(f"{name} {tag}" if unique and times[name] > 1 else name, []).append(tag)
    _add_groups(gmsh, dim, groups)


def _add_groups(gmsh: ModuleType, dim: int, groups: Mapping[str, Sequence[int]]) -> None:
    for name, tags in groups.items():
        gmsh.model.setPhysicalName(dim, gmsh.model.addPhysicalGroup(dim, tags), name)
