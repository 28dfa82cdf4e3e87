"""A whole scene file, with its load steps and solvers."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, TypeAlias

import numpy as np
from pydantic import AfterValidator, Field, NonNegativeFloat, PositiveFloat, PositiveInt

from fenics_contact._equilibrium.linear import default_solver
from fenics_contact._scene.body import Body
from fenics_contact._scene.plan import choose_solver
from fenics_contact._scene.preloads import Preload
from fenics_contact._scene.scene import LoadStep, Scene
from fenics_contact._scene_file.accuracy import AccuracyPart
from fenics_contact._scene_file.bodies import AnyMaterial, Mesh
from fenics_contact._scene_file.design import DesignPart, OwnObjective
from fenics_contact._scene_file.model import (
    AnyLoad,
    AnySupportPart,
    AnyTiePart,
    AutomaticPart,
    ConstraintPart,
    ContactPart,
    FoundationPart,
    PreloadAim,
    PreloadPart,
    SpringPart,
)
from fenics_contact._scene_file.part import Part
from fenics_contact._scene_file.source import Mistake, Source, as_toml, parts_of, written
from fenics_contact._scene_file.source import Path as Keys
from fenics_contact._scene_file.values import (
    Line,
    LoadValue,
    PlaceOfFile,
    Read,
    StepComponents,
    VectorExpression,
    at_time,
    between,
    changes,
    either,
    is_reference,
    with_message,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.materials.hyperelastic import is_nonlinear
from fenics_contact.mesh.bisection import bisection_partition
from fenics_contact.mesh.partition import box_partition, check_one_piece
from fenics_contact.qp.face_newton import FaceNewton, ProjectedCG
from fenics_contact.qp.smalse import Mpgp, Smalse
from fenics_contact.qp.solve import DualSolver

if TYPE_CHECKING:
    from fenics_contact._large_deformations.load_steps import AutomaticSteps
    from fenics_contact.results.state import Tolerance


class NewtonPart(Part):
    """How the load of a load step is followed in parts, which are halved where Newton's method fails."""

    first: float = Field(
        default=1.0, gt=0, le=1, description="first part of a load step that is tried, the whole by default"
    )
    smallest: float = Field(
        default=1.0 / 256,
        gt=0,
        le=1,
        description="smallest part; one that fails ends the run with what is reached",
    )
    snaps: bool = Field(
        default=False,
        description="whether bodies without an equilibrium near move on through a viscous medium to the next "
        "one, false by default",
    )
    finer_history: bool = Field(
        default=False,
        description="whether each part is a step of its own for slip and histories of materials, false by "
        "default: a load step is one step of them, however it is followed",
    )
    max_steps: PositiveInt | None = Field(
        default=None, description="Newton steps after which a part is halved"
    )
    max_products: PositiveInt | None = Field(
        default=None, description="products with F of one Newton step at most"
    )

    def made(self) -> AutomaticSteps:  # type: ignore[override]
        """Return the load steps of Python; raises as `AutomaticSteps` does."""
        from fenics_contact._large_deformations.load_steps import AutomaticSteps  # not for linear materials
        from fenics_contact._large_deformations.newton import TangentNewton

        given = self.model_dump(exclude_none=True)
        of_parts = ("first", "smallest", "snaps", "finer_history")
        parts = {name: given.pop(name) for name in of_parts}
        return AutomaticSteps(TangentNewton(**given), **parts)


class SmalsePart(Part):
    """Parameters of method = "smalse", augmented Lagrangians around gradient projections."""

    balance: PositiveFloat = Field(
        default=Smalse.balance, description="M: projected gradient over equilibrium error at first"
    )
    loosest: PositiveFloat = Field(
        default=Smalse.loosest, description="η: projected gradient over right side at most"
    )
    balance_reduction: float = Field(
        default=Smalse.balance_reduction, gt=0, lt=1, description="1/β: factor on M"
    )
    expansion: float = Field(
        default=Mpgp.expansion, gt=0, lt=2, description="ᾱ‖A‖: length of gradient projections"
    )
    proportioning: PositiveFloat = Field(
        default=Mpgp.proportioning, description="Γ: chopped over free gradient at most, on a face"
    )

    def made(self) -> Smalse:  # type: ignore[override]
        """Return the solver of Python with the tolerance and the products of its own defaults."""
        given = self.model_dump()
        return Smalse(mpgp=Mpgp(given.pop("expansion"), given.pop("proportioning")), **given)


