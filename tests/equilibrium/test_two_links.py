"""Two interlocked chain links: curved surfaces, meshes that do not match, a link held by friction alone."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import scipy.sparse as sp
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    Coulomb,
    Scene,
    Status,
    Support,
    Surface,
    TotalForce,
    box_partition,
    solve_scene,
)
from fenics_contact.gallery import LinkShape, two_links
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.qp import FaceNewton
from fenics_contact.results.deformed_state import AnyState
from tests.equilibrium.checks import assert_solved, friction_law

TOLERANCE, FRICTION = 1e-7, 0.12
LOAD = np.array([80e3, 2e3, 0.0])
STEEL = IsotropicElasticity(2.1e5, 0.3)


@pytest.fixture(scope="module")
def state() -> AnyState:
    links = two_links(LinkShape(n_around=24, n_a=4, n_b=12))
    held, pulled = links.first.mesh, links.second.mesh
    scene = Scene(
        {"held": Body(held, STEEL), "pulled": Body(pulled, STEEL)},
        [Support("held", "grip")],
        [TotalForce("pulled", "grip", tuple(LOAD))],
        [ContactPair(Surface("pulled", "contact"), Surface("held", "contact"), Coulomb(FRICTION))],
    )
    parts = {"held": box_partition(held, (4, 1, 2)), "pulled": box_partition(pulled, (4, 1, 2))}
    return solve_scene(scene, MPI.COMM_SELF, partitions=parts, solver=FaceNewton(tolerance=TOLERANCE))


def own_rows(state: AnyState) -> SimpleNamespace:
    """Write down N and T from the contact points, on nodes that are not torn."""
    points = state.contact.points
    spread = sp.kron(points.jump, np.eye(3)).tocsr()
    along = sp.block_diag([n[None] for n in points.normal])
    flat = sp.block_diag([np.eye(3) - np.outer(n, n) for n in points.normal])
    return SimpleNamespace(
        slave=points.slave, N=-along @ spread, T=flat @ spread, normal=points.normal, gap=points.gap,
        bound=np.zeros(points.count), coefficient=np.full(points.count, FRICTION),
    )  # fmt: skip


def test_the_whole_law_holds_on_curved_surfaces(state: AnyState) -> None:
    assert_solved(state, TOLERANCE)
    assert state.contact.count(Status.OPEN) > 0
    assert state.contact.count(Status.STICK) > 0
    assert state.contact.count(Status.SLIP) > 2
    law = friction_law(state, SimpleNamespace(rows=own_rows(state)))
    assert {sentence: value for sentence, value in law.items() if value > 1e-6} == {}


def test_contact_and_friction_alone_carry_the_load(state: AnyState) -> None:
    contact = state.contact
    assert contact.force.sum(axis=0) == pytest.approx(-LOAD, abs=1e-6 * np.abs(LOAD).max())
    points = state.scene.bodies["pulled"].mesh.points
    offset = state.scene.bodies["held"].mesh.n_nodes
    moment = np.cross(points[contact.points.slave - offset], contact.force).sum(axis=0)
    for subdomain in state.system.torn.subdomains:
        if subdomain.mesh.body == "pulled":
            moment += np.cross(subdomain.points, subdomain.load.reshape(-1, 3)).sum(axis=0)
    assert np.abs(moment).max() < 1e-6 * np.abs(LOAD).max() * np.abs(points).max()
    friction = np.abs(contact.force - contact.normal_force[:, None] * contact.points.normal)
    assert friction.max() > 100.0


def test_the_master_feels_the_opposite_of_the_slave(state: AnyState) -> None:
    points, force = state.contact.points, state.contact.force
    torn = state.system.force(state.solution.multiplier)  # Bᵀλ on torn dofs
    count = sum(body.mesh.n_nodes for body in state.scene.bodies.values())
    found = np.zeros((count, 3))
    offsets = {"held": 0, "pulled": state.scene.bodies["held"].mesh.n_nodes}
    start = 0
    for subdomain in state.system.torn.subdomains:
        stop = start + subdomain.mesh.size
        nodes = subdomain.mesh.nodes + offsets[subdomain.mesh.body]
        np.add.at(found, nodes, -torn[start:stop].reshape(-1, 3))
        start = stop
    expected = points.jump.T @ force
    fixed = state.system.torn.decomposition.fixed.any(axis=1)
    touched = np.zeros(count, dtype=bool)
    touched[points.jump.indices] = True
    assert touched.sum() > 50
    assert np.abs(found - expected)[touched & ~fixed].max() < 1e-8 * np.abs(expected).max()
