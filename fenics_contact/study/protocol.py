"""What a scene must provide for a study: construction, measured quantities, and theoretical values."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import TypeAlias

import numpy as np

from fenics_contact._libraries import MPI
from fenics_contact.contact import State
from fenics_contact.errors import InvalidInputError
from fenics_contact.scene import LoadStep, Scene
from fenics_contact.shape import SurfaceDesign
from fenics_contact.study.parameters import Parameters, Sweep


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
        problem: The solved problem.
        states: States at the end of every load step.
        parameters: Settings of the run.
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
            raise InvalidInputError("a study needs at least one quantity, got none: say what is measured")
        names = [quantity.name for quantity in self.quantities]
        if len(set(names)) < len(names):
            raise InvalidInputError(f"quantities must have different names, got {names}: rename one")
        if not self.name.replace("_", "").isalnum():
            raise InvalidInputError(
                f"the name of a study is part of file names, got {self.name!r}: use letters, digits and _"
            )

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