BALANCED = "balanced"


_TOLERANCES = with_message(f'a number between 0 and 1, or "{BALANCED}"')
_Tolerance = Annotated[Annotated[float, Field(gt=0, lt=1)] | Literal["balanced"], _TOLERANCES]
_Boxes = Annotated[list[PositiveInt], Field(min_length=2, max_length=3, strict=False), AfterValidator(tuple)]
_ByBody = Annotated[dict[str, PositiveInt | _Boxes], Field(min_length=1)]
_CUTS = with_message(
    '"auto", a positive integer, three integers in brackets (boxes of a structured mesh; two in the plane), '
    "or a table: body = integer or boxes"
)
_Cuts = Annotated[Literal["auto"] | PositiveInt | _Boxes | _ByBody, _CUTS]


class SolverPart(Part):
    """How the scene is solved; everything has a default."""

    method: Literal["auto", "face_newton", "smalse", "projected_cg"] = Field(
        default="auto", description="dual solver; auto takes the one that suits the scene"
    )
    tolerance: Annotated[Any, Read(_Tolerance)] = Field(
        default=BALANCED,
        description="largest relative residual, or balanced: as accurate as the mesh deserves",
    )
    max_products: PositiveInt | None = Field(
        default=None, description="give up after that many products with F"
    )
    smalse: SmalsePart = Field(default=SmalsePart(), description='parameters of method = "smalse"')
    newton: NewtonPart | None = Field(
        default=None, description="how loads on nonlinear materials are followed, in parts"
    )
    subdomains: Annotated[Any, Read(_Cuts)] = Field(
        default="auto",
        description="subdomains of every body, or by body: a number, or boxes of a structured mesh",
    )
    halvings: Annotated[int, Field(ge=0, le=20)] = Field(
        default=0,
        description="how often all cells are halved before the final solve; each mesh starts the next",
    )

    def accuracy(self, scene: Scene) -> Tolerance:
        """Return the tolerance for solvers; None, their own, where errors of the mesh are not estimated."""
        if scene.is_nonlinear and "tolerance" not in self.model_fields_set:
            return None
        if self.tolerance != BALANCED:
            return float(self.tolerance)
        from fenics_contact._accuracy.state_errors import (
            BalancedTolerance,
        )  # not imported for a fixed tolerance

        return BalancedTolerance()

    @property
    def fixed(self) -> dict[str, float]:
        """The tolerance where it is a number, for what has one of its own for a balanced one."""
        return {} if self.tolerance == BALANCED else {"tolerance": self.tolerance}

    def chosen(self, scene: Scene, partitions: Mapping[str, np.ndarray]) -> DualSolver | None:
        """Return the dual solver given by the keys, None for the default one."""
        if scene.is_nonlinear and (self.method != "auto" or self.max_products is not None):
            raise InvalidInputError(
                "method and max_products are for linear materials, Newton's method solves this scene, got "
                f"method {self.method!r} and max_products {self.max_products}: leave them out, or set "
                "'newton'"
            )
        if "smalse" in self.model_fields_set and self.method != "smalse":
            raise InvalidInputError(
                f'smalse has parameters of method = "smalse", got method {self.method!r}: leave one out'
            )
        kinds: dict[str, DualSolver] = {
            "face_newton": FaceNewton(),
            "smalse": self.smalse.made(),
            "projected_cg": ProjectedCG(),
        }
        solver = kinds.get(self.method)
        if self.max_products is None:
            return solver
        if solver is None:
            subdomains = sum(int(part.max()) + 1 for part in partitions.values())
            solver = default_solver(choose_solver(scene, subdomains))
        return replace(solver, max_products=self.max_products)  # type: ignore[type-var]

    def following(self, scene: Scene) -> AutomaticSteps | None:
        """Return how loads on nonlinear materials are followed, None for the default."""
        if self.newton is None:
            return None
        if not scene.is_nonlinear:
            keys = ", ".join(sorted(self.newton.model_fields_set)) or "no key"
            raise InvalidInputError(
                f"newton is for nonlinear materials, all of this scene are linear, got {keys}: leave it out"
            )
        return self.newton.made()

    def cut(self, scene: Scene, ranks: int) -> dict[str, np.ndarray]:
        """Cut every body into subdomains, body name -> subdomain of every cell.

        `ranks`: number of ranks, each of which needs a subdomain if no number is given.
        """
        asked = self.subdomains if isinstance(self.subdomains, Mapping) else {}
        everywhere = None if asked or self.subdomains == "auto" else self.subdomains
        parts = {} if everywhere or set(asked) >= set(scene.bodies) else scene.partition(ranks)
        for name, body in scene.bodies.items():
            cut = asked.get(name, everywhere)
            if isinstance(cut, tuple):
                parts[name] = box_partition(body.mesh, cut)
            elif cut is not None:
                check_one_piece(body.mesh, name)
                parts[name] = bisection_partition(body.mesh, cut)
        return parts


