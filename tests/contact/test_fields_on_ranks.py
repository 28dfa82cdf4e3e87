"""What users see of a state is the same on any number of ranks, at the tolerance that they get."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import solve_scene
from fenics_contact.feti.averages import nodal_mean
from tests.contact.fields_on_ranks import SCENES, cut

SCRIPT = Path(__file__).with_name("fields_on_ranks.py")
Mpirun = Callable[..., str]
Fields = dict[str, dict[str, list[float]]]


@pytest.fixture(scope="module")
def alone() -> Fields:
    from tests.conftest import run_on_ranks

    return dict(json.loads(run_on_ranks(SCRIPT, 1)))


@pytest.mark.parametrize("ranks", [2, 4])
def test_displacement_and_stress_are_the_same_on_any_number_of_ranks(
    ranks: int, alone: Fields, mpirun: Mpirun
) -> None:
    found = json.loads(mpirun(SCRIPT, ranks))
    assert set(alone) == set(SCENES)
    for name, fields in alone.items():
        for what, values in fields.items():
            size = np.abs(values).max()
            assert size > 0.0
            np.testing.assert_allclose(found[name][what], values, rtol=0, atol=1e-9 * size)


@pytest.mark.parametrize("name", SCENES)
def test_the_displacement_of_a_state_is_one_of_whole_bodies(name: str) -> None:
    """Copies of nodes agree, supports hold, and contact points are where the solver has them."""
    scene = SCENES[name]()
    state = solve_scene(scene, MPI.COMM_SELF, partitions=cut(scene))
    torn, system = state.torn, state.dual
    size = np.abs(state.torn_displacement).max()
    equality = system.problem.layout.equality
    before, after = (
        torn.right - torn.jump(u) for u in (state.torn_displacement, state.conforming_displacement)
    )
    assert np.abs(before[equality]).max() > 1e-6 * size, "the solver left nothing to sew"
    assert np.abs(after[equality]).max() < 1e-14 * size
    contact = system.problem.layout.contact
    np.testing.assert_allclose(after[contact], before[contact], rtol=0, atol=1e-14 * size)
    mean = nodal_mean(torn.decomposition, state.torn_displacement)
    free = ~torn.decomposition.fixed
    shown = np.concatenate([state.gather_displacement(body) for body in scene.bodies])
    copies = torn.decomposition.tearing.multiplicity > 1
    shares = torn.decomposition.tearing.copy_share
    assert name != "patched" or shares.max() > 0.9, "copies of a node should differ in stiffness"
    np.testing.assert_allclose(
        shown[copies[:, None] & free], mean[copies[:, None] & free], rtol=0, atol=1e-14 * size
    )


def test_only_what_is_next_to_seams_and_supports_moves_and_forces_inside_stay() -> None:
    scene = SCENES["patched"]()
    state = solve_scene(scene, MPI.COMM_SELF, partitions=cut(scene))
    moved = state.conforming_displacement - state.torn_displacement
    interface = state.dual.inverse.interface
    start = 0
    for subdomain in state.torn.subdomains:
        part = slice(start, start + subdomain.mesh.size)
        force = np.abs(subdomain.stiffness @ moved[part])
        own = interface[(interface >= part.start) & (interface < part.stop)] - start
        inside = np.setdiff1d(np.arange(subdomain.mesh.size), own)
        assert force[own].max() > 0.0
        assert force[inside].max(initial=0.0) < 1e-9 * force[own].max()
        start = part.stop
