"""The earlier states that a solution goes on from, and what is wanted of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from fenics_contact._equilibrium.carried import TransferredState
from fenics_contact._equilibrium.other_rows import (
    continued,
    has_rows_of,
    kept_by_joints,
    on_rows_of,
    with_kept,
)
from fenics_contact._equilibrium.outer_loops import outer_loops
from fenics_contact._equilibrium.starts import NoStart, Start, checked_start
from fenics_contact._equilibrium.stored import Stored
from fenics_contact._scene.scene import LoadStep, Scene
from fenics_contact.feti.torn import TornSystem, build_torn_system, with_points_inside
from fenics_contact.mesh.refinement import Refinement
from fenics_contact.results.dual_solve import sticking
from fenics_contact.results.state import State, Tolerance

if TYPE_CHECKING:
    from fenics_contact.results.deformed_state import AnyState


#: That of a solution outside of load steps.
ONLY_STEP = LoadStep("")


@dataclass(frozen=True, eq=False)
class Wanted:
    """What is wanted of a solution.

    `tolerance`: its accuracy; `step`: the load step; `design`: whether it is the state of a design, of which
    derivatives are wanted.
    """

    tolerance: Tolerance
    step: LoadStep
    design: bool

    @property
    def time(self) -> float:
        """The time at the end, 1 by default."""
        return 1.0 if self.step.time is None else self.step.time

    @property
    def where(self) -> str:
        """The load step in words that begin a message."""
        return "" if self.step is ONLY_STEP else f"load step {self.step.name!r}: "


class Equilibria(Protocol):
    """What finds equilibria of scenes: directly, by multipliers, or along a path of loads."""

    def solve(self, scene: Scene, previous: Previous, wanted: Wanted) -> AnyState:
        """Compute the equilibrium of a scene. Collective."""

    def restored(self, stored: Stored, scene: Scene, known: State | None) -> AnyState:
        """Build a state from what was stored of it. Collective; `known`: of which parts may be reused."""


class Undeformed:
    """Bodies at rest, before the first load step."""

    #: The state at the end of the load step before, also on other meshes.
    last = None
    #: The same on the meshes of the scene, from which its solution starts.
    here = None

    def check(self, scene: Scene) -> None:
        """Reject what cannot be carried to the meshes of a scene."""

    def slipped(self, begun: Any) -> tuple[Any, np.ndarray]:
        """Return contact of bodies that deform much, and the slip there before the load step. Collective.

        `begun`: the contact where the step begins.
        """
        points = begun.torn.points
        return begun, np.zeros((points.count, points.tangents.shape[1]))

    def kept(self, scene: Scene) -> Scene:
        """Return a scene with what supports and joints keep from the load step before. Collective."""
        return continued(scene, {})

    def with_slip(self, torn: TornSystem) -> TornSystem:
        """Return a system that measures slip from the load step before. Collective."""
        return torn


@dataclass(frozen=True, eq=False)
class AfterState:
    """A load step after a state on the meshes of the scene."""

    last: State

    @property
    def here(self) -> State:
        return self.last

    def check(self, scene: Scene) -> None:
        for loop in outer_loops(self.last.scene):
            loop.check(self.last, scene)

    def slipped(self, begun: Any) -> tuple[Any, np.ndarray]:
        before: Any = self.last
        return before.equilibrium.evaluation.contact, before.contact.total_slip

    def kept(self, scene: Scene) -> Scene:
        return continued(with_kept(scene, self.last), kept_by_joints(self.last))

    def with_slip(self, torn: TornSystem) -> TornSystem:
        before = self.last
        if has_rows_of(before, torn):
            was, multiplier = before.torn, before.solution.multiplier
            sticks = sticking(was, before.rows) if was.tangential_rows.size else False
        else:
            (was, multiplier), sticks = on_rows_of(before, torn), False
        return torn.with_slip_from(*was.slip_origin(before.torn_displacement, multiplier, sticks))


@dataclass(frozen=True, eq=False)
class AfterTransfer:
    """A load step after a state on other meshes."""

    before: TransferredState

    here = None

    @property
    def last(self) -> State:
        return self.before.state

    def check(self, scene: Scene) -> None:
        self.before.check(scene)

    def slipped(self, begun: Any) -> tuple[Any, np.ndarray]:
        return begun, self.before.slip_at(begun.torn)

    def kept(self, scene: Scene) -> Scene:
        return continued(scene, kept_by_joints(self.before.state))

    def with_slip(self, torn: TornSystem) -> TornSystem:
        scene = self.before.scene_on(torn.scene)
        was = build_torn_system(scene, torn.decomposition, overlap=True, previous=torn)
        return torn.with_slip_from(*self.before.slip_origin(with_points_inside(was, torn)))


#: What a load step goes on from.
Before = Undeformed | AfterState | AfterTransfer


def after(before: State | TransferredState | None) -> Before:
    """Return what a load step goes on from."""
    if before is None:
        return Undeformed()
    return AfterTransfer(before) if isinstance(before, TransferredState) else AfterState(before)


@dataclass(frozen=True, eq=False)
class Previous:
    """Earlier states.

    `before`: at the end of the load step before: slip is measured from there, and histories go on; `start`:
    whose multipliers come first; `known`: of which parts may be reused; None: nothing.
    """

    before: Before
    start: Start = field(default_factory=NoStart)
    known: State | None = None

    @property
    def last(self) -> State | None:
        """The state at the end of the load step before, on its meshes."""
        return self.before.last

    def starting(
        self, scene: Scene, first: State | None, refinements: Mapping[str, Refinement] | None
    ) -> Previous:
        """Return them with the start that a state gives, by default that of the load step before."""
        return replace(self, start=checked_start(scene, first or self.before.here, refinements))

    def reusing(self, scene: Scene, last: State | None) -> Previous:
        """Return them with what may be reused: the last state with the scene's meshes, else the start."""
        known = self.start.here
        if known and last and scene.has_meshes_of(last.scene):
            known = last
        return replace(self, known=known)
