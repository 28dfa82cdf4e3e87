"""Surfaces in contact whose facets have different sizes: hanging nodes carry no constraint of their own."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    Coulomb,
    Scene,
    State,
    Support,
    Surface,
    Tie,
    Traction,
    contact_area,
    solve_scene,
)
from fenics_contact._pairing.search import find_contact_points
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.mesh import refined
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.shapes import Sphere


def halved(mesh: BodyMesh, low: tuple[float, float, float], high: tuple[float, float, float]) -> BodyMesh:
    """Return a mesh with the cells in a box halved."""
    centres = mesh.points[mesh.cells].mean(axis=1)
    return refined(mesh, ((centres > low) & (centres < high)).all(axis=1)).mesh


def blocks() -> dict[str, BodyMesh]:
    """Return two blocks, each with facets of two sizes where they touch."""
    low = halved(block((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (3, 3, 3)), (0.5, 0.0, 0.5), (1.0, 1.0, 1.0))
    high = halved(block((0.0, 0.0, 1.0), (1.0, 1.0, 2.0), (4, 5, 3)), (0.0, 0.0, 1.0), (1.0, 0.6, 1.6))
    return {"low": low, "high": high}


def pressed(pair: ContactPair | Tie) -> State:
    """Press the blocks together; they may widen freely."""
    meshes = blocks()
    supports = [Support("low", "z0", (None, None, 0.0))]
    for name in meshes:
        supports += [Support(name, "x0", (0.0, None, None)), Support(name, "y0", (None, 0.0, None))]
    bodies = {name: Body(mesh, IsotropicElasticity(100.0, 0.3)) for name, mesh in meshes.items()}
    pairs = {"contacts": [pair]} if isinstance(pair, ContactPair) else {"ties": [pair]}
    scene = Scene(bodies, supports, [Traction("high", "z1", (0.0, 0.0, -1.0))], **pairs)
    return solve_scene(scene, MPI.COMM_SELF, tolerance=1e-11)


SIDES = Surface("high", "z0"), Surface("low", "z1")


@pytest.mark.parametrize("kind", ["contact", "friction", "tie"])
def test_even_pressure_is_even_on_facets_of_different_sizes(kind: str) -> None:
    pair = {
        "contact": ContactPair(*SIDES, discretisation="mortar"),
        "friction": ContactPair(*SIDES, Coulomb(0.5), discretisation="mortar"),
        "tie": Tie(*SIDES, discretisation="mortar"),
    }[kind]
    state = pressed(pair)
    for name, body in state.scene.bodies.items():
        assert np.isin(body.mesh.hanging.nodes, body.mesh.surfaces["z0" if name == "high" else "z1"]).any()
        exact = body.mesh.points * [0.003, 0.003, -0.01]
        np.testing.assert_allclose(state.gather_displacement(name), exact, atol=1e-11)
    if kind != "tie":
        np.testing.assert_allclose(state.contact.pressure, 1.0, rtol=1e-8)
        hanging = state.scene.bodies["high"].mesh.hanging.nodes
        assert not np.isin(state.contact.points.slave - state.scene.bodies["low"].mesh.n_nodes, hanging).any()
        # In fields, and for the area, they have the mean of their masters.
        field = state.gather_fields("high").points["contact_pressure"]
        np.testing.assert_allclose(field[np.unique(state.scene.bodies["high"].mesh.surfaces["z0"])], 1.0)
        assert contact_area(state) == pytest.approx(1.0)
    assert state.balance().imbalance < 1e-9


def test_by_nodes_the_areas_of_hanging_nodes_go_to_their_masters() -> None:
    state = pressed(ContactPair(*SIDES, discretisation="node"))
    contact = state.contact
    assert contact.area.sum() == pytest.approx(1.0)
    assert (contact.pressure > 0.5).all()
    assert contact.normal_force.sum() == pytest.approx(1.0, rel=1e-9)
    assert state.balance().imbalance < 1e-9


def fitted(cells: int, upper: bool) -> BodyMesh:
    """Return a block whose upper or lower side lies on one ball, and knows it."""
    mesh = block((-1.0, -1.0, 0.0), (1.0, 1.0, 1.0), (cells, cells, 2))
    points = mesh.points.copy()
    there = 4.0 - np.sqrt(16.0 - (points[:, :2] ** 2).sum(axis=1))
    points[:, 2] = there + (1.0 - there) * points[:, 2] if upper else (1.0 + there) * points[:, 2] - 1.0
    shape = {"z0" if upper else "z1": Sphere((0.0, 0.0, 4.0), 4.0, hollow=not upper)}
    return BodyMesh(points, mesh.cells, mesh.surfaces, shapes=shape)


@pytest.mark.parametrize("kind", ["node", "mortar"])
def test_gaps_at_hanging_nodes_are_those_of_true_shapes(kind: str) -> None:
    """A ball in a socket of its size touches it everywhere, where facets of two sizes are far apart."""
    low = halved(fitted(5, False), (0.1, -1.0, -0.5), (1.0, 1.0, 0.5))
    high = halved(fitted(6, True), (-1.0, 0.1, -0.5), (1.0, 1.0, 0.5))
    for mesh, side in ((low, "z1"), (high, "z0")):
        hanging = np.intersect1d(mesh.hanging.nodes, mesh.surfaces[side])
        assert (np.abs(np.linalg.norm(mesh.points[hanging] - [0.0, 0.0, 4.0], axis=1) - 4.0) > 3e-3).all()
    bodies = {
        "low": Body(low, IsotropicElasticity(1e3, 0.3)),
        "high": Body(high, IsotropicElasticity(1e3, 0.3)),
    }
    scene = Scene(bodies, [Support("low", "z0")], [], [ContactPair(*SIDES, discretisation=kind)])  # type: ignore[arg-type]
    points = find_contact_points(scene, np.zeros((len(scene.points), 3), dtype=bool))
    place = scene.points[points.slave]
    inside = np.abs(place[:, :2]).max(axis=1) < 0.6
    assert inside.sum() > 10
    assert np.abs(points.gap[inside]).max() < 2e-6
