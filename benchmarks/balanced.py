"""What a balanced tolerance costs beside fixed ones, and what it gives: `python -m benchmarks.balanced`.

Products with F, processor seconds of the whole state (matrices, factors, solver, errors), the errors, and
the peak pressure against that of the finest fixed tolerance.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from time import process_time

import numpy as np
from mpi4py import MPI

from benchmarks.cases.scenes import block_mesh, block_on_plane
from fenics_contact.accuracy import Balanced
from fenics_contact.contact import ContactProblem, State, solve_steps
from fenics_contact.gallery import half_cylinder, hemisphere, rectangle_lattice
from fenics_contact.mesh import BodyMesh
from fenics_contact.partition import bisection_partition, box_partition
from fenics_contact.scene import (
    Body,
    ContactPair,
    Coulomb,
    IsotropicElasticity,
    LoadStep,
    PlaneStrain,
    RigidPlane,
    Scene,
    Support,
    Surface,
    TotalForce,
)
from fenics_contact.study.scenes.chain_links import chain, graded_links
from fenics_contact.study.words import table

TOLERANCES: tuple[Balanced | float, ...] = (Balanced(), 1e-6, 1e-8)
Partition = dict[str, np.ndarray] | None
AT_ONCE = (LoadStep("all at once"),)


@dataclass(frozen=True)
class Measured:
    """A scene with its load steps and partition."""

    scene: Scene
    partition: Partition
    steps: Sequence[LoadStep] = AT_ONCE


def pressed(mesh: BodyMesh, guides: Mapping[str, tuple[float | None, ...]], force: float) -> Measured:
    """Press a round body on a rigid plane, without friction."""
    scene = Scene(
        {"body": Body(mesh, IsotropicElasticity(1000.0, 0.3))},
        [Support("body", side, value) for side, value in guides.items()],
        [TotalForce("body", "top", (0.0, 0.0, -force))],
        [ContactPair(Surface("body", "contact"), RigidPlane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)))],
    )
    return Measured(scene, {"body": bisection_partition(mesh, max(2, mesh.n_cells // 500))})


def hertz_ball(n: int) -> Measured:
    """A quarter of a ball with n cells to the edge of the contact, as the tests of convergence press it."""
    edge = np.sin(np.pi / 4 * np.expm1(0.75) / np.expm1(3.0))
    force = 4 * 1000.0 / (1 - 0.3**2) * edge**3 / 3
    return pressed(
        hemisphere(1.0, n, grading=3.0), {"x0": (0.0, None, None), "y0": (None, 0.0, None)}, force / 4
    )


def hertz_cylinder(n: int) -> Measured:
    """A slice of half a cylinder with n cells to the edge of the contact."""
    edge = np.sin(np.pi / 4 * np.expm1(1.25) / np.expm1(5.0))
    force = np.pi * 1000.0 / (1 - 0.3**2) * edge**2 / 4
    guides = {"x0": (0.0, None, None), "y0": (None, 0.0, None), "y1": (None, 0.0, None)}
    return pressed(half_cylinder(1.0, 0.05, n, grading=5.0), guides, force * 0.05 / 2)


def cattaneo_mindlin(n: int) -> Measured:
    """Two cylinders pressed and then sheared, with n cells on half the contact."""

    def ticks(fine: float) -> np.ndarray:
        count = int(np.ceil(np.log1p(30.0 - fine) / np.log1p(1 / n)))
        tail = np.cumsum((1 + 1 / n) ** np.arange(count))
        return np.concatenate(
            [np.linspace(0.0, fine, round(fine * n) + 1), fine + (30.0 - fine) * tail / tail[-1]]
        )

    def half(side: float) -> BodyMesh:
        across, down = ticks(1.25), ticks(1 / n)
        lines = [np.concatenate([-across[:0:-1], across]), down if side > 0 else -down[::-1]]
        mesh = rectangle_lattice(lines)
        x, y = mesh.points.T
        return mesh.moved(np.column_stack([x, y + side * x**2 / 4000.0 * (1 - np.abs(y) / 30.0)]))

    material = PlaneStrain(1000.0, 0.3)
    pair = ContactPair(Surface("upper", "y0"), Surface("lower", "y1"), Coulomb(0.4))
    bodies = {"upper": Body(half(1), material), "lower": Body(half(-1), material)}
    base = Support("lower", "y0", (0.0, 0.0))
    steps = [
        LoadStep(f"{shift:g}", supports=[base, Support("upper", "y1", (shift, -0.00205))])
        for shift in (0.0, 0.000735)
    ]
    return Measured(Scene(bodies, contacts=[pair]), None, steps)


def links(cells: tuple[int, int, int]) -> Measured:
    """The two links of the demo, with friction."""
    scene = chain(graded_links(cells, MPI.COMM_SELF))
    return Measured(scene, {name: box_partition(body.mesh, (8, 1, 2)) for name, body in scene.bodies.items()})


def block(counts: tuple[int, int, int]) -> Measured:
    """The block of the benchmark, dragged over a plane with friction."""
    mesh = block_mesh(counts)
    return Measured(block_on_plane(mesh, 0.3), {"block": box_partition(mesh, (4, 2, 2))})


SCENES: dict[str, Callable[[], Measured]] = {
    "ball": lambda: hertz_ball(8),
    "cylinder": lambda: hertz_cylinder(16),
    "cattaneo-mindlin": lambda: cattaneo_mindlin(16),
    "links": lambda: links((36, 6, 14)),
    "links of the paper": lambda: links((48, 8, 20)),
    "block": lambda: block((32, 16, 16)),
}


def rows(name: str) -> list[tuple[str, ...]]:
    """Return one row of the table for each tolerance."""
    case, found = SCENES[name](), []
    for tolerance in (TOLERANCES[1], *TOLERANCES):  # the first time warms up
        start = process_time()
        states = solve_steps(
            ContactProblem(case.scene, MPI.COMM_SELF, partitions=case.partition, tolerance=tolerance),
            case.steps,
        )
        found.append((tolerance, states, process_time() - start))
    exact = peak(found[-1][1][-1])
    return [row(name, *entry, exact) for entry in found[1:]]


def row(
    name: str, tolerance: Balanced | float, states: Sequence[State], seconds: float, exact: float
) -> tuple[str, ...]:
    """Return one row of the table."""
    last, products = states[-1], sum(state.counts["f_products"] for state in states)
    errors = last.errors
    return (
        name,
        "balanced" if isinstance(tolerance, Balanced) else f"{tolerance:.0e}",
        str(last.counts["torn_unknowns"]),
        str(products),
        f"{seconds:.2f}",
        f"{last.seconds.get('errors', 0.0):.2f} of {sum(last.seconds.values()):.2f}",
        *(f"{value:.1e}" for value in (errors.algebraic, errors.friction, errors.discretisation)),
        f"{peak(last) / exact - 1.0:+.1e}",
    )


def peak(state: State) -> float:
    """Return the largest contact pressure."""
    return float(state.contact.pressure.max())


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.balanced", description=__doc__)
    parser.add_argument("scenes", nargs="*", choices=[*SCENES, []], default=[], help="all by default")
    chosen = parser.parse_args(arguments).scenes or list(SCENES)
    head = ["scene", "tolerance", "unknowns", "products", "CPU [s]", "errors' wall [s]", "algebraic"]
    head += ["friction", "discretisation", "peak pressure"]
    print(table(head, [line for name in chosen for line in rows(name)]))


if __name__ == "__main__":
    main()
