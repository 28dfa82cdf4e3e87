"""What a scene must offer to be studied: how it is built, what is measured, and what theory says."""

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
    """What one run solves.

    Attributes:
        scene: The scene.
        steps: Load steps; none: the scene as it is, at once.
        design: A surface by whose control points the total potential is differentiated, or None.
    """

    scene: Scene
    steps: Sequence[LoadStep] = ()
    design: SurfaceDesign | None = None


@dataclass(frozen=True)
class Outcome:
    """What one run found; everything in it is replicated or collective.

    Attributes:
        problem: What was solved.
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
        """Return where the contact points lie before the load, shape (n, dim), [length]."""
        return self.state.contact_places


#: A number, or several that are judged together by their Euclidean norm.
Value: TypeAlias = float | np.ndarray
Measure: TypeAlias = Callable[[Outcome], Value]


@dataclass(frozen=True)
class Quantity:
    """Something a user wants to know to a certain accuracy.

    Attributes:
        name: In words, "peak pressure".
        unit: Its unit, empty for a ratio.
        value: Measures it. Called by all ranks together; returns the same on each.
        exact: The true value: a number, or a function of the outcome where theory takes measured forces;
            None where the study must extrapolate.
        source: What the true value is from, in a few words.
        rate: Power of the mesh size with which theory lets the error fall, None where it says nothing.
        phases: What must be done beside the state to know it, such as "adjoint": its time counts.
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
    """A scene whose accuracy is studied, with everything that a study needs to know about it.

    Attributes:
        name: Short name, part of file names.
        title: For headings.
        build: Builds the problem of a run; collective on the communicator.
        quantities: What is measured; the first is the main one.
        sweep: Runs of a study.
        quick: Runs of a study of about a minute.
        size_name: What `Parameters.size` counts, "cells on the contact radius".
        spacing: Mesh size h by `Parameters.size`, in the unit below.
        spacing_unit: Unit of h.
        energy_rate: Power of h with which theory lets the error fall in energy norm: 1 for linear elements,
            less where the solution has a singularity.
        about: What a reader must know of the scene, in a few sentences.

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
        """Refuse a scene without anything to measure, and names that files or tables cannot bear."""
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
        """What the results need to know about the scene, without its functions."""
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
    """A quantity in stored results: as `Quantity`, the source being empty where no true value is known."""

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
