"""From a checked scene file to meshes, bodies and a scene; errors refer to their keys."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import AbstractContextManager
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from fenics_contact.errors import InvalidInputError, together
from fenics_contact.scene import Body, Material, Scene
from fenics_contact.scene_file.document import Document
from fenics_contact.scene_file.evaluation import check_formulas, check_pair
from fenics_contact.scene_file.expression import at_time
from fenics_contact.scene_file.located import located
from fenics_contact.scene_file.mistakes import Mistake, SceneFileError
from fenics_contact.scene_file.names import surface_parts, unknown
from fenics_contact.scene_file.places import Path, written
from fenics_contact.scene_file.placing import Shaped
from fenics_contact.scene_file.source import Source

if TYPE_CHECKING:
    from mpi4py import MPI

#: Keys that may hold formulas.
_FORMULAS = {"supports": ("value",), "loads": ("value",), "contacts": ("master", "formula")}


class Builder:
    """Builds the parts in order and collects their mistakes.

    Functions that read meshes or run gmsh agree on errors themselves; Python files are read by every rank.
    """

    def __init__(self, source: Source, document: Document, comm: MPI.Comm) -> None:
        """Start with nothing built.

        Args:
            source: Source of the document.
            document: The checked file.
            comm: Communicator on which meshes are built.
        """
        self._source, self._document, self._comm = source, document, comm
        self._mistakes: list[Mistake] = []

    def bodies(self) -> tuple[dict[str, Body], dict[str, Shaped]]:
        """Return the bodies with their shapes. Collective.

        Raises:
            SceneFileError: Naming every mesh, material and body that cannot be built.
        """
        shapes: dict[str, Mapping[str, Shaped]] = {}
        for name, mesh in self._document.meshes.items():
            with self._at("meshes", name):
                shapes[name] = mesh.build(self._source.folder, self._comm)
        materials: dict[str, Material] = {}
        for name, part in self._document.materials.items():
            with self._at("materials", name):
                materials[name] = part.build(self._source.folder)
        self._check()
        chosen, made = {}, {}
        for name, body in self._document.bodies.items():
            with self._at("bodies", name):
                chosen[name] = self._part_of(name, body, shapes[body.mesh])
                made_of: Any = body.material
                if isinstance(made_of, str):
                    made[name] = Body(chosen[name].mesh, materials[made_of])
                else:
                    by_region = {region: materials[part] for region, part in made_of.items()}
                    made[name] = Body(chosen[name].mesh, by_region)
        self._check()
        return made, chosen

    def _part_of(self, name: str, body: Any, shapes: Mapping[str, Shaped]) -> Shaped:
        if body.part is None and len(shapes) == 1:
            return next(iter(shapes.values()))
        path: Path = ("bodies", name, "part") if body.part is not None else ("bodies", name)
        parts = [part for part in shapes if part]
        if body.part in shapes:
            return shapes[body.part]
        if body.part is None:
            words = (
                f"{written(path)} must have 'part', one of {parts}: the mesh {body.mesh!r} has several bodies"
            )
            raise SceneFileError(self._source.name, [self._source.mistake(path, words)])
        wrong = unknown(self._source, path, body.part, f"a body of the mesh {body.mesh!r}", parts)
        raise SceneFileError(self._source.name, [wrong])

    def scene(self, bodies: Mapping[str, Body]) -> Scene:
        """Return the scene of the bodies.

        Raises:
            SceneFileError: Naming every support, load and pair that does not suit the bodies.
        """
        self._check_surfaces(bodies)
        document, dim = self._document, next(iter(bodies.values())).mesh.dim
        empty = Scene(bodies)
        built: dict[str, list[Any]] = {}
        for key in ("supports", "loads", "contacts", "ties"):
            built[key] = []
            for number, part in enumerate(getattr(document, key)):
                with self._at(key, number):
                    one = self._made(part, dim)
                    _refuse(empty, {key: (one,)})
                    built[key].append(one)
                    with self._at(key, number, *_FORMULAS.get(key, ())):
                        check_formulas(one, bodies)
                    for name in ("friction", "gap", "interference") if key == "contacts" else ():
                        with self._at(key, number, name):
                            check_pair(one, name, bodies)
        self._check()
        if document.automatic_contact is None:
            return Scene(bodies, **built)
        with self._at("automatic_contact"):
            if built["contacts"]:
                raise InvalidInputError(
                    f"a scene has [automatic_contact] or [[contacts]], got both, {len(built['contacts'])} of "
                    "the latter: leave one of them out"
                )
            scene = Scene(bodies, **{**built, "contacts": document.automatic_contact.made()})
        self._check()
        return scene

    def _made(self, part: Any, dim: int) -> Any:
        """Return a part, as it is before the first load step if there are any."""
        if not hasattr(part, "build"):
            return part.made()
        return part.build(dim, at_time(part.size, 0.0) if self._document.steps else None)

    def _check_surfaces(self, bodies: Mapping[str, Body]) -> None:
        for path, part in surface_parts(self._document):
            surfaces = bodies[part.body].mesh.surfaces
            if part.surface not in surfaces:
                what, where = f"a surface of the body {part.body!r}", (*path, "surface")
                self._mistakes.append(unknown(self._source, where, part.surface, what, sorted(surfaces)))
        self._check()

    def _at(self, *path: str | int) -> AbstractContextManager[None]:
        """Collect an error of the block as a mistake at a key."""
        return located(self._source, path, self._mistakes)

    def _check(self) -> None:
        """Raise on all ranks if one has a mistake, such as a file that only it cannot read. Collective."""
        with together(self._comm):
            if self._mistakes:
                raise SceneFileError(self._source.name, self._mistakes)


def _refuse(empty: Scene, part: dict[str, Any]) -> None:
    """Reject a part that does not suit the bodies of a scene."""
    replace(empty, **part)
