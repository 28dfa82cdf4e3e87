"""What is solved again until it agrees with the solution: fronts of fluids, friction by slip, wear."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce

from fenics_contact._equilibrium.passes import OuterLoop, Passes, Solve
from fenics_contact._scene.scene import Scene
from fenics_contact.feti.torn import TornSystem
from fenics_contact.results.linear_state import LinearState
from fenics_contact.results.state import State


def outer_loops(scene: Scene) -> list[OuterLoop]:
    """Return those that a scene calls for, the innermost first."""
    loops: list[OuterLoop] = []
    if any(pair.fluid is not None for pair in scene.contacts):
        from fenics_contact._equilibrium.penetration import FluidFront

        loops.append(FluidFront(scene))
    if any(pair.slip_table is not None for pair in scene.contacts):
        from fenics_contact._equilibrium.slip_dependence import FrictionBySlip

        loops.append(FrictionBySlip())
    if scene.wears:
        from fenics_contact._equilibrium.wearing import Wearing

        loops.append(Wearing())
    return loops


def nested(
    loops: Sequence[OuterLoop],
    solve: Solve,
    known: LinearState | None,
    before: State | None,
) -> Solve:
    """Return the solution of a system inside all loops."""

    def around(inner: Solve, loop: OuterLoop) -> Solve:
        def solved(torn: TornSystem, last: LinearState | None, tolerance: float) -> LinearState:
            # In later passes of a loop outside, it goes on from where the pass before left it.
            latest = before if last is known else last
            return loop.solve(Passes(inner, last, latest), torn, before, tolerance)

        return solved

    return reduce(around, loops, solve)
