"""Blocks pressed, pushed forth and back and let go in load steps; as a script, on the ranks of this run."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    ContactProblem,
    Coulomb,
    LoadStep,
    RigidSurface,
    Scene,
    ShapeProblem,
    Support,
    Surface,
    SurfaceDesign,
    Traction,
)
from fenics_contact.design import FrictionWork, LoadPath, Objective
from tests.design.blocks import block_on_block, block_on_floor, designs_of
from tests.design.chains import SOLVER
from tests.design.mortar_lines import by_mortar
from tests.design.plane_blocks import on_block, on_obstacle
from tests.design.quotients import Way
from tests.scenes import AnySupport, partitions

Steps = Sequence[tuple[str, tuple[float, ...]]]
#: Loads on the top of plane blocks: pressed, pushed until some points slip, pulled back, half unloaded.
PLANE: Steps = [
    ("press", (0.0, -2.0)), ("push", (0.45, -2.0)), ("back", (-0.2, -2.2)), ("let go", (0.05, -1.2)),
]  # fmt: skip
#: Slip that turns, too.
SPACE: Steps = [("press", (0.0, 0.0, -2.0)), ("push", (0.4, 0.1, -2.0)), ("turn", (-0.1, 0.35, -1.7))]


def loaded(body: str, surface: str, steps: Steps, scene: Scene) -> list[LoadStep]:
    """Tractions on a surface beside the scene's other loads."""
    others = list(scene.loads)[1:]
    return [LoadStep(name, loads=[Traction(body, surface, value), *others]) for name, value in steps]


SCENES: dict[str, Callable[[], Scene]] = {
    "floor": lambda: on_obstacle(Coulomb(0.3), "quadrilateral"),
    "blocks": lambda: on_block(Coulomb(0.3), "quadrilateral"),
    "mortar": lambda: by_mortar(on_block(Coulomb(0.3), "triangle")),
    "springs": lambda: on_obstacle(Coulomb(0.3, stick_stiffness=200.0), "quadrilateral"),
    "space": lambda: block_on_floor(Coulomb(0.3), load=(0.0, 0.0, -2.0)),
    "space, mortar": lambda: by_mortar(block_on_block(Coulomb(0.38), load=(0.0, 0.0, -2.0))),
}
#: Forces on a rigid surface that is free to move.
FORCES: Steps = [("press", (0.0, 0.0)), ("push", (2.4, 0.1)), ("back", (-2.0, 0.3)), ("let go", (0.3, 0.0))]


def beam() -> tuple[Scene, list[LoadStep]]:
    """Two plane blocks, the lower of which is pulled at a rigid end that carries part of the contact."""
    scene = SCENES["blocks"]()

    def supports(force: tuple[float, ...]) -> list[AnySupport]:
        end = RigidSurface("lower", "x1", (2.0, -0.5), (None, None), None, force=force)
        return [Support("lower", "x0"), end]

    steps = [LoadStep(name, supports=supports(force)) for name, force in FORCES]
    return replace(scene, supports=steps[0].supports), steps


def path_of(
    name: str, comm: MPI.Comm = MPI.COMM_SELF, objectives: Mapping[str, Objective] | None = None
) -> LoadPath:
    """The scene of that name under its load steps; J is the work of friction unless given."""
    if name == "beam":
        scene, steps = beam()
    else:
        scene = SCENES[name]()
        body, plane = "upper" if "upper" in scene.bodies else "block", scene.dim == 2
        steps = loaded(body, "y1" if plane else "z1", PLANE if plane else SPACE, scene)
    contact = ContactProblem(scene, comm, partitions=partitions(scene), solver=SOLVER)
    return LoadPath(ShapeProblem(contact, moved(scene), FrictionWork()), steps, objectives)


def moved(scene: Scene) -> tuple[SurfaceDesign, ...]:
    """All contact surfaces of a scene but those that a support holds."""
    if scene.dim == 3:
        return designs_of(scene)
    (pair,) = scene.contacts
    if any(isinstance(support, RigidSurface) for support in scene.supports):
        return (SurfaceDesign(pair.slave.body, pair.slave.name, 5),)
    sides = [side for side in (pair.slave, pair.master) if isinstance(side, Surface)]
    return tuple(SurfaceDesign(side.body, side.name, 5) for side in sides)


class PathLine(Way[LoadPath]):
    """Designs of one path, judged by its objectives."""

    def value(self, multiple: float) -> float:
        return self.problem.value_of(self.at(multiple))

    def slope(self) -> float:
        """The adjoints' directional derivative."""
        return float(self.problem(self.alpha)[1] @ self.direction)

    def quotient(self) -> float:
        """The central difference quotient."""
        return self.quotient_of(self.value)

    def taylor_rate(self) -> float:
        """Order at which J(α + s v) − J(α) − s J'(α; v) vanishes with s."""
        return self.rate_of(self.value, self.slope())


def line_of(path: LoadPath) -> PathLine:
    alpha = 0.004 * np.random.default_rng(1).standard_normal(path.size)
    return PathLine(path, alpha, np.random.default_rng(6).standard_normal(path.size), 1e-5)


if __name__ == "__main__":
    here = line_of(path_of(sys.argv[1], MPI.COMM_WORLD))
    value, gradient = here.problem(here.alpha)
    if MPI.COMM_WORLD.rank == 0:
        print(value, *gradient)