#: Largest total number of load steps of a file; longer histories are driven from Python.
MOST = 100_000


class StepPart(Part):
    """One load step or several: values go linearly from those before to those given here.

    A value given by a formula in t is its value at the end of each load step.
    """

    name: Line = Field("step", description="what it does, for records")
    count: int = Field(1, ge=1, le=MOST, description="number of load steps in which the values are reached")
    duration: PositiveFloat | None = Field(
        None, description="time that they take together, for t in formulas; one for each load step by default"
    )
    supports: dict[str, StepComponents] = Field({}, description="name of a support -> its value at the end")
    loads: dict[str, LoadValue] = Field({}, description="name of a load -> its value at the end")
    preloads: dict[str, PreloadAim] | None = Field(
        None,
        description="name of a preload -> its force or shortening, all others are held at their lengths; {} "
        "holds all; not given, all stay as they were",
    )
    fluids: dict[str, NonNegativeFloat] = Field(
        {}, description="name of a fluid in contacts -> its pressure at the end, [force/length²]"
    )
    constraints: dict[str, either(list, list[float], float)] = Field(  # type: ignore[valid-type]
        {}, description="name of equations in [[constraints]] -> their value at the end, [length]"
    )
    cycles: PositiveFloat | None = Field(
        None,
        description="how often each of its load steps is repeated, where pairs wear; as before by default",
    )

    def drawn(self, preloads: Sequence[PreloadPart]) -> tuple[Preload, ...] | None:
        """Return the preloads that the step draws together, None where all stay as they were."""
        if self.preloads is None:
            return None
        known = {part.name: part.made() for part in preloads}
        return tuple(
            replace(known[name], force=aim.force, shortening=aim.shortening)
            for name, aim in self.preloads.items()
        )


def load_steps(
    steps: Sequence[StepPart],
    supports: Sequence[AnySupportPart],
    loads: Sequence[AnyLoad],
    preloads: Sequence[PreloadPart],
    fluids: Mapping[str, float],
    constraints: Mapping[str, Any],
    bodies: Mapping[str, Body],
    at: Callable[..., AbstractContextManager[None]],
) -> tuple[LoadStep, ...]:
    """Return all load steps, in their order.

    A support or load that a step does not name keeps its value; a named one changes linearly from the value
    before, initially its own, to the one given. A formula that depends on t is evaluated at the end of each
    load step instead, also in later steps and where it is the initial value; t starts at zero. Preloads have
    their aims in all of the step's parts; pressures of fluids and values of equations
    change linearly.
    """
    with at("steps"):
        _require_few(steps)
    first = next(iter(bodies.values()))
    dim = first.mesh.dim
    in_parts = any(is_nonlinear(each) for body in bodies.values() for each in body.materials)
    own = [(0.0,) * first.components if part.size is None else part.size for part in supports]
    held = _Values([part.name for part in supports], own)
    acting = _Values([part.name for part in loads], [part.size for part in loads])
    wetting, equal = dict(fluids), dict(constraints)
    built: list[LoadStep] = []
    begin = 0.0
    for position, step in enumerate(steps):
        duration = step.duration or float(step.count)
        acted = _LoadHistory(tuple(loads), dim, acting.ways(step.loads), begin, duration)
        held_up = _LoadHistory(tuple(supports), dim, held.ways(step.supports), begin, duration)
        with at("steps", position):
            for number in range(1, step.count + 1):
                time, share = begin + number / step.count * duration, number / step.count
                name = step.name if step.count == 1 else f"{step.name} {number}/{step.count}"
                acts, holds = (
                    each if in_parts and each.varies else each.at(time, share) for each in (acted, held_up)
                )
                pressures = {
                    each: wetting[each] + share * (end - wetting[each]) for each, end in step.fluids.items()
                }
                values = {
                    each: ((1.0 - share) * np.asarray(equal[each]) + share * np.asarray(end)).tolist()
                    for each, end in step.constraints.items()
                }
                drawn = step.drawn(preloads)
                built.append(
                    LoadStep(
                        *(name, acts, holds, time, drawn, pressures or None),
                        constraints=values or None,
                        cycles=step.cycles,
                    )
                )
            for history in (acted, held_up):
                for part, made in zip(history.parts, history.at(time, 1.0), strict=True):
                    part.check_formulas(made, bodies)
        held.reach(step.supports)
        acting.reach(step.loads)
        wetting.update(step.fluids)
        equal.update(step.constraints)
        begin += duration
    return tuple(built)


