"""Nodes on the edge between two contact pairs have the area of both surfaces, which move with a design."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import ContactProblem, Coulomb, Scene, Surface, SurfaceDesign, Tresca
from fenics_contact.design import TotalPotential
from tests.design.chains import SOLVER
from tests.design.plane_blocks import OBJECTIVES, on_block, on_obstacle
from tests.design.quotients import Line, Remembering
from tests.scenes import partitions


def in_two(scene: Scene) -> Scene:
    """The same scene with the curve of contact cut in two pairs."""
    (pair,) = scene.contacts
    block = scene.bodies["block"]
    base = block.mesh.surfaces["y0"]
    left = block.mesh.points[base].mean(axis=1)[:, 0] < 1.0
    surfaces = {**block.mesh.surfaces, "left": base[left], "right": base[~left]}
    bodies = {**scene.bodies, "block": replace(block, mesh=replace(block.mesh, surfaces=surfaces))}
    pairs = [replace(pair, slave=Surface("block", name)) for name in ("left", "right")]
    return replace(scene, bodies=bodies, contacts=pairs)


def by_mortar() -> Scene:
    """The facets under the edge are wide: means over both sides of it compare the same places."""
    scene = on_block(Coulomb(0.38), "quadrilateral")
    return replace(scene, contacts=[replace(scene.contacts[0], discretisation="mortar")])


SCENES: dict[str, Callable[[], Scene]] = {
    "floor": partial(on_obstacle, Coulomb(0.3), "quadrilateral"),
    "Tresca": partial(on_obstacle, Tresca(0.6), "triangle"),
    "blocks": partial(on_block, Coulomb(0.38), "quadrilateral"),
    "mortar": by_mortar,
}


@pytest.mark.parametrize("name", SCENES)
def test_derivatives_of_pressures_know_the_areas_on_both_sides_of_an_edge(name: str) -> None:
    scene = in_two(SCENES[name]())
    contact = ContactProblem(scene, MPI.COMM_SELF, partitions=partitions(scene, (2, 1, 1)), solver=SOLVER)
    block = Remembering(contact, (SurfaceDesign("block", "y0", 5),), TotalPotential())
    alpha = 0.004 * np.random.default_rng(1).standard_normal(block.size)
    line = Line(block, alpha, np.random.default_rng(6).standard_normal(block.size), 1e-5)

    assert line.state().contact.points.count == len(np.unique(scene.bodies["block"].mesh.surfaces["y0"]))
    for objective in ("energy", "area", "unevenness"):
        assert line.miss(OBJECTIVES[objective]) < 1e-5
