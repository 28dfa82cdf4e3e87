"""Scene files read, checked and built: meshes, bodies, scenes, designs; errors refer to their keys."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from functools import cached_property, partial, singledispatch
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

import numpy as np
from pydantic import BaseModel

from fenics_contact._adaptive.equilibrium import solve_to
from fenics_contact._adaptive.levels import AccurateResult, Level, Limits
from fenics_contact._adaptive.minimised import AccurateDesign, minimize_to
from fenics_contact._adaptive.nested import check_nested, solve_nested
from fenics_contact._adaptive.quantities import quantity
from fenics_contact._base.checkpoint import Checkpoint
from fenics_contact._base.checks import require_file
from fenics_contact._equilibrium.problem import ContactProblem
from fenics_contact._equilibrium.steps import LoadSequence
from fenics_contact._optimize.bundle_trust import BundleTrust, minimize
from fenics_contact._optimize.constraints import LinearConstraints
from fenics_contact._optimize.nonlinear import NonlinearConstraint
from fenics_contact._optimize.progress import Callback
from fenics_contact._optimize.result import Result
from fenics_contact._scene.body import Body
from fenics_contact._scene.fluids_of_pairs import pressures_of
from fenics_contact._scene.scene import LoadStep, Scene
from fenics_contact._scene_file.accuracy import not_refined
from fenics_contact._scene_file.bodies import Shaped
from fenics_contact._scene_file.design import (
    DesignPart,
    OwnObjective,
    design_surface,
    fitting,
)
from fenics_contact._scene_file.document import Document, load_steps
from fenics_contact._scene_file.source import (
    Mistake,
    SceneFileError,
    Source,
    collected,
    located,
    parse,
    parts_of,
    written,
)
from fenics_contact._scene_file.source import Path as Keys
from fenics_contact._scene_file.validation import surface_parts, unknown
from fenics_contact._scene_file.values import OfFile, at_time, is_reference
from fenics_contact.design.design import SurfaceDesign
from fenics_contact.design.memory import AdaptiveTolerance
from fenics_contact.design.objective import Objective
from fenics_contact.design.problem import ShapeProblem
from fenics_contact.design.several import LoadPath
from fenics_contact.errors import InvalidInputError, together
from fenics_contact.errors.ranks import on_root_then_bcast
from fenics_contact.materials.elastic import Material
from fenics_contact.results.state import State

if TYPE_CHECKING:
    from mpi4py import MPI


#: Keys that may hold formulas.
_FORMULAS = {"supports": ("value",), "loads": ("value",), "contacts": ("master", "formula")}


def made_of(given: str | Mapping[str, str], materials: Mapping[str, Any]) -> Any:
    """Return the material of a body, or that of each of its regions by name."""
    if isinstance(given, str):
        return materials[given]
    return {region: materials[name] for region, name in given.items()}


class Builder:
    """Builds the parts in order and collects their mistakes.

    Functions that read meshes or run gmsh agree on errors themselves; Python files are read by every rank.
    """

    def __init__(self, source: Source, document: Document, comm: MPI.Comm) -> None:
        """Start with nothing built."""
        self._source, self._document, self._comm = source, document, comm
        self._mistakes: list[Mistake] = []

    def shapes(self) -> dict[str, Mapping[str, Shaped]]:
        """Return what meshes hold by the names of their parts. Collective."""
        shapes: dict[str, Mapping[str, Shaped]] = {}
        for name, mesh in self._document.meshes.items():
            with self._at("meshes", name):
                shapes[name] = mesh.build(self._source.folder, self._comm)
        return shapes

    def bodies(self) -> tuple[dict[str, Body], dict[str, Shaped]]:
        """Return the bodies with their shapes. Collective."""
        shapes = self.shapes()
        materials: dict[str, Material] = {}
        for name, part in self._document.materials.items():
            with self._at("materials", name):
                materials[name] = part.build(self._source.folder)
        self._check()
        chosen, made = {}, {}
        for name, body in self._document.bodies.items():
            with self._at("bodies", name):
                chosen[name] = self._part_of(name, body, shapes[body.mesh])
                given: Any = made_of(body.material, materials)  # type: ignore[arg-type]
                ways = body.axisymmetric, body.torsion, body.integration
                made[name] = Body(chosen[name].mesh, given, *ways)
        self._check()
        return made, chosen

    def _part_of(self, name: str, body: Any, shapes: Mapping[str, Shaped]) -> Shaped:
        if body.part is None and len(shapes) == 1:
            return next(iter(shapes.values()))
        path: Keys = ("bodies", name, "part") if body.part is not None else ("bodies", name)
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
        """Return the scene of the bodies."""
        self._check_surfaces(bodies)
        document, dim = self._document, next(iter(bodies.values())).mesh.dim
        empty = Scene(bodies)
        built: dict[str, list[Any]] = {}
        for key in (
            "contacts",
            "supports",
            "loads",
            "ties",
            "preloads",
            "foundations",
            "springs",
            "constraints",
        ):
            built[key] = []
            for number, part in enumerate(getattr(document, key)):
                with self._at(key, number):
                    one = self._made(part, dim)
                    alone: dict[str, Any] = {each: tuple(built[each]) for each in part.beside} | {key: (one,)}
                    replace(empty, **alone)  # rejects what does not suit the bodies
                    built[key].append(one)
                    with self._at(key, number, *_FORMULAS.get(key, ())):
                        part.check_formulas(one, bodies)
                    for name in ("friction", "gap", "interference") if key == "contacts" else ():
                        with self._at(key, number, name):
                            part.check_values(one, name, bodies)
        self._check()
        if document.automatic_contact is None:
            return Scene(bodies, **built)
        with self._at("automatic_contact"):
            if built["contacts"]:
                raise InvalidInputError(
                    "a scene has [automatic_contact] or [[contacts]], got both: leave one of them out"
                )
            scene = Scene(bodies, **{**built, "contacts": document.automatic_contact.made()})
        self._check()
        return scene

    def _made(self, part: Any, dim: int) -> Any:
        """Return a part, as it is before the first load step if there are any."""
        if not hasattr(part, "build"):
            return part.made()
        return part.build(dim, at_time(part.size, 0.0) if self._document.steps else part.size)

    def _check_surfaces(self, bodies: Mapping[str, Body]) -> None:
        for path, part in surface_parts(self._document):
            mesh = bodies[part.body].mesh
            on_nodes = part.on_nodes or path[0] == "springs"
            known = {**mesh.surfaces, **mesh.node_sets} if on_nodes else mesh.surfaces
            if part.surface not in known:
                what, where = f"a surface of the body {part.body!r}", (*path, "surface")
                self._mistakes.append(unknown(self._source, where, part.surface, what, sorted(known)))
        self._check()

    def _at(self, *path: str | int) -> AbstractContextManager[None]:
        """Collect an error of the block as a mistake at a key."""
        return collected(self._source, path, self._mistakes)

    def _check(self) -> None:
        """Raise on all ranks if one has a mistake, such as a file that only it cannot read. Collective."""
        with together(self._comm):
            if self._mistakes:
                raise SceneFileError(self._source.name, self._mistakes)


AnyDocument = TypeVar("AnyDocument", bound=BaseModel)


def with_fields_read(source: Source, document: AnyDocument, comm: MPI.Comm) -> AnyDocument:
    """Return a document with the fields and obstacles of the files that it names. Collective on ``comm``.

    Each file is read once, on rank 0.
    """
    mistakes: list[Mistake] = []
    read: dict[tuple[Any, ...], Any] = {}
    for path, part in parts_of(document, OfFile):  # type: ignore[type-abstract]
        if part.key not in read:
            with collected(source, path, mistakes):
                read[part.key] = part.read(source.folder, comm)
    with together(comm):
        if mistakes:
            raise SceneFileError(source.name, mistakes)
    return _replaced(document, read) if read else document


@singledispatch
def _replaced(value: Any, read: Mapping[tuple[Any, ...], Any]) -> Any:
    """Return a copy of a part of a document with what was read from files."""
    return value


@_replaced.register(OfFile)
def _(value: OfFile, read: Mapping[tuple[Any, ...], Any]) -> Any:
    return value.taking(read[value.key])


@_replaced.register(BaseModel)
def _(value: BaseModel, read: Mapping[tuple[Any, ...], Any]) -> Any:
    own = {name: (part, _replaced(part, read)) for name, part in value}
    changed = {name: new for name, (old, new) in own.items() if new is not old}
    return value.model_copy(update=changed) if changed else value


@_replaced.register(list)
@_replaced.register(tuple)
def _(value: list | tuple, read: Mapping[tuple[Any, ...], Any]) -> Any:
    parts = [_replaced(part, read) for part in value]
    same = all(new is old for new, old in zip(parts, value, strict=True))
    return value if same else type(value)(parts)


@_replaced.register(Mapping)
def _(value: Mapping, read: Mapping[tuple[Any, ...], Any]) -> Any:
    return {name: _replaced(part, read) for name, part in value.items()}


@dataclass(frozen=True, eq=False)
class ShapeTask:
    """A shape optimisation, ready to run.

    Attributes:
        start: Design variables at the start, [length].
        bounds: Least and largest values of the variables, [length].
        constraints: The linear ones in one, volumes, and limits of other objectives.
        constrain: Makes the same constraints of a problem on another mesh.
        restore: Whether the start may violate limits of other objectives.
    """

    problem: ShapeProblem | LoadPath
    start: np.ndarray
    bounds: tuple[np.ndarray, np.ndarray]
    constraints: tuple[LinearConstraints | NonlinearConstraint, ...]
    constrain: Callable[[ShapeProblem], tuple[LinearConstraints | NonlinearConstraint, ...]]
    method: BundleTrust
    restore: bool = False

    def minimize(self, *, callback: Callback | None = None, checkpoint: Checkpoint | None = None) -> Result:
        """Run it. Collective; a stop before the tolerance is met is reported by the result's reason.

        Args:
            callback: Called after every evaluation, see `fenics_contact.minimize`.
            checkpoint: File from which an interrupted run continues, or None.
        """
        return minimize(
            self.problem,
            self.start,
            self.method,
            bounds=self.bounds,
            constraints=self.constraints,
            restore=self.restore,
            callback=callback,
            checkpoint=checkpoint,
        )

    def minimize_to(
        self, relative_error: float, limits: Limits, callback: Callable[[Level], None] | None = None
    ) -> AccurateDesign:
        """Run it on finer and finer meshes, see `fenics_contact.minimize_to`. Collective."""
        return minimize_to(
            self.problem,  # type: ignore[arg-type]  # load paths are refused there
            self.start,
            relative_error,
            self.method,
            bounds=self.bounds,
            constraints=self.constrain,
            restore=self.restore,
            limits=limits,
            callback=callback,
        )


def shape_task(
    source: Source,
    document: Document,
    contact: ContactProblem,
    shapes: Mapping[str, Shaped],
    steps: Sequence[LoadStep],
) -> ShapeTask:
    """Pose the optimisation of a scene file. Collective."""
    design = document.design
    assert design is not None
    moving = tuple(
        SurfaceDesign(
            part.body, design_surface(shapes[part.body], part.surface, part.body), part.net, part.transition
        )
        for part in design.surfaces
    )
    with together(contact.comm):
        objective = design.objective.found(source.folder)
    adaptive = AdaptiveTolerance() if design.adaptive else None
    alone = ShapeProblem(contact, moving, objective, tolerance=adaptive)
    problem = _over_steps(alone, design, steps)
    lower, upper = (
        np.repeat([getattr(part, side) for part in design.surfaces], [move.size for move in moving])
        for side in ("lower", "upper")
    )
    start = np.zeros(problem.size) if design.start is None else fitting("start", design.start, problem.size)
    method = design.made(raise_on_failure=False)
    constrain = partial(_constraints, design, start=start, folder=source.folder)
    constraints = constrain(problem)
    return ShapeTask(problem, start, (lower, upper), constraints, constrain, method, design.restore)


def _over_steps(
    problem: ShapeProblem, design: DesignPart, steps: Sequence[LoadStep]
) -> ShapeProblem | LoadPath:
    """Return the problem whose objective is added over load steps, if there are any. Collective."""
    if not steps:
        if design.over_steps is not None or any(getattr(part, "step", None) for part in design.constraints):
            raise InvalidInputError("over_steps and step name load steps, the file has none: give [[steps]]")
        return problem
    if design.over_steps is None:
        return LoadPath(problem, steps)
    return LoadPath(problem, steps, dict.fromkeys(design.over_steps, problem.objective))


def _constraints(
    design: DesignPart, problem: ShapeProblem | LoadPath, start: np.ndarray, folder: Path
) -> tuple[LinearConstraints | NonlinearConstraint, ...]:
    """Return the constraints of a design, all linear ones in one. Collective."""
    rows = [row for part in design.constraints for row in part.rows(problem.size)]
    others = [limit for part in design.constraints for limit in part.limits(problem, start, folder)]
    if not rows:
        return tuple(others)
    coefficients, largest = zip(*rows, strict=True)
    return LinearConstraints(np.array(coefficients), np.array(largest)), *others


#: Largest size of a scene file, in bytes.
LARGEST = 10_000_000


@dataclass(frozen=True, eq=False)
class SceneFile:
    """A scene file that was read and checked. Meshes are built on first access.

    Attributes:
        comm: Communicator on which it was read, and on which everything is built.
    """

    source: Source
    document: Document
    comm: MPI.Comm
    steps_in_words: ClassVar[str] = "load steps"

    @classmethod
    def documents(cls) -> type[Document]:
        """Return the form of its data."""
        return Document

    @property
    def name(self) -> str:
        """The file's name without suffix; "scene" for a dictionary."""
        return Path(self.source.name).stem if self.source.text else "scene"

    @property
    def title(self) -> str:
        """Title of pictures and tables."""
        return self.document.title or self.name.replace("_", " ").capitalize()

    @property
    def folder(self) -> Path:
        """Folder of the results, relative to where the program runs."""
        return Path(self.document.output.folder or f"output/{self.name}")

    @property
    def notes(self) -> Sequence[str]:
        """What the plan says besides, none of a scene file."""
        return ()

    def write_tables(self, state: State, step: int = 0) -> None:
        """Write the tables that a deck asks for; a scene file has others, see `output`. Collective."""

    @cached_property
    def _complete(self) -> Document:
        """The document with the fields of its files."""
        return with_fields_read(self.source, self.document, self.comm)

    @cached_property
    def _built(self) -> tuple[Scene, dict[str, Shaped]]:
        builder = Builder(self.source, self._complete, self.comm)
        bodies, shapes = builder.bodies()
        return builder.scene(bodies), shapes

    @property
    def scene(self) -> Scene:
        """The scene. Collective on first use."""
        return self._built[0]

    @cached_property
    def steps(self) -> tuple[LoadStep, ...]:
        """All load steps; empty where everything acts at once. Collective on first use."""
        document, bodies = self._complete, self.scene.bodies
        parts = document.supports, document.loads, document.preloads
        fluids = pressures_of(self.scene.contacts)
        values = {each.label: each.value for each in self.scene.constraints}
        return load_steps(document.steps, *parts, fluids, values, bodies, self._at)

    @cached_property
    def partitions(self) -> dict[str, np.ndarray]:
        """Body name -> subdomain of every cell. Collective on first use."""
        scene = self.scene
        with self._at("solver", "subdomains"), together(self.comm):
            return self.document.solver.cut(scene, self.comm.size)

    @property
    def plans(self) -> tuple[object, ...]:
        """What will be built, as text. Collective on first use."""
        return (self.scene.plan(self.partitions),)

    @property
    def problem(self) -> ContactProblem:
        """The scene on its first meshes with the solver of the file, unsolved. Collective on first use."""
        solver = self.document.solver
        with self._at("solver"):
            chosen = solver.chosen(self.scene, self.partitions)
        with self._at("solver", "newton"):
            steps = solver.following(self.scene)
        return ContactProblem(
            self.scene,
            self.comm,
            partitions=self.partitions,
            solver=chosen,
            tolerance=solver.accuracy(self.scene),
            steps=steps,
        )

    def solve(self) -> State:
        """Compute the equilibrium, of the last load step if there are any. Collective.

        Raises:
            InfeasibleError: If some body is not held against its load.
            ConvergenceError: If the solver does not reach its tolerance.
        """
        if self.steps:
            sequence = self.sequence()
            return [sequence.advance(step) for step in self.steps][-1]
        halvings, problem = self.document.solver.halvings, self.problem
        if not halvings:
            return problem.solve()
        with self._at("solver", "halvings"):
            check_nested(self.scene, halvings)
        return solve_nested(
            self.scene, halvings, self.comm, solver=problem.solver, tolerance=problem.tolerance
        )

    def sequence(self, checkpoint: Checkpoint | None = None) -> LoadSequence:
        """Return the history of the scene before its first load step. Collective.

        `checkpoint`: file from which an interrupted history continues, or None.
        """
        return LoadSequence(self.problem, checkpoint=checkpoint, count=len(self.steps))

    def check_accuracy(self) -> None:
        """Refuse an accuracy of what the scene does not have or refined meshes cannot keep. Collective."""
        self.check_refined()
        if self.document.accuracy is not None:
            _ = self.quantity

    def check_refined(self) -> None:
        """Refuse an accuracy with what refined meshes cannot keep."""
        asked = self.document.accuracy
        if asked is None:
            return
        with self._at("accuracy"):
            asked.made()
        wrong = [
            self.source.mistake(path, f"{written(path)} does not go with [accuracy]: {words}")
            for path, words in not_refined(self.document)
        ]
        if wrong:
            raise SceneFileError(self.source.name, wrong)

    @cached_property
    def quantity(self) -> Objective:
        """The quantity of [accuracy]. Collective on first use."""
        asked = self.document.accuracy
        assert asked is not None
        with self._at("accuracy"), together(self.comm):
            if is_reference(asked.quantity):
                return OwnObjective(asked.quantity).found(self.source.folder)
            return quantity(asked.quantity, self.scene, **asked.where)

    def solve_to(self, callback: Callable[[Level], None] | None = None) -> AccurateResult[State]:
        """Compute the quantity of [accuracy] as accurately as it asks for. Collective.

        `callback`: called with every level once it is done.
        """
        asked = self.document.accuracy
        assert asked is not None
        with self._at("solver"):
            solver = self.document.solver.chosen(self.scene, self.partitions)
        with self._at("accuracy"):
            limits = asked.made()
        return solve_to(
            self.scene,
            self.quantity,
            asked.relative_error,
            self.comm,
            limits=limits,
            solver=solver,
            callback=callback,
            **self.document.solver.fixed,
        )

    def require_design(self) -> None:
        """Reject a file without an optimisation."""
        if self.document.design is None:
            words = (
                "an optimisation needs [design] with [[design.surfaces]], got none: add them, or find the "
                "state with `fenics-contact run`"
            )
            raise SceneFileError(self.source.name, [self.source.mistake((), words)])

    def shape_task(self) -> ShapeTask:
        """Return the shape optimisation that the file describes. Collective."""
        self.require_design()
        steps = self.steps
        with self._at("design"):
            _, shapes = self._built
            return shape_task(self.source, self.document, self.problem, shapes, steps)

    def _at(self, *keys: str | int) -> AbstractContextManager[None]:
        return located(self.source, keys)


