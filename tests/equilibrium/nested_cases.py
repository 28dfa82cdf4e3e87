"""Scenes of simplices whose states start those on finer meshes, and what ranks print of one."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    FluidPressure,
    LinearClosure,
    Preload,
    RigidPlane,
    RigidSphere,
    RigidSurface,
    Roller,
    Scene,
    Section,
    SlipTable,
    Spring,
    Support,
    Surface,
    Tie,
    TotalForce,
    Traction,
    gallery,
)
from fenics_contact._adaptive.refined_scene import SceneRefinement, refine_scene
from fenics_contact.gallery.blocks import split_quadrilaterals
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.mesh import bisection_partition, quadratic
from tests.kinematics.revolved import twisted_fit

STEEL, SOFT = PlaneStrain(2.1e5, 0.3), PlaneStrain(5e4, 0.2)


def disc_on_block(
    *, cells: int = 3, order: int = 1, pushed: bool = True, turn: int = 1, **pair: object
) -> Scene:
    """A disc pushed, or pressed by a force alone, onto a block, with friction unless the pair says else."""
    disc = split_quadrilaterals(gallery.half_disc(10.0, cells, grading=2.0, symmetry="" if pushed else "x"))
    left = -4.0 if pushed else 0.0
    floor = gallery.rectangle((left, -4.0), (4.0, 0.0), (2 * cells, cells), "triangle")
    meshes = {"disc": disc, "floor": floor}
    if order == 2:
        meshes = {name: quadratic(mesh) for name, mesh in meshes.items()}
    held, loads = [Support("floor", "y0")], []
    if pushed:
        held.append(Support("disc", "top", (0.08, -0.5)))
    else:
        held += [Support(name, "x0", (0.0, None)) for name in meshes]
        loads.append(TotalForce("disc", "top", (0.0, -9e3)))
    faces = (Surface("floor", "y1"), Surface("disc", "contact"))[::turn]
    contact = ContactPair(
        *faces,
        **{"friction": Coulomb(0.3), "discretisation": "mortar", **pair},
    )  # fmt: skip
    return Scene({name: Body(mesh, STEEL) for name, mesh in meshes.items()}, held, loads, [contact])


def two_plates(count: int = 4) -> dict[str, Body]:
    """A plate on a wider one, whose nodes do not match."""
    lower = gallery.rectangle((0.0, 0.0), (3.0, 1.0), (count + 1, 2), "triangle")
    upper = gallery.rectangle((0.4, 1.0), (2.2, 2.0), (count, 3), "triangle")
    return {"lower": Body(lower, STEEL), "upper": Body(upper, SOFT)}


FACES = Surface("upper", "y0"), Surface("lower", "y1")


def tied_on_oblique_rollers() -> Scene:
    """Two plates that are tied, turned by 30 degrees, on rollers."""
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    bodies = {
        name: replace(body, mesh=body.mesh.moved(body.mesh.points @ np.array([[c, s], [-s, c]])))
        for name, body in two_plates().items()
    }
    rollers = [Roller("lower", "y0"), Roller("lower", "x0")]
    return Scene(bodies, rollers, [Traction("upper", "x1", (10.0, 30.0))], ties=[Tie(*FACES)])


def tied_beside_contact() -> Scene:
    """Two plates on a third one, on the same cells of it: one is tied, the other pressed down."""
    bodies = {
        "base": Body(gallery.rectangle((0.0, 0.0), (4.0, 1.0), (3, 2), "triangle"), SOFT),
        "tied": Body(gallery.rectangle((0.2, 1.0), (1.9, 2.0), (4, 2), "triangle"), STEEL),
        "pressed": Body(gallery.rectangle((2.1, 1.0), (3.8, 2.0), (5, 2), "triangle"), STEEL),
    }
    top = Surface("base", "y1")
    ties, contacts = (
        [Tie(Surface("tied", "y0"), top)],
        [ContactPair(Surface("pressed", "y0"), top, Coulomb(0.2))],
    )
    loads = [Traction("pressed", "y1", (3.0, -50.0)), Traction("tied", "y1", (20.0, 30.0))]
    return Scene(bodies, [Support("base", "y0")], loads, contacts, ties=ties)


def sprung_on_two_contacts() -> Scene:
    """A plate that springs draw onto another one and against a wall."""
    springs = [
        Spring(Surface("upper", "y1"), (1.0, -3.0), 8e4, tension=600.0, name="down"),
        Spring(Surface("upper", "x1"), Surface("lower", "x1"), 3e4, name="link"),
    ]
    wall = ContactPair(Surface("upper", "x0"), RigidPlane((0.4, 0.0), (1.0, 0.0)), discretisation="mortar")
    contacts = [ContactPair(*FACES, Coulomb(0.2), "node"), wall]
    loads = [Traction("upper", "x1", (-40.0, 0.0))]
    return Scene(two_plates(), [Support("lower", "y0")], loads, contacts, springs=springs)


def turned_by_a_moment() -> Scene:
    """A plate on a rigid surface that a moment turns, in contact with another one."""
    top = RigidSurface("upper", "y1", (1.3, 2.0), (0.0, None), None, force=(0.0, -300.0), moment=40.0)
    contacts = [ContactPair(*FACES, Coulomb(0.4), "mortar")]
    return Scene(two_plates(), [Support("lower", "y0"), top], contacts=contacts)


def drawn_together() -> Scene:
    """A bar between walls with a preload."""
    bar = gallery.rectangle((0.0, 0.0), (1.0, 4.0), (2, 8), "triangle")
    preload = Preload("bar", Section((0.5, 1.9), (0.0, 1.0)), force=10.0)
    return Scene({"bar": Body(bar, SOFT)}, [Support("bar", "y0"), Support("bar", "y1")], preloads=[preload])


def bent_alone() -> Scene:
    """A bar that a traction bends."""
    bar = gallery.rectangle((0.0, 0.0), (4.0, 1.0), (9, 3), "triangle")
    return Scene({"bar": Body(bar, SOFT)}, [Support("bar", "x0")], [Traction("bar", "x1", (0.0, -1.0))])


def quarter_on_ball() -> Scene:
    """A quarter of a block on a rigid ball: on planes of symmetry friction has one free direction."""
    block = gallery.block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (2, 2, 2), "tetrahedron")
    held = [Support("block", "x0", (0.0, None, None)), Support("block", "y0", (None, 0.0, None))]
    ball = ContactPair(Surface("block", "z0"), RigidSphere((0.0, 0.0, -10.0), 10.0), Coulomb(0.05))
    bodies = {"block": Body(block, IsotropicElasticity(1e3, 0.3))}
    return Scene(bodies, held, [TotalForce("block", "z1", (0.0, 0.0, -300.0))], [ball])


def outside(points: np.ndarray) -> np.ndarray:
    """Mark places away from the middle."""
    return np.abs(points[:, 0]) > 1.5


SCENES: dict[str, Callable[[], Scene]] = {
    "friction": disc_on_block,
    "nodes": lambda: disc_on_block(discretisation="node"),
    "quadratic": lambda: disc_on_block(cells=2, order=2, discretisation="node"),
    "floating": lambda: disc_on_block(pushed=False, friction=None),
    "laws": lambda: disc_on_block(friction=Coulomb(0.3, stick_stiffness=1e6), closure=LinearClosure(1e5)),
    "slip": lambda: disc_on_block(friction=Coulomb(SlipTable((0.0, 0.02), (0.3, 0.2)))),
    "fluid": lambda: disc_on_block(friction=None, turn=-1, fluid=FluidPressure(5.0, enters=outside)),
    "ties": tied_on_oblique_rollers,
    "tie beside": tied_beside_contact,
    "springs": sprung_on_two_contacts,
    "free": turned_by_a_moment,
    "preload": drawn_together,
    "twist": lambda: twisted_fit("triangle", 2, "mortar", 1e-3),
    "alone": bent_alone,
    "quarter": quarter_on_ball,
}


def cut(scene: Scene, parts: int) -> dict[str, np.ndarray]:
    """Cut every body into some subdomains."""
    return {name: bisection_partition(body.mesh, parts) for name, body in scene.bodies.items()}


def refined_near(scene: Scene, place: tuple[float, ...], reach: float) -> SceneRefinement:
    """Refine near a place, and the first body alone if that is all that is near."""
    marked = {}
    for name, body in scene.bodies.items():
        centres = body.mesh.points[body.mesh.cells].mean(axis=1)
        near = np.flatnonzero(np.linalg.norm(centres - place, axis=1) < reach)
        if len(near):
            marked[name] = near
    return refine_scene(scene, marked)


def main(comm: MPI.Comm) -> None:
    """Print what a start from a coarser mesh leads to on some ranks."""
    scene = disc_on_block(cells=4)
    coarse = ContactProblem(scene, comm, partitions=cut(scene, 3), tolerance=1e-9).solve()
    fine = refined_near(scene, (0.0, 0.0), 6.0)
    problem = ContactProblem(fine.scene, comm, partitions=cut(fine.scene, 5), tolerance=1e-4)
    state = problem.solve(start=coarse, refinements=fine.refinements)
    first = state.solution.history[0].residuals
    if comm.rank == 0:
        print(state.solution.products, first.natural, first.gluing, state.energies.strain)


if __name__ == "__main__":
    main(MPI.COMM_WORLD)
    sys.exit(0)
