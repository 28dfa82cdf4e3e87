"""Problems of large deformations, on meshes of half the size each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from time import process_time

import numpy as np
from mpi4py import MPI

from benchmarks.others.rows import Row
from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    LoadStep,
    RigidPlane,
    Scene,
    Support,
    Surface,
    gallery,
    solve_steps,
)
from fenics_contact.materials import MooneyRivlin
from fenics_contact.mesh import quadratic
from fenics_contact.results.deformed_state import AnyState


@dataclass(frozen=True)
class Path:
    """A quantity along load steps, on several meshes.

    Attributes:
        scene: Makes the scene by the fineness of its mesh, a power of two.
        steps: The load steps.
        measure: Returns the quantity of a state.
        finest: Largest fineness; a quarter and half of it are solved, too.
    """

    scene: Callable[[int], Scene]
    steps: Sequence[LoadStep]
    measure: Callable[[AnyState], float]
    finest: int

    def values(self) -> tuple[np.ndarray, int, int, float]:
        """Return the quantity by mesh and step, unknowns and Newton steps of the last, processor seconds."""
        began, found = process_time(), []
        for fineness in (self.finest // 4, self.finest // 2, self.finest):
            scene = self.scene(fineness)
            states = solve_steps(ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-8), self.steps)
            found.append([self.measure(state) for state in states])
        unknowns = 2 * sum(body.mesh.n_nodes for body in scene.bodies.values())
        steps = sum(state.solution.iterations for state in states)
        return np.array(found), unknowns, steps, process_time() - began


def rubber_cylinder(fineness: int) -> Scene:
    """A quarter of a rubber cylinder of diameter 400 mm above the lower of two rigid plates, plane strain."""
    disc = quadratic(gallery.half_disc(200.0, fineness, grading=0.5))
    skin = np.concatenate([disc.surfaces["contact"], disc.surfaces["side"]])
    shapes = {"skin": disc.shapes["contact"]}
    disc = replace(
        disc, surfaces={"skin": skin, "x0": disc.surfaces["x0"], "top": disc.surfaces["top"]}, shapes=shapes
    )
    rubber = MooneyRivlin(0.293, 0.177, 1410.0, mean_dilatation=True)
    plate = ContactPair(Surface("cylinder", "skin"), RigidPlane((0.0, 0.0), (0.0, 1.0)))
    return Scene({"cylinder": Body(disc, rubber)}, [Support("cylinder", "x0", (0.0, None))], contacts=[plate])


def closed(way: float) -> LoadStep:
    """Return the step in which plates are closer by a way: the plane between them moves half of it."""
    held = [Support("cylinder", "x0", (0.0, None)), Support("cylinder", "top", (None, -0.5 * way))]
    return LoadStep(f"{way:g} mm", supports=held)


def rubber_rows() -> list[Row]:
    """The cylinder of Sussman and Bathe: force per length by closing."""
    printed = {60.0: 0.1, 100.0: 0.26, 140.0: 0.5, 175.0: 0.9, 200.0: 1.4}
    path = Path(
        rubber_cylinder, [closed(way) for way in printed],
        lambda state: 2e-3 * float(state.contact.normal_force.sum()), 16,
    )  # fmt: skip
    others = {200.0: "solids4foam, finite volumes 1.27"}
    return _rows(
        path,
        {
            f"force at {way:g} mm [kN/mm]": (force, "Sussman and Bathe, off a plot", 0.1, others.get(way, ""))
            for way, force in printed.items()
        },
    )


def _rows(path: Path, known: dict[str, tuple[float, str, float, str]]) -> list[Row]:
    """Return a row for each step, whose bar is what the last halving of the cells has changed."""
    values, unknowns, steps, seconds = path.values()
    return [
        Row(
            quantity, values[-1, k], abs(values[-1, k] - values[-2, k]), reference, source, margin, others,
            unknowns, steps, seconds / len(known), tuple((float(value), 0) for value in values[:, k]),
        )
        for k, (quantity, (reference, source, margin, others)) in enumerate(known.items())
    ]  # fmt: skip