@dataclass(frozen=True)
class _LoadHistory:
    """All loads, or all supports, within a step, as a function of time.

    `ways`: their values before the step and at its end, or as formulas in t.
    """

    parts: tuple[Any, ...]
    dim: int
    ways: tuple[tuple[Any, Any], ...]
    begin: float
    duration: float

    @property
    def varies(self) -> bool:
        """Whether a value is a formula in t."""
        return any(changes(end) for _, end in self.ways)

    def __call__(self, time: float) -> tuple[Any, ...]:
        """Return what the parts are at a time."""
        return self.at(time, (time - self.begin) / self.duration)

    def at(self, time: float, share: float) -> tuple[Any, ...]:
        """Return what the parts are at a time, after a share of the step."""
        values = [self._value(start, end, time, share) for start, end in self.ways]
        return tuple(part.build(self.dim, value) for part, value in zip(self.parts, values, strict=True))

    def _value(self, start: Any, end: Any, time: float, share: float) -> Any:
        """Return the value between those before the step and at its end, or of a formula in t."""
        if isinstance(start, tuple) and isinstance(end, tuple):
            return tuple(self._value(a, b, time, share) for a, b in zip(start, end, strict=False))
        if changes(end):
            return at_time(end, time)
        if share == 1.0 or start is None or end is None:
            return end
        return between(_whole(at_time(start, self.begin)), _whole(end), share)


class _Values:
    """The values of all supports or loads as they are in the file; steps change those with names."""

    def __init__(self, names: Sequence[str | None], values: Sequence[Any]) -> None:
        self._values = dict(enumerate(values))
        self._place = {name: place for place, name in enumerate(names) if name}

    def ways(self, changed: Mapping[str, Any]) -> tuple[tuple[Any, Any], ...]:
        """Return the values before a step and at its end, in the order of the file."""
        ends = {**self._values, **{self._place[name]: value for name, value in changed.items()}}
        return tuple((start, ends[place]) for place, start in self._values.items())

    def reach(self, changed: Mapping[str, Any]) -> None:
        """Replace the values that a step has changed."""
        self._values.update({self._place[name]: value for name, value in changed.items()})


def _whole(value: Any) -> Any:
    return VectorExpression(value) if isinstance(value, tuple) else value


def _require_few(steps: Sequence[StepPart]) -> None:
    count = sum(step.count for step in steps)
    if count > MOST:
        raise InvalidInputError(
            f"a file may have at most {MOST} load steps, got {count}: take larger steps, or use LoadSequence"
        )


FileKind: TypeAlias = Literal["vtu", "xdmf", "csv"]
DesignFileKind: TypeAlias = Literal["csv", "stl", "step"]
PictureKind: TypeAlias = Literal["stress", "pressure", "status", "decomposition", "error"]
_ByRegion = Annotated[dict[str, str], Field(min_length=1)]
Materials: TypeAlias = Annotated[
    Any,
    Read(Annotated[str | _ByRegion, with_message("the name of a material, or a table: region = material")]),
]


class UnitNames(Part):
    """Names of the units of all numbers of the file; labels use them, nothing is converted."""

    length: str = Field(default="mm", description="unit of coordinates and displacements")
    force: str = Field(default="N", description="unit of forces")
    stress: str = Field(default="MPa", description="unit of stresses, moduli and pressures: force / length²")


class MadeOf(Part):
    """What is made of materials, and of which, in words."""

    kind_of_material: ClassVar[str] = "a material"
    material: Materials = Field(
        description="name of a material of [materials], or one for each region of the mesh"
    )


