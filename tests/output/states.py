"""A state to write: solved once, written by many tests."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

from mpi4py import MPI

from fenics_contact import Coulomb, Scene, Status, solve_scene
from fenics_contact.results.deformed_state import AnyState
from tests.scenes import partitions, two_blocks


def blocks(cell: str = "hexahedron") -> Scene:
    """Two blocks in frictional contact; the upper one has a name with a blank."""
    scene = two_blocks(Coulomb(0.4), cell)
    bodies = {"lower": scene.bodies["lower"], "upper block": scene.bodies["upper"]}
    (pair,) = scene.contacts
    loads = [replace(load, body="upper block") for load in scene.loads]
    contact = replace(pair, slave=replace(pair.slave, body="upper block"))
    return Scene(bodies, scene.supports, loads, [contact])


@lru_cache(maxsize=2)
def touching_blocks(cell: str = "hexahedron") -> AnyState:
    """Open, sticking and slipping points are all there."""
    scene = blocks(cell)
    state = solve_scene(scene, MPI.COMM_SELF, partitions=partitions(scene), tolerance=1e-6)
    assert all(state.contact.count(status) > 0 for status in Status), "some status is missing"
    return state
