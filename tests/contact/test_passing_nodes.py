"""Nodes of a master that pass between those of a coarse slave are told of, with the depth."""

from __future__ import annotations

import logging

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, ContactPair, Pressure, Scene, State, Support, Surface, solve_scene
from fenics_contact.gallery import block, rectangle, rectangle_lattice
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from tests.contact.round_bodies import pressed


def solved(caplog: pytest.LogCaptureFixture, scene: Scene) -> tuple[State, list[str]]:
    """Return the state of a scene and what is told of nodes of masters."""
    caplog.clear()
    with caplog.at_level(logging.WARNING):
        state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-8)
    words = [record.getMessage() for record in caplog.records]
    return state, [each for each in words if each.startswith("nodes of the master of ")]


def depth(state: State) -> float:
    """Return how far nodes of the lower body are above lines between closed ones of the upper body."""
    low, high = (state.scene.bodies[name].mesh for name in ("lower", "upper"))
    places = [
        low.points + state.gather_displacement("lower"),
        high.points + state.gather_displacement("upper"),
    ]
    top, bottom = (
        places[n][np.unique(mesh.surfaces[side])]
        for n, (mesh, side) in enumerate(((low, "y1"), (high, "y0")))
    )
    bottom = bottom[np.argsort(bottom[:, 0])]
    closed = state.contact_places[state.contact.normal_force > 0.0, 0]
    inside = top[np.abs(top[:, 0]) <= np.abs(closed).max()]
    return float((inside[:, 1] - np.interp(inside[:, 0], *bottom.T)).max())


def test_the_depth_between_coarse_nodes_is_told(caplog: pytest.LogCaptureFixture) -> None:
    scene, _ = pressed(2, 4, 0.5, discretisation="node")
    state, (words,) = solved(caplog, scene)
    told = float(words.split("by up to ")[1].split(",")[0])
    assert told == pytest.approx(depth(state), rel=0.3)
    assert ": refine the slave, or let the finer surface be the slave; linear cells have " in words


@pytest.mark.parametrize(
    ("ratio", "discretisation"), [(0.5, "mortar"), (0.8, "node"), (1.0, "node"), (2.0, "node")]
)
def test_mortar_and_finer_slaves_are_not_told(
    ratio: float, discretisation: str, caplog: pytest.LogCaptureFixture
) -> None:
    assert solved(caplog, pressed(2, 4, ratio, discretisation=discretisation)[0])[1] == []


def test_masters_that_bulge_beside_a_punch_are_not_told(caplog: pytest.LogCaptureFixture) -> None:
    """Nodes of the plate just beyond the edge of the punch rise above its end."""
    half = np.array([0.0, 0.5, 0.5025, 0.505, 0.51, 0.52, 0.54, 0.6, 0.8, 1.2, 2.0])
    down = np.array([0.0, 0.5, 0.8, 0.9, 0.95, 0.98, 0.99, 0.995, 1.0])
    plate = rectangle_lattice([np.concatenate([-half[:0:-1], half]), down])
    meshes = {"punch": rectangle((-0.5, 1.0), (0.5, 2.0), (2, 2)), "plate": plate}
    scene = Scene(
        {name: Body(mesh, PlaneStrain(1e3, 0.3)) for name, mesh in meshes.items()},
        [Support("plate", "y0"), Support("punch", "y1", (0.0, -0.01))],
        contacts=[ContactPair(Surface("punch", "y0"), Surface("plate", "y1"), discretisation="node")],
    )
    state, words = solved(caplog, scene)
    assert state.contact.normal_force.min() > 0.0
    assert words == []


def test_finer_slaves_are_not_told_that_are_coarser_along_an_axis(caplog: pytest.LogCaptureFixture) -> None:
    meshes = {
        "upper": block((0.0, 0.0, 1.0), (1.0, 1.0, 2.0), (5, 3, 2), "tetrahedron"),
        "lower": block((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (3, 4, 2), "tetrahedron"),
    }
    sides = {"x0": (0.0, None, None), "y0": (None, 0.0, None)}
    rollers = [Support(name, side, value) for name in meshes for side, value in sides.items()]
    scene = Scene(
        {name: Body(mesh, IsotropicElasticity(1e3, 0.3)) for name, mesh in meshes.items()},
        [*rollers, Support("lower", "z0", (None, None, 0.0))],
        [Pressure("upper", "z1", 1.0)],
        [ContactPair(Surface("upper", "z0"), Surface("lower", "z1"), discretisation="node")],
    )
    assert solved(caplog, scene)[1] == []