class BodyPart(MadeOf):
    """A body: a mesh and what it is made of."""

    mesh: str = Field(description="name of a mesh of [meshes]")
    part: str | None = Field(
        None, description="which body of a mesh that has several, such as a group of a file"
    )
    axisymmetric: bool = Field(
        False, description="whether a plane mesh is half the section (r, z) of a body of revolution"
    )
    torsion: bool = Field(
        False, description="whether a body of revolution may twist: a third component, around the axis"
    )
    integration: Literal["full", "reduced", "stabilised", "rows"] = Field(
        "full",
        description="reduced: cells of 20 or 8 nodes by 2 points in each direction; stabilised: with one "
        "thousandth of full, for rows of single cells; rows: by 2 points along the first direction alone",
    )


class OutputPart(Part):
    """What is written, and where."""

    folder: PlaceOfFile | None = Field(
        default=None,
        description="folder of the results, relative to where the command runs (output/NAME of the file)",
    )
    files: list[FileKind] = Field(
        default=["vtu"], description="fields for ParaView; csv: tables of contact points and load steps"
    )
    design: list[DesignFileKind] = Field(
        default=["csv"],
        description="files of an optimised surface: a table, the body as triangles, for CAD programs",
    )
    pictures: list[PictureKind] = Field(default=["stress"], description="pictures as PNG files")
    fields: list[Line] = Field(
        default=[], description="names of fields that are drawn as well, such as displacement_z"
    )
    checkpoint: bool = Field(
        default=True, description="keep a file from which interrupted load steps or optimisations go on"
    )

    @property
    def drawn(self) -> list[str]:
        """Names of all pictures, those of fields last."""
        return [*self.pictures, *self.fields]

    @property
    def field_files(self) -> list[FileKind]:
        """Kinds of ``files`` that hold fields."""
        return [kind for kind in self.files if kind != "csv"]


class Document(Part):
    """A scene of fenics_contact: bodies that may touch, what holds and loads them, how it is solved."""

    title: str = Field("", description="title of pictures and tables")
    units: UnitNames = Field(UnitNames(), description="names of the units, for labels")
    meshes: dict[str, Mesh] = Field(min_length=1, description="meshes by name: shapes, or files")
    materials: dict[str, AnyMaterial] = Field(min_length=1, description="materials by name")
    bodies: dict[str, BodyPart] = Field(min_length=1, description="bodies by name")
    supports: list[AnySupportPart] = Field([], description="prescribed displacements")
    loads: list[AnyLoad] = Field([], description="forces and changes of temperature")
    contacts: list[ContactPart] = Field([], description="pairs that may touch")
    automatic_contact: AutomaticPart | None = Field(
        None, description="pairs that are found where boundaries face each other, in place of [[contacts]]"
    )
    ties: list[AnyTiePart] = Field([], description="pairs that stay together")
    preloads: list[PreloadPart] = Field([], description="bolts drawn together at a section")
    foundations: list[FoundationPart] = Field([], description="surfaces on springs to the ground")
    springs: list[SpringPart] = Field([], description="springs between surfaces")
    constraints: list[ConstraintPart] = Field([], description="equations between displacements of nodes")
    steps: list[StepPart] = Field([], description="load steps; without them all acts at once")
    solver: SolverPart = Field(SolverPart(), description="how it is solved")
    accuracy: AccuracyPart | None = Field(
        None, description="a quantity and its largest error, to which meshes are refined"
    )
    output: OutputPart = Field(OutputPart(), description="what is written, and where")
    design: DesignPart | None = Field(None, description="a shape optimisation, for `fenics-contact optimize`")
    heat: None = Field(None, description="what bodies conduct, in files with [bodies.NAME.heat]")
    #: Names of a section, by what they must be in words.
    known: ClassVar[Mapping[str, Collection[str]]] = {}

    def misfits(self) -> Iterator[tuple[Keys, str]]:
        """Yield keys that do not go with others, and why."""
        yield from ()


def references(document: Document) -> Iterator[tuple[Keys, str]]:
    """Yield the references of a scene file to Python files, with their keys: all of these files are run."""
    for name, material in document.materials.items():
        if is_reference(material.model):
            yield ("materials", name, "model"), material.model
    if document.accuracy is not None and is_reference(document.accuracy.quantity):
        yield ("accuracy", "quantity"), document.accuracy.quantity
    for path, objective in parts_of(document.design, OwnObjective, ("design",)):
        yield path, objective.reference


def refused_python(source: Source, document: Document) -> list[Mistake]:
    """Return a mistake for every reference of a scene file to a Python file."""
    return [
        source.mistake(
            path,
            f"{written(path)} must not be Python code (--no-python), got {as_toml(reference)}: read that "
            "file, and leave --no-python out if you trust it",
        )
        for path, reference in references(document)
    ]
