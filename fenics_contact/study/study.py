"""Settings of runs, and what a scene of a study provides."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from itertools import product
from typing import Any, Literal, TypeAlias

import numpy as np

from fenics_contact._base.libraries import MPI
from fenics_contact._scene.pairs import Discretisation
from fenics_contact._scene.scene import LoadStep, Scene
from fenics_contact.design.design import SurfaceDesign
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.cell_types import CELL_TYPES
from fenics_contact.results.state import State

#: The tolerance that follows the discretisation estimate.
BALANCED: Literal["balanced"] = "balanced"
#: A largest relative residual, or "balanced".
RunTolerance: TypeAlias = float | Literal["balanced"]

#: Discretisations of contact, see `ContactPair`.
DISCRETISATIONS = ("node", "mortar")
#: How Coulomb's law is solved: within every Newton step, or by an outer loop of Tresca problems.
SOLVERS = ("newton", "fixed point")


@dataclass(frozen=True)
class Parameters:
    """The settings that may differ between two runs of a study.

    Attributes:
        size: Mesh resolution in the scene's own count: cells on the contact radius, for instance.
        cell: Type of the cells, a key of `geometry.CELL_TYPES`.
        discretisation: "node" or "mortar", see `ContactPair`.
        tolerance: Largest relative residual, or "balanced".
        solver: "newton" (`qp.FaceNewton`) or "fixed point" (`FixedPoint` around it).
        subdomains: Approximate number of subdomains; None: of a suitable size.
    """

    size: int
    cell: str = "hexahedron"
    discretisation: Discretisation = "node"
    tolerance: RunTolerance = BALANCED
    solver: str = "newton"
    subdomains: int | None = None

    def __post_init__(self) -> None:
        """Reject settings that no scene knows."""
        _require("size", self.size, isinstance(self.size, int) and self.size > 0, "a positive integer")
        _require("cell", self.cell, self.cell in CELL_TYPES, f"one of {sorted(CELL_TYPES)}")
        known = self.discretisation in DISCRETISATIONS
        _require("discretisation", self.discretisation, known, f"one of {list(DISCRETISATIONS)}")
        _require("solver", self.solver, self.solver in SOLVERS, f"one of {list(SOLVERS)}")
        fixed = isinstance(self.tolerance, float) and 0.0 < self.tolerance < 1.0
        allowed = 'a number between 0 and 1, or "balanced"'
        _require("tolerance", self.tolerance, fixed or self.tolerance == BALANCED, allowed)
        enough = self.subdomains is None or self.subdomains > 0
        _require("subdomains", self.subdomains, enough, "a positive integer, or None")

    @property
    def balanced(self) -> bool:
        """Whether the tolerance follows the discretisation estimate."""
        return self.tolerance == BALANCED

    def as_dict(self) -> dict[str, Any]:
        """Return the settings by name, ready for JSON."""
        return asdict(self)

    def __str__(self) -> str:
        """Return the settings in a few words."""
        words = [f"size {self.size}", self.cell, self.discretisation, self.tolerance_words]
        words += [] if self.solver == "newton" else [self.solver]
        words += [] if self.subdomains is None else [f"{self.subdomains} subdomains"]
        return ", ".join(words)

    @property
    def tolerance_words(self) -> str:
        """The tolerance as shown in tables and axes."""
        return str(self.tolerance) if isinstance(self.tolerance, str) else f"{self.tolerance:.0e}"

    def differences(self, other: Parameters) -> tuple[str, ...]:
        """Name the settings in which two runs differ."""
        mine, theirs = self.as_dict(), other.as_dict()
        return tuple(name for name in mine if mine[name] != theirs[name])

    def rank(self) -> tuple[int, float]:
        """Return a sort key: coarse before fine, loose before strict, balanced last."""
        return self.size, 0.0 if isinstance(self.tolerance, str) else -self.tolerance


def _require(name: str, given: object, holds: bool, allowed: str) -> None:
    if not holds:
        raise InvalidInputError(f"{name} must be {allowed}, got {given!r}: choose one of these")


@dataclass(frozen=True)
class Sweep:
    """The settings that a study varies: one at a time around a base, and mesh and tolerance together.

    Attributes:
        base: Settings around which one at a time is varied.
        sizes: Meshes, all with every tolerance, and with the base's other settings.
        tolerances: Tolerances of the Newton method.
        cells: Cell types, on all meshes.
        discretisations: Contact discretisations, on all meshes.
        fixed_points: Tolerances of the fixed point of Coulomb's law, on the base's mesh.
        subdomains: Numbers of subdomains, on the base's mesh.
    """

    base: Parameters
    sizes: tuple[int, ...]
    tolerances: tuple[RunTolerance, ...] = (BALANCED,)
    cells: tuple[str, ...] = ()
    discretisations: tuple[Discretisation, ...] = ()
    fixed_points: tuple[float, ...] = ()
    subdomains: tuple[int, ...] = ()

    def runs(self) -> tuple[Parameters, ...]:
        """Return all runs, each once, cheap ones first."""
        base = self.base
        settings = [base]
        settings += [replace(base, size=n, tolerance=t) for n, t in product(self.sizes, self.tolerances)]
        settings += [replace(base, size=n, cell=c) for n, c in product(self.sizes, self.cells)]
        settings += [
            replace(base, size=n, discretisation=d) for n, d in product(self.sizes, self.discretisations)
        ]
        settings += [replace(base, solver="fixed point", tolerance=t) for t in self.fixed_points]
        settings += [replace(base, subdomains=count) for count in self.subdomains]
        return tuple(sorted(dict.fromkeys(settings), key=Parameters.rank))


@dataclass(frozen=True)
class Problem:
    """The problem of one run.

    Attributes:
        scene: The scene.
        steps: Load steps; none: the scene in a single step.
        design: A surface by whose control points the total potential is differentiated, or None.
    """

    scene: Scene
    steps: Sequence[LoadStep] = ()
    design: SurfaceDesign | None = None


@dataclass(frozen=True)
class Outcome:
    """The result of one run; everything in it is replicated or collective.

    Attributes:
        states: States at the end of every load step.
        gradient: Derivative of the total potential by the design, shape (n_variables,); empty without one.
    """

    problem: Problem
    states: tuple[State, ...]
    parameters: Parameters
    gradient: np.ndarray = field(default_factory=lambda: np.zeros(0))

    @property
    def state(self) -> State:
        """The state at the end."""
        return self.states[-1]

    def slave_points(self) -> np.ndarray:
        """Return the initial positions of the contact points, shape (n, dim), [length]."""
        return self.state.contact_places


#: A number, or several that are compared by their Euclidean norm.
Value: TypeAlias = float | np.ndarray
Measure: TypeAlias = Callable[[Outcome], Value]


@dataclass(frozen=True)
class Quantity:
    """A quantity of interest.

    Attributes:
        name: Its name, such as "peak pressure".
        unit: Its unit, empty for a ratio.
        value: Evaluates it. Called by all ranks together; returns the same value on each.
        exact: The true value: a number, or a function of the outcome where theory uses measured forces; None
            where the study must extrapolate.
        source: Source of the true value, in a few words.
        rate: Theoretical convergence rate in the mesh size, None if unknown.
        phases: Phases needed in addition to the state, such as "adjoint": their time counts.
    """

    name: str
    unit: str
    value: Measure
    exact: float | Measure | None = None
    source: str = "theory"
    rate: float | None = None
    phases: tuple[str, ...] = ()


@dataclass(frozen=True)
class StudyScene:
    """A scene whose accuracy is studied, with all data that a study needs.

    Attributes:
        name: Short name, part of file names.
        title: Title for headings.
        build: Builds the problem of a run; collective on the communicator.
        quantities: The measured quantities; the first is the main one.
        sweep: Runs of a study.
        quick: Runs of a study of about a minute.
        size_name: Meaning of `Parameters.size`, "cells on the contact radius".
        spacing: Mesh size h by `Parameters.size`, in the unit below.
        spacing_unit: Unit of h.
        energy_rate: Theoretical convergence rate in energy norm: 1 for linear elements, less where the
            solution has a singularity.
        about: Description of the scene in a few sentences.

    Example:
        >>> study = StudyScene("bar", "A bar", build, (length,), sweep, sweep)  # doctest: +SKIP
    """

    name: str
    title: str
    build: Callable[[Parameters, MPI.Comm], Problem]
    quantities: tuple[Quantity, ...]
    sweep: Sweep
    quick: Sweep
    size_name: str = "cells along an edge"
    spacing: Callable[[int], float] = lambda size: 1.0 / size
    spacing_unit: str = ""
    energy_rate: float = 1.0
    about: str = ""

    def __post_init__(self) -> None:
        """Reject a scene without quantities, and names that are unsuitable for files or tables."""
        if not self.quantities:
            raise InvalidInputError("a study needs at least one quantity, got none: give what is measured")
        names = [quantity.name for quantity in self.quantities]
        if len(set(names)) < len(names):
            raise InvalidInputError(f"quantities must have different names, got {names}: rename one")
        if not self.name.replace("_", "").isalnum():
            raise InvalidInputError(f"a study's name must be of letters, digits and _, got {self.name!r}")

    @property
    def facts(self) -> SceneFacts:
        """The data of the scene for the results, without its functions."""
        runs = (*self.sweep.runs(), *self.quick.runs())
        quantities = tuple(
            QuantityFacts(q.name, q.unit, "" if q.exact is None else q.source, q.rate, q.phases)
            for q in self.quantities
        )
        spacing = {run.size: float(self.spacing(run.size)) for run in runs}
        known = {each.name: getattr(self, each.name) for each in fields(SceneFacts)}
        return SceneFacts(**known | {"spacing": spacing, "quantities": quantities})


@dataclass(frozen=True)
class QuantityFacts:
    """A quantity in stored results: as `Quantity`, with an empty source where no true value is known."""

    name: str
    unit: str
    source: str
    rate: float | None
    phases: tuple[str, ...] = ()


@dataclass(frozen=True)
class SceneFacts:
    """A scene in stored results: as `StudyScene`, with the mesh sizes that occur, by `Parameters.size`."""

    name: str
    title: str
    about: str
    size_name: str
    spacing_unit: str
    energy_rate: float
    spacing: Mapping[int, float]
    quantities: tuple[QuantityFacts, ...]

    def quantity(self, name: str) -> QuantityFacts:
        """Return the quantity of a name."""
        return next(quantity for quantity in self.quantities if quantity.name == name)
