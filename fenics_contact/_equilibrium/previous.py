"""The earlier states that a solution goes on from, and what is wanted of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np

from fenics_contact._equilibrium.carried import TransferredState
from fenics_contact._equilibrium.other_rows import (
    continued,
    has_rows_of,
    kept_by_joints,
    on_rows_of,
    with_kept,
)
from fenics_contact._equilibrium.starts import CoarseStart, checked_start
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


@dataclass(frozen=True, eq=False)
class Previous:
    """Earlier states.

    `before`: at the end of the load step before, also on other meshes: slip is measured from there, and
    histories go on; None: the undeformed bodies; `start`: whose multipliers come first, also on coarser
    meshes; None: zero; `known`: of which parts may be reused; None: nothing.
    """

    before: State | TransferredState | None = None
    start: State | CoarseStart | None = None
    known: State | None = None

    @property
    def last(self) -> State | None:
        """The state at the end of the load step before, on its meshes."""
        return self.before.state if isinstance(self.before, TransferredState) else self.before

    @property
    def is_coarser(self) -> bool:
        """Whether the start is on coarser meshes."""
        return isinstance(self.start, CoarseStart)

    def check(self, scene: Scene) -> None:
        """Reject what cannot be carried to the meshes of a scene."""
        if isinstance(self.before, TransferredState):
            self.before.check(scene)

    def kept(self, scene: Scene) -> Scene:
        """Return a scene with what supports and joints keep from the load step before. Collective."""
        last = self.last
        if last is self.before:
            scene = with_kept(scene, last)
        return continued(scene, {} if last is None else kept_by_joints(last))

    def starting(
        self, scene: Scene, first: State | None, refinements: Mapping[str, Refinement] | None
    ) -> Previous:
        """Return them with the start that a state gives, by default that of the load step before."""
        own = self.last if self.last is self.before else None
        return replace(self, start=checked_start(scene, first or own, refinements))

    def reusing(self, scene: Scene, last: State | None) -> Previous:
        """Return them with what may be reused: the last state with the scene's meshes, else the start."""
        known = None if isinstance(self.start, CoarseStart) else self.start
        if known is not None and last is not None and scene.has_meshes_of(last.scene):
            known = last
        return replace(self, known=known)

    def with_slip(self, torn: TornSystem) -> TornSystem:
        """Return a system that measures slip from the load step before. Collective."""
        return torn if self.before is None else torn.with_slip_from(*_slip_origin(self.before, torn))


def _slip_origin(before: State | TransferredState, torn: TornSystem) -> tuple[np.ndarray, np.ndarray]:
    if isinstance(before, TransferredState):
        scene = before.scene_on(torn.scene)
        was = build_torn_system(scene, torn.decomposition, overlap=True, previous=torn)
        return before.slip_origin(with_points_inside(was, torn))
    if has_rows_of(before, torn):
        own = before.torn
        sticks = sticking(own, before.rows) if own.tangential_rows.size else False
        return own.slip_origin(before.torn_displacement, before.solution.multiplier, sticks)
    was, multiplier = on_rows_of(before, torn)
    return was.slip_origin(before.torn_displacement, multiplier)
