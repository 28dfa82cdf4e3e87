"""By nodes, quadratic cells that do not match miss a uniform pressure: the warning names by how much."""

from __future__ import annotations

import logging
import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from scipy.spatial.transform import Rotation

from fenics_contact import Body, ContactPair, RigidPlane, Scene, Support, Surface, Tie, solve_scene
from fenics_contact.feti import build_torn_system, decompose
from fenics_contact.gallery import rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.mesh import quadratic
from tests.pairing.pressed_boxes import PRESSURE, boxes, pressed

CELLS = ("quadrilateral", "triangle", "hexahedron", "tetrahedron")


def told(caplog: pytest.LogCaptureFixture, scene: Scene) -> list[str]:
    """Return what is told of the scene's pairs before anything is solved."""
    caplog.clear()
    with caplog.at_level(logging.WARNING):
        build_torn_system(scene, decompose(scene, scene.partition(), MPI.COMM_SELF))
    return [record.getMessage() for record in caplog.records]


def named(words: str) -> tuple[float, float]:
    """Return the errors that a warning names, as it is and with slave and master swapped."""
    here, swapped = re.findall(r"by (?:up to about )?(\d+) %", words)
    return float(here) / 100.0, float(swapped) / 100.0


@pytest.mark.parametrize("stiff", [1.0, 0.1])
@pytest.mark.parametrize("slave", ["a", "b"])
@pytest.mark.parametrize(
    ("cell", "cells"),
    [
        ("quadrilateral", (4, 6)),
        ("quadrilateral", (4, 8)),
        ("triangle", (4, 5)),
        ("hexahedron", (2, 3)),
        ("tetrahedron", (2, 3)),
        ("tetrahedron", (2, 4)),
    ],
)
def test_the_named_error_is_that_of_a_uniform_pressure(
    cell: str, cells: tuple[int, int], slave: str, stiff: float, caplog: pytest.LogCaptureFixture
) -> None:
    scene = pressed(boxes(cell, *cells), slave, stiff)
    words = told(caplog, scene)
    pressure = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-8).contact.pressure
    error = np.abs(pressure / PRESSURE - 1.0).max()
    if not words:
        assert error < 0.2
        return
    (one,) = words
    assert error / 2.0 < named(one)[0] < 2.0 * error
    (other,) = told(caplog, pressed(boxes(cell, *cells), "b" if slave == "a" else "a", stiff)) or [None]
    assert other is None or named(other) == named(one)[::-1]
    assert ("with slave and master swapped: swap them;" in one) == (named(one)[1] < named(one)[0])


def matching(cell: str) -> list[Scene]:
    """Scenes in which a uniform pressure is found: even ends beside each other, and bodies that are rigid."""
    meshes = boxes(cell, 3, 3, wide=2.0)
    scene = pressed(meshes)
    (pair,) = scene.contacts
    dim = scene.dim
    floor = RigidPlane((1.0,) * dim, (0.0,) * (dim - 1) + (1.0,))
    return [
        scene,
        pressed(meshes, "b"),
        replace(scene, contacts=[replace(pair, master=floor)]),
        pressed(boxes(cell, 3, 4, order=1)),
    ]


@pytest.mark.parametrize("cell", CELLS)
def test_matching_meshes_rigid_masters_and_linear_cells_are_not_told(
    cell: str, caplog: pytest.LogCaptureFixture
) -> None:
    for scene in matching(cell):
        assert told(caplog, scene) == []


def test_quadratic_cells_on_linear_ones_do_not_match_where_their_nodes_do(
    caplog: pytest.LogCaptureFixture,
) -> None:
    meshes = {"a": boxes("quadrilateral", 3, 3)["a"], "b": boxes("quadrilateral", 6, 6, order=1)["b"]}
    scene = pressed(meshes)
    (words,) = told(caplog, scene)
    pressure = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-8).contact.pressure
    assert named(words)[0] == pytest.approx(np.abs(pressure / PRESSURE - 1.0).max(), rel=0.5)


def arcs(inside: int, outside: int) -> Scene:
    """A disc in a wider ring, quarters of both."""
    meshes = {}
    for name, radii, cells in (("a", (0.5, 1.0), inside), ("b", (1.3, 2.0), outside)):
        flat = rectangle((radii[0], 0.0), (radii[1], np.pi / 2), (2, cells))
        r, angle = flat.points.T
        meshes[name] = quadratic(flat.moved(np.column_stack([r * np.cos(angle), r * np.sin(angle)])))
    pair = ContactPair(Surface("a", "x1"), Surface("b", "x0"), discretisation="node")
    bodies = {name: Body(mesh, PlaneStrain(1e3, 0.3)) for name, mesh in meshes.items()}
    return Scene(bodies, [Support("a", "x0"), Support("b", "x1")], contacts=[pair])


def test_areas_that_differ_by_curvature_are_no_error(caplog: pytest.LogCaptureFixture) -> None:
    assert told(caplog, arcs(4, 4)) == []
    (words,) = told(caplog, arcs(4, 6))
    (flat,) = told(caplog, pressed(boxes("quadrilateral", 4, 6)))
    assert named(words) == pytest.approx(named(flat), rel=0.3)


@pytest.mark.parametrize("slave", ["a", "b"])
def test_ends_of_the_other_surface_are_left_out(slave: str, caplog: pytest.LogCaptureFixture) -> None:
    (even,) = told(caplog, pressed(boxes("quadrilateral", 8, 12), slave))
    meshes = boxes("quadrilateral", 8, 12, wide=2.0)
    meshes["b"] = meshes["b"].moved(meshes["b"].points - (1.0 / 24.0, 0.0))
    (wide,) = told(caplog, pressed(meshes, slave))
    assert named(wide) == pytest.approx(named(even), rel=0.15)


def test_the_error_is_the_same_turned_and_in_other_units(caplog: pytest.LogCaptureFixture) -> None:
    turn = Rotation.from_rotvec([0.3, -0.5, 0.7]).as_matrix()
    meshes = boxes("hexahedron", 2, 3)
    scene = pressed(meshes)
    scene = replace(scene, supports=[Support("b", "z0"), Support("a", "z1")], loads=[])
    (words,) = told(caplog, scene)
    for unit in (1e-6, 1e6):
        moved = {name: mesh.moved(unit * (mesh.points @ turn.T)) for name, mesh in meshes.items()}
        bodies = {name: Body(mesh, IsotropicElasticity(7.0 / unit, 0.0)) for name, mesh in moved.items()}
        assert told(caplog, replace(scene, bodies=bodies)) == [words]


def test_ties_by_nodes_are_told_likewise(caplog: pytest.LogCaptureFixture) -> None:
    scene = pressed(boxes("quadrilateral", 4, 6))
    (pair,) = scene.contacts
    assert isinstance(pair.master, Surface)
    tie = Tie(pair.slave, pair.master, discretisation="node")
    assert told(caplog, replace(scene, contacts=[], ties=[tie])) == told(caplog, scene)


def test_one_rank_tells_what_all_have_found(mpirun: Callable[..., str]) -> None:
    code = """
        import logging, sys
        from mpi4py import MPI
        from fenics_contact.feti import build_torn_system, decompose
        from tests.pairing.pressed_boxes import boxes, pressed
        logging.basicConfig(level=logging.WARNING, format="%(message)s", stream=sys.stdout)
        scene = pressed(boxes("quadrilateral", 4, 6))
        build_torn_system(scene, decompose(scene, scene.partition(2), MPI.COMM_WORLD))
    """
    (words,) = mpirun(code, 2).strip().splitlines()
    assert named(words) == (0.16, 0.13)
