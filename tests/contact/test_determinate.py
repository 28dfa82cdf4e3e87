"""Bodies held just so: as many rows as rigid motions, whose forces equilibrium alone gives."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, ContactPair, Pressure, Scene, State, Support, Surface, Tie, solve_scene
from fenics_contact.feti import DualSystem, build_torn_system, decompose
from fenics_contact.feti.inverse import LocalKind
from fenics_contact.gallery import rectangle
from fenics_contact.materials import PlaneStrain

SOFT = PlaneStrain(1.0, 0.3)


def beam_on_a_block(rows: int, tied: bool) -> Scene:
    """A beam held along x at its left end, resting with one node on a block, under pressure."""
    block = rectangle((1.5, 0.0), (2.5, 1.0), (2, 2))
    beam = rectangle((0.0, 1.0), (6.0, 2.0), (3, rows))
    over, under = Surface("beam", "y0"), Surface("block", "y1")
    return Scene(
        {"block": Body(block, SOFT), "beam": Body(beam, SOFT)},
        [Support("block", "y0", (0.0, 0.0)), Support("beam", "x0", (0.0, None))],
        [Pressure("beam", "y1", 1e-3)],
        [] if tied else [ContactPair(over, under, discretisation="node")],
        [Tie(over, under, True, "node")] if tied else [],
    )


def moments(state: State) -> np.ndarray:
    """Return what is missing to equilibrium of the beam: forces and the moment, by contact alone."""
    contact, places = state.contact, state.contact_places
    force = contact.force.sum(axis=0)
    turned = (places[:, 0] * contact.force[:, 1] - places[:, 1] * contact.force[:, 0]).sum()
    return np.array([*force, turned])


@pytest.mark.parametrize("rows", [1, 2, 3])
def test_a_contact_force_that_equilibrium_gives(rows: int) -> None:
    state = solve_scene(beam_on_a_block(rows, tied=False), MPI.COMM_SELF)

    assert state.contact.points.count == 1
    np.testing.assert_allclose(moments(state)[1], 6e-3, rtol=1e-9)


@pytest.mark.parametrize("rows", [1, 2])
def test_a_tie_that_equilibrium_gives_bends_the_beam_as_contact_does(rows: int) -> None:
    tied, touching = (
        solve_scene(beam_on_a_block(rows, tied=tied), MPI.COMM_SELF, tolerance=1e-11)
        for tied in (True, False)
    )

    np.testing.assert_allclose(
        tied.gather_displacement("beam"), touching.gather_displacement("beam"), rtol=1e-9, atol=1e-12
    )


@pytest.mark.parametrize("kind", [LocalKind.EXPLICIT, LocalKind.IMPLICIT])
def test_the_inverse_of_such_a_body_is_one(kind: LocalKind) -> None:
    scene = beam_on_a_block(1, tied=False)
    parts = {name: np.zeros(body.mesh.n_cells, dtype=int) for name, body in scene.bodies.items()}
    torn = build_torn_system(scene, decompose(scene, parts, MPI.COMM_SELF))
    system = DualSystem(torn, kind=kind)
    beam = torn.subdomains[1]
    start = torn.subdomains[0].mesh.size
    force = np.random.default_rng(0).standard_normal(beam.mesh.size)
    modes, _ = np.linalg.qr(beam.kernel)
    force -= modes @ (modes.T @ force)  # only balanced forces bend a body that floats
    given = np.concatenate([np.zeros(start), force])

    found = system.inverse(given)[start:]

    np.testing.assert_allclose(beam.stiffness @ found, force, atol=1e-10 * np.abs(force).max())
