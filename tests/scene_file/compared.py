"""An example scene file and the same scene written in Python have the same states; run on any ranks."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    LoadStep,
    RigidPlane,
    Scene,
    ShapeProblem,
    State,
    Support,
    Surface,
    SurfaceDesign,
    TotalForce,
    Traction,
    box_partition,
    minimize,
    read_scene_file,
    solve_scene,
    solve_steps,
)
from fenics_contact._scene_file.reading import SceneFile
from fenics_contact.design import BundleTrust, NonlinearConstraint, TotalPotential
from fenics_contact.gallery import LinkShape, block, box_lattice, hemisphere, two_links
from fenics_contact.materials import IsotropicElasticity
from tests.conftest import ROOT

STEEL = IsotropicElasticity(2.1e5, 0.3)


def two_blocks(comm: MPI.Comm) -> Sequence[State]:
    """The scene of two_blocks.toml."""
    lower = block((0.0, 0.0, 0.0), (4.0, 3.0, 1.0), (8, 6, 2))
    upper = block((1.0, 0.5, 1.0), (3.0, 2.5, 2.0), (6, 6, 3))
    scene = Scene(
        {"lower": Body(lower, STEEL), "upper": Body(upper, STEEL)},
        supports=[Support("lower", "z0")],
        loads=[Traction("upper", "z1", (20.0, 0.0, -100.0))],
        contacts=[ContactPair(Surface("upper", "z0"), Surface("lower", "z1"), Coulomb(0.3))],
    )
    return [solve_scene(scene, comm, tolerance=1e-6)]


def sheared_block(comm: MPI.Comm) -> Sequence[State]:
    """The first ten steps of sheared_block.toml."""
    mesh = block((0.0, 0.0, 0.0), (40.0, 20.0, 15.0), (16, 8, 6))
    scene = Scene(
        {"block": Body(mesh, IsotropicElasticity(5.0, 0.45))},
        contacts=[ContactPair(Surface("block", "z0"), RigidPlane((0, 0, 0), (0, 0, 1)), Coulomb(0.5))],
    )
    path = np.concatenate([np.linspace(0.0, 1.5, 7), np.linspace(1.5, -1.5, 13)[1:]])[:10]
    steps = [LoadStep(f"{x}", supports=[Support("block", "z1", (x, 0.0, -0.5))]) for x in path]
    return solve_steps(ContactProblem(scene, comm, tolerance=1e-6), steps)


def hertz(comm: MPI.Comm) -> Sequence[State]:
    """The scene of hertz.toml."""
    ticks = np.expm1(3 * np.linspace(0, 1, 13)) / np.expm1(3)
    symmetry = {"x0": (0.0, None, None), "y0": (None, 0.0, None)}
    scene = Scene(
        {
            "ball": Body(hemisphere(10.0, 9, grading=3.0), STEEL),
            "block": Body(box_lattice([10.5 * ticks, 10.0 * ticks, -10.0 * ticks[::-1]]), STEEL),
        },
        supports=[Support(body, cut, value) for body in ("ball", "block") for cut, value in symmetry.items()]
        + [Support("block", "z0", (None, None, 0.0))],
        loads=[TotalForce("ball", "top", (0.0, 0.0, -3750.0))],
        contacts=[ContactPair(Surface("block", "z1"), Surface("ball", "contact"), discretisation="mortar")],
    )
    return [solve_scene(scene, comm, tolerance=1e-6)]


def chain_scene(comm: MPI.Comm) -> tuple[Scene, SurfaceDesign]:
    """The scene of chain_links.toml with fewer cells, and its design."""
    links = two_links(LinkShape(n_around=36, n_a=4, n_b=10))
    scene = Scene(
        {"link 1": Body(links.first.mesh, STEEL), "link 2": Body(links.second.mesh, STEEL)},
        supports=[Support("link 1", "grip")],
        loads=[TotalForce("link 2", "grip", (80e3, 0.0, 0.0))],
        contacts=[
            ContactPair(
                Surface("link 2", "contact"),
                Surface("link 1", "contact"),
                Coulomb(0.3),
                discretisation="node",
            )
        ],
    )
    return scene, SurfaceDesign("link 1", links.first.crown, net=(5, 3))


SMALL_CHAIN = (
    "meshes.links.grading=0.0", "meshes.links.n_around=36", "meshes.links.n_a=4", "meshes.links.n_b=10",
    "solver.subdomains=[4, 1, 1]", "design.surfaces.0.net=[5, 3]", "design.max_iterations=3",
)  # fmt: skip


def compare_states(name: str, python: Callable[[MPI.Comm], Sequence[State]], comm: MPI.Comm) -> int:
    """Compare the states of an example with those of Python; return how many there were."""
    file = read_scene_file(ROOT / "demos" / "scenes" / f"{name}.toml", comm)
    wanted = python(comm)
    for found, other in zip(states_of(file, len(wanted)), wanted, strict=True):
        for body in other.scene.bodies:
            one, two = (state.gather_displacement(body) for state in (found, other))
            np.testing.assert_allclose(one, two, atol=1e-10 * np.abs(two).max(), rtol=0)
        force = other.contact.normal_force
        assert force.max() > 0
        np.testing.assert_allclose(found.contact.normal_force, force, atol=1e-10 * force.max(), rtol=0)
    return len(wanted)


def states_of(file: SceneFile, count: int) -> list[State]:
    """Return the first states of a file."""
    if not file.steps:
        return [file.solve()]
    sequence = file.sequence()
    return [sequence.advance(step) for step in file.steps[:count]]


def compare_optimisation(comm: MPI.Comm) -> int:
    """Compare the optimisation of chain_links.toml, made small, with that of Python."""
    file = read_scene_file(ROOT / "demos" / "scenes" / "chain_links.toml", comm, overrides=SMALL_CHAIN)
    found = file.shape_task().minimize()
    scene, design = chain_scene(comm)
    partitions = {name: box_partition(body.mesh, (4, 1, 1)) for name, body in scene.bodies.items()}
    problem = ShapeProblem(ContactProblem(scene, comm, partitions=partitions), design, TotalPotential())
    start = np.zeros(problem.size)
    volume, _ = problem.volume(start)
    wanted = minimize(
        problem,
        start,
        BundleTrust(tolerance=1e-4, max_iterations=3, raise_on_failure=False),
        bounds=(start - 0.25, start + 0.25),
        constraints=NonlinearConstraint(problem.volume, lower=volume, name="volume"),
    )
    assert wanted.iterations == 3
    assert wanted.value < wanted.history[0].value
    np.testing.assert_allclose(found.x, wanted.x, atol=1e-10, rtol=0)
    np.testing.assert_allclose(found.value, wanted.value, rtol=1e-10)
    return wanted.iterations


def main(name: str, comm: MPI.Comm) -> None:
    """Compare one example and print how much there was to compare."""
    scenes = {"two_blocks": two_blocks, "sheared_block": sheared_block, "hertz": hertz}
    count = compare_optimisation(comm) if name == "chain_links" else compare_states(name, scenes[name], comm)
    if comm.rank == 0:
        print("same", count)


if __name__ == "__main__":
    main(sys.argv[1], MPI.COMM_WORLD)