@singledispatch
def source_of(scene: object, comm: MPI.Comm) -> Source:
    """Return the content of a file, or of a dictionary. Collective on ``comm``."""
    raise InvalidInputError(
        f"a scene must be the path of a TOML file or a dictionary, got {type(scene).__name__}"
    )


@source_of.register(Mapping)
def _(scene: Mapping[str, Any], comm: MPI.Comm) -> Source:
    return Source("the scene", Path(), scene)


@source_of.register(str)
@source_of.register(Path)
def _(scene: str | Path, comm: MPI.Comm) -> Source:
    path = Path(scene)
    return parse(on_root_then_bcast(comm, lambda: _text_of(path)), path.name, path.parent)


def _text_of(path: Path) -> str:
    require_file(path, "a scene file")
    try:
        large = path.stat().st_size > LARGEST
        content = b"" if large else path.read_bytes()
    except OSError as error:
        raise InvalidInputError(
            f"the scene file '{path}' must be readable: {error.strerror or error}"
        ) from error
    if large:
        raise InvalidInputError(
            f"the scene file '{path}' must have at most {LARGEST // 10**6} MB: give meshes own files"
        )
    try:
        return content.decode("utf-8").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise InvalidInputError(
            f"the scene file '{path}' must be UTF-8, line {line} is not ({error.reason}): save it as UTF-8"
        ) from error
